"""Whose a packet is, as the engine sees it; and what the store has to keep for that."""

from math import inf
from typing import Any

import pytest
from pymavlink.dialects.v20 import common

from mav_tasks.engine.clients.signatures import UNSIGNED, Signatures
from mav_tasks.engine.inputs import KeysChanged, LinkChanged, LinkSide
from mav_tasks.mavlink.packet import Packet, split_datagram
from mav_tasks.mavlink.signing import HIGHEST_TIMESTAMP, Key, timestamp_at, timestamp_of

UTC = 1.8e9  # s
NOW = timestamp_at(UTC)
ANNA, BEN = Key("anna", b"a" * 32, "operator"), Key("ben", b"b" * 32, "safety")
ROVER, OTHER = Key("r1", b"r" * 32), Key("r2", b"o" * 32)
REVOKED = Key("anna", b"", "operator", ANNA.fingerprint)
CLIENTS, VEHICLES = "clients", "vehicles"
UNSIGNED_HEARTBEAT = bytes.fromhex("fd090000fa01bf0000000f0000000a03d10403deb7")


def signatures(*keys: Key, clients: dict[str, Any] | None = None, **made: Any) -> Signatures:
    """A server with a link for clients on which all is signed, and one to vehicles with a key."""
    it = Signatures(window=60.0, **made)
    it.set_wall(UTC)
    it.change_keys(KeysChanged(keys or (ANNA, BEN, ROVER, OTHER)))
    asked = {"takes_unsigned": False} | (clients or {})
    it.change_link(LinkChanged(CLIENTS, LinkSide.CLIENTS, up=True, **asked))
    it.change_link(
        LinkChanged(VEHICLES, LinkSide.VEHICLES, up=True, takes_unsigned=False, key="r1")
    )
    return it


def packet(
    key: Key | None = ANNA,
    *,
    timestamp: int = NOW,
    link_id: int = 1,
    kind: str = "command",
    v1: bool = False,
) -> Packet:
    """A packet by pymavlink."""
    mav = common.MAVLink(None, srcSystem=255, srcComponent=190)
    if key is not None:
        mav.signing.secret_key, mav.signing.sign_outgoing = key.secret, True
        mav.signing.link_id, mav.signing.timestamp = link_id, timestamp
    made: Any = {
        "command": common.MAVLink_command_long_message(1, 1, 400, 0, 1, 0, 0, 0, 0, 0, 0),
        "heartbeat": common.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3),
        "setpoint": common.MAVLink_manual_control_message(1, 500, 0, 500, 0, 0),
        "radio": common.MAVLink_radio_status_message(1, 2, 3, 4, 5, 6, 7),
    }[kind]
    (whole,) = split_datagram(made.pack(mav, force_mavlink1=v1))
    return whole


def counts(it: Signatures) -> tuple[int, int, int]:
    return it.counts.unsigned, it.counts.unverified, it.counts.old


def test_each_key_of_the_ring_is_known_by_its_signature() -> None:
    it = signatures()
    assert it.admit(CLIENTS, "p", packet(ANNA)) == ANNA
    assert it.admit(CLIENTS, "p", packet(BEN)) == BEN
    assert it.admit(CLIENTS, "q", packet(ANNA, timestamp=NOW + 1)) == ANNA
    assert counts(it) == (0, 0, 0)


@pytest.mark.parametrize("v1", [False, True])
def test_unsigned_packets_are_taken_where_that_is_allowed(v1: bool) -> None:
    bare = packet(None, v1=v1)
    assert signatures().admit(CLIENTS, "p", bare) is None
    assert signatures(clients={"takes_unsigned": True}).admit(CLIENTS, "p", bare) is UNSIGNED


def test_a_mavlink_1_packet_of_who_signs_is_none_of_his() -> None:
    it = signatures()
    assert it.admit(CLIENTS, "p", packet(ANNA)) == ANNA
    assert it.admit(CLIENTS, "p", packet(None, v1=True)) is None
    assert counts(it) == (1, 0, 0)


def test_radios_of_vehicles_speak_unsigned() -> None:
    """A client's says nothing to a rover, and would make whoever sends one a client."""
    radio = packet(None, kind="radio")
    assert signatures().admit(VEHICLES, "p", radio) is UNSIGNED
    assert signatures().admit(CLIENTS, "p", radio) is None


@pytest.mark.parametrize("key", [ROVER, OTHER, Key("x", b"x" * 32, "safety")])
def test_what_is_signed_with_no_clients_key_is_unknown(key: Key) -> None:
    for takes_unsigned in (False, True):
        it = signatures(clients={"takes_unsigned": takes_unsigned})
        assert it.admit(CLIENTS, "p", packet(key)) is None
        assert counts(it) == (0, 1, 0)


@pytest.mark.parametrize("key", [ANNA, BEN, OTHER, None])
def test_on_a_link_to_vehicles_only_its_own_key_counts(key: Key | None) -> None:
    it = signatures()
    assert it.admit(VEHICLES, "rover", packet(ROVER)) == ROVER
    assert it.admit(VEHICLES, "rover", packet(key, timestamp=NOW + 1)) is None


def test_the_same_bytes_are_no_news_wherever_they_come_from() -> None:
    it = signatures()
    raw = packet()
    assert it.admit(CLIENTS, "p", raw) == ANNA
    assert [it.admit(CLIENTS, peer, raw) for peer in ("p", "attacker")] == [None, None]
    assert counts(it) == (0, 0, 2)


def test_nor_after_a_restart_on_what_the_store_has() -> None:
    it = signatures()
    raw = packet()
    it.admit(CLIENTS, "p", raw)
    seen = it.take_times()
    assert seen is not None, "at once: before the command is answered"
    again = signatures(times=seen.times, signed_until=seen.signed_until)
    assert again.admit(CLIENTS, "p", raw) is None
    assert again.admit(CLIENTS, "p", packet(timestamp=NOW + 1)) == ANNA


@pytest.mark.parametrize(
    ("kind", "within"), [("heartbeat", 60.0), ("setpoint", 1.0), ("command", 0.0)]
)
def test_a_time_is_kept_as_soon_as_its_packet_could_do_harm_again(kind: str, within: float) -> None:
    it = signatures()
    it.admit(CLIENTS, "p", packet())
    it.sealed(CLIENTS, "p", UNSIGNED_HEARTBEAT)
    it.take_times()  # of its own times it keeps a reserve, at once
    it.admit(CLIENTS, "p", packet(kind=kind, timestamp=NOW + 1))
    assert it.keep_at == within
    it.now = within - 0.1
    assert it.take_times() is None
    it.now = within
    seen = it.take_times()
    assert seen is not None
    assert [time.timestamp for time in seen.times] == [NOW + 1]
    assert it.keep_at == inf


def test_an_idle_station_is_written_down_once_a_minute() -> None:
    it, written = signatures(), 0
    for second in range(3600):
        it.now = float(second)
        beat = packet(kind="heartbeat", timestamp=NOW + second * 100_000)
        assert it.admit(CLIENTS, "p", beat) == ANNA
        it.sealed(CLIENTS, "p", UNSIGNED_HEARTBEAT)
        written += it.take_times() is not None
    assert 55 <= written <= 62


def test_who_signs_is_answered_with_his_key_and_in_his_time() -> None:
    it = signatures()
    ahead = NOW + 500
    it.admit(CLIENTS, "p", packet(timestamp=ahead))
    (sealed,) = split_datagram(it.sealed(CLIENTS, "p", UNSIGNED_HEARTBEAT))
    assert timestamp_of(sealed) > ahead
    assert it.sealed(CLIENTS, "q", UNSIGNED_HEARTBEAT) == UNSIGNED_HEARTBEAT


@pytest.mark.parametrize("utc", [0.0, 1_577_836_799.0])  # 1970, 2019
def test_a_clock_that_was_never_set_believes_any_that_goes_on(utc: float) -> None:
    it = Signatures(window=60.0)
    it.set_wall(utc)
    it.change_keys(KeysChanged((ANNA,)))
    it.change_link(LinkChanged(CLIENTS, LinkSide.CLIENTS, up=True, takes_unsigned=False))
    year = 365 * 86_400 * 100_000
    for timestamp, key in ((NOW + year, ANNA), (NOW + year, None), (NOW + year + 1, ANNA)):
        assert it.admit(CLIENTS, "p", packet(timestamp=timestamp)) is key
    it.set_wall(UTC)
    assert it.admit(CLIENTS, "p", packet(timestamp=NOW)) is ANNA


def test_a_clock_behind_what_an_earlier_run_has_signed_was_not_set_yet() -> None:
    """As of a computer that goes on from when it was switched off."""
    it = signatures()
    raw = packet(timestamp=NOW - 1000)
    it.admit(CLIENTS, "p", raw)
    it.sealed(CLIENTS, "p", UNSIGNED_HEARTBEAT)
    seen = it.take_times()
    assert seen is not None
    again = signatures(times=seen.times, signed_until=seen.signed_until)
    again.set_wall(UTC - 3600.0)
    assert again.admit(CLIENTS, "p", raw) is None
    assert again.admit(CLIENTS, "p", packet(timestamp=NOW + 100 * 100_000)) == ANNA
    again.set_wall(UTC + 120.0)
    assert again.admit(CLIENTS, "p", packet(timestamp=NOW + 3600 * 100_000)) is None
    assert again.admit(CLIENTS, "p", packet(timestamp=NOW + 121 * 100_000)) == ANNA


def test_who_is_refused_for_the_time_is_told_once_a_minute() -> None:
    it, told = signatures(), []
    for second in range(90):
        it.now = float(second)
        for late in (-3600, 3600):
            timestamp = NOW + (second - late) * 100_000
            assert it.admit(CLIENTS, "p", packet(timestamp=timestamp)) is None
        told += it.take_refused()
    assert [round(each.seconds) for each in told] == [-3600, -3600]
    assert str(told[0]).startswith(
        "packet of 255/190@p signed anna refused: signed 3600 s after this server's time"
    )
    assert (it.counts.ahead, it.counts.old) == (90, 90)


def test_each_end_is_signed_to_later_than_before_also_after_a_restart_with_the_clock_back() -> None:
    it = signatures()
    sent = [it.sealed(VEHICLES, "rover", UNSIGNED_HEARTBEAT) for _ in range(3)]
    seen = it.take_times()
    assert seen is not None
    again = signatures(times=seen.times, signed_until=seen.signed_until)
    again.set_wall(UTC - 3600.0)
    sent.append(again.sealed(VEHICLES, "rover", UNSIGNED_HEARTBEAT))
    times = [timestamp_of(split_datagram(each)[0]) for each in sent]
    assert times == sorted(set(times))


@pytest.mark.parametrize("ahead", [0.0, 0.05, 0.5, 5.0, 60.0, 110.0])
def test_a_vehicle_that_is_ahead_leads_no_time_away_over_restarts(ahead: float) -> None:
    """An autopilot's time is a minute ahead after its start: each run would add two."""
    until, utc = 0, UTC
    for _ in range(4):
        it = signatures(signed_until=until)
        it.set_wall(utc)
        assert it.admit(VEHICLES, "rover", packet(ROVER, timestamp=timestamp_at(utc + ahead)))
        it.sealed(VEHICLES, "rover", UNSIGNED_HEARTBEAT)
        it.sign_to(CLIENTS, "p", ANNA)
        to_client = it.sealed(CLIENTS, "p", UNSIGNED_HEARTBEAT)
        assert timestamp_of(split_datagram(to_client)[0]) - timestamp_at(utc) < 100_000
        seen = it.take_times()
        until = until if seen is None else seen.signed_until
        utc += 0.5


@pytest.mark.parametrize("behind", [0.0, 2.0])
def test_what_a_gateway_signed_whose_clock_is_ahead_leads_no_time_away(behind: float) -> None:
    it = signatures()
    it.sealed(VEHICLES, "rover", UNSIGNED_HEARTBEAT)
    seen = it.take_times()
    assert seen is not None
    other = signatures(signed_until=seen.signed_until)
    other.set_wall(UTC - behind)
    sent = other.sealed(VEHICLES, "rover", UNSIGNED_HEARTBEAT)
    assert timestamp_of(split_datagram(sent)[0]) < NOW + 100_000


@pytest.mark.parametrize("ahead", [0.0, 60.0, 110.0, 3600.0])
def test_each_holder_signs_later_than_the_one_before_to_a_vehicle_that_is_ahead(
    ahead: float,
) -> None:
    """The vehicle counts on each of its links by itself, so its time differs between them."""
    newest, times = timestamp_at(UTC + ahead), []
    for lead in (3.0, 6.0, 9.0):
        it = signatures()
        assert it.admit(VEHICLES, "rover", packet(ROVER, timestamp=newest - 100_000))
        it.take_lead(lead)
        sent = [it.sealed_as_holder(VEHICLES, "rover", UNSIGNED_HEARTBEAT) for _ in range(3)]
        times += [timestamp_of(split_datagram(each)[0]) for each in sent]
        newest = max(newest, *times)
    assert times == sorted(set(times))
    assert min(times) > timestamp_at(UTC + ahead) - 50 * 100_000


def test_a_holder_of_a_key_cannot_lead_the_servers_time_away() -> None:
    """Or else what others hear would be of one time for ever, and so no news to them.

    A vehicle's time may be ahead, a client's while the server's own clock was never set.
    """
    it = signatures()
    assert it.admit(CLIENTS, "p", packet(timestamp=HIGHEST_TIMESTAMP)) is None
    assert it.admit(VEHICLES, "rover", packet(ROVER, timestamp=HIGHEST_TIMESTAMP)) == ROVER
    it.admit(CLIENTS, "q", packet(BEN))
    for _ in range(3):
        it.sealed(VEHICLES, "rover", UNSIGNED_HEARTBEAT)  # it does not fail
    to_ben = [it.sealed(CLIENTS, "q", UNSIGNED_HEARTBEAT) for _ in range(2)]
    seen = it.take_times()
    assert seen is not None
    assert seen.signed_until < NOW + 3600 * 100_000
    again = signatures(times=seen.times, signed_until=seen.signed_until)
    again.admit(CLIENTS, "q", packet(BEN, timestamp=NOW + 1))
    to_ben += [again.sealed(CLIENTS, "q", UNSIGNED_HEARTBEAT) for _ in range(2)]
    times = [timestamp_of(split_datagram(each)[0]) for each in to_ben]
    assert times == sorted(set(times))


def test_a_revoked_key_is_unknown_and_nothing_is_signed_with_it() -> None:
    it = signatures()
    it.admit(CLIENTS, "p", packet())
    it.change_keys(KeysChanged((REVOKED, BEN)))
    assert not it.knows(ANNA)
    assert it.admit(CLIENTS, "p", packet(timestamp=NOW + 1)) is None
    assert it.sealed(CLIENTS, "p", UNSIGNED_HEARTBEAT) == UNSIGNED_HEARTBEAT
    assert counts(it) == (0, 1, 0)


def test_what_a_key_has_signed_is_no_news_when_it_comes_back() -> None:
    it = signatures()
    raw = packet()
    it.admit(CLIENTS, "p", raw)
    it.change_keys(KeysChanged((BEN,)))
    it.change_keys(KeysChanged((ANNA, BEN)))
    assert it.admit(CLIENTS, "p", raw) is None


def test_the_link_s_own_key_signs_to_who_has_not_signed_yet() -> None:
    it = signatures(clients={"takes_unsigned": True, "key": "anna"})
    (sealed,) = split_datagram(it.sealed(CLIENTS, "pushed to", UNSIGNED_HEARTBEAT))
    assert sealed.is_signed
    it.admit(CLIENTS, "pushed to", packet(BEN))
    again = it.sealed(CLIENTS, "pushed to", UNSIGNED_HEARTBEAT)
    assert again[10:21] == sealed.raw[10:21]
    assert again != sealed.raw


def test_no_repr_has_a_secret() -> None:
    it = signatures()
    it.admit(CLIENTS, "p", packet())
    for key in (ANNA, BEN, ROVER):
        assert key.secret.hex() not in repr(it)
        assert repr(key.secret) not in repr(it)
