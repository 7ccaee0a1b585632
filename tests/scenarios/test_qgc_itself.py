"""The station of the other test_qgc files: it complains when a vehicle misbehaves, and as told.

Without these its silence in the others would say nothing. Times and texts are those of the real
one, seen at a stub.
"""

import re
from dataclasses import replace
from pathlib import Path

import pytest

from mav_tasks.in_memory import CLIENT_LINK
from tests.kit import qgc
from tests.kit.qgc import parameters
from tests.kit.qgc.pair import Pair
from tests.kit.qgc.profile import MASTER, V4, Profile
from tests.kit.qgc.stub import (
    APM_AUTOPILOT,
    APM_SET,
    GENERIC_AUTOPILOT,
    PX4_SET,
)

SILENT = {148, 300, 397, 395}

both = pytest.mark.parametrize("profile", [V4, MASTER], ids=lambda p: p.name)


class TestConnecting:
    @both
    @pytest.mark.parametrize("autopilot", [APM_AUTOPILOT, 12, GENERIC_AUTOPILOT])
    def test_to_a_good_vehicle_is_quick_and_silent(self, profile: Profile, autopilot: int) -> None:
        pair = Pair(profile, autopilot=autopilot).connected(within=2.5)
        pair.run(20)
        pair.party.check()

    def test_begins_in_mavlink_1_and_goes_on_in_2(self) -> None:
        pair = Pair()
        pair.run(1.5)
        markers = [message.get_msgbuf()[0] for _, _, message in pair.stub.heard]
        first_of_2 = markers.index(0xFD)
        assert markers == [0xFE] * first_of_2 + [0xFD] * (len(markers) - first_of_2)
        assert {name for _, name, _ in pair.stub.heard[:first_of_2]} == {"HEARTBEAT"}

    def test_asks_in_the_order_that_was_seen(self) -> None:
        pair = Pair().connected()
        asked = [(n, int(getattr(m, "param1", 0))) for _, n, m in pair.stub.heard[1:]]
        order = [(n, p) for n, p in asked if n not in ("HEARTBEAT", "MISSION_ACK", "SYSTEM_TIME")]
        requests = [("COMMAND_LONG", number) for number in (148, 300, 397, 395)]
        lists = [("PARAM_REQUEST_LIST", 0), *[("MISSION_REQUEST_LIST", 0)] * 3]
        assert order == [*requests, *lists]

    def test_asks_ardupilot_for_streams_in_five_rounds(self) -> None:
        pair = Pair(autopilot=APM_AUTOPILOT).connected()
        pair.run(30)
        times = [at for at, name, _ in pair.stub.heard if name == "REQUEST_DATA_STREAM"]
        assert len(times) == 35
        assert times[-1] - times[0] == pytest.approx(17.0, abs=0.1)
        assert not any(n == "COMMAND_LONG" and m.param1 == 300 for _, n, m in pair.stub.heard)

    def test_without_a_protocol_version_falls_back_to_mavlink_1(self) -> None:
        pair = Pair(silent_requests={300}).connected(within=10)
        assert pair.popups == []
        assert "fell back" in pair.party.qgc.screen.violations[0].text
        tries = [
            at for at, name, m in pair.stub.heard if name == "COMMAND_LONG" and m.param1 == 300
        ]
        gaps = [at - tries[0] for at in tries]
        assert len(tries) == 3
        assert 3.0 <= gaps[1] <= 3.5
        assert gaps[2] - gaps[1] == pytest.approx(0.5, abs=0.01)
        kinds = [m.mission_type for _, n, m in pair.stub.heard if n == "MISSION_REQUEST_LIST"]
        assert kinds == [0]
        assert pair.stub.heard[-1][2].get_msgbuf()[0] == 0xFE

    @pytest.mark.parametrize(("profile", "least", "most"), [(V4, 16, 20), (MASTER, 20, 62)])
    def test_without_any_message_takes_long_and_goes_on(
        self, profile: Profile, least: float, most: float
    ) -> None:
        pair = Pair(profile, silent_requests=SILENT | {435, 280}).connected(within=90)
        assert pair.popups == []
        (asked,) = (at for at, n, _ in pair.stub.heard if n == "PARAM_REQUEST_LIST")
        assert least <= asked <= most

    @pytest.mark.parametrize("autopilot", [APM_AUTOPILOT, 12])
    def test_without_parameters_complains_after_25_s(self, autopilot: int) -> None:
        pair = Pair(autopilot=autopilot, silent={"PARAM_REQUEST_LIST"})
        pair.run(60)
        assert 25 <= pair.popup_at("Vehicle 1 did not respond to request for parameters") <= 27
        assert sum(n == "PARAM_REQUEST_LIST" for _, n, _ in pair.stub.heard) == 5
        assert not any(n == "MISSION_REQUEST_LIST" for _, n, _ in pair.stub.heard)

    def test_a_generic_one_without_parameters_waits_for_ever_in_silence(self) -> None:
        pair = Pair(autopilot=GENERIC_AUTOPILOT, silent={"PARAM_REQUEST_LIST"})
        pair.run(200)
        assert pair.popups == []
        assert not pair.party.is_connected

    def test_without_missions_complains_three_times(self) -> None:
        pair = Pair(silent={"MISSION_REQUEST_LIST"}).connected(within=60)
        words = "transfer failed. Error: Mission request list failed, maximum retries exceeded."
        assert pair.popups == [f"{n} {words}" for n in ("Mission", "GeoFence", "Rally Point")]
        assert sum(n == "MISSION_REQUEST_LIST" for _, n, _ in pair.stub.heard) == 21
        assert pair.now == pytest.approx(31.5, abs=1.5)

    def test_an_old_px4_is_complained_of(self) -> None:
        pair = Pair(sw_version=1 << 24 | 3 << 16).connected()
        assert [text[:33] for text in pair.popups] == ["QGroundControl supports PX4 Pro fi"[:33]]

    @pytest.mark.parametrize("name", sorted(PX4_SET))
    def test_each_of_the_five_parameters_of_px4_is_missed(self, name: str) -> None:
        pair = Pair(parameters={n: v for n, v in PX4_SET.items() if n != name}).connected()
        pair.run(2)
        assert pair.popups == [parameters.SETUP, parameters.MISSING.format(name)]

    @pytest.mark.parametrize("name", ["RCMAP_YAW", "RC4_TRIM", "COMPASS_DEV_ID3", "FRAME_CLASS"])
    def test_those_of_ardupilot_are_missed(self, name: str) -> None:
        rest = {n: v for n, v in APM_SET.items() if n != name}
        pair = Pair(autopilot=APM_AUTOPILOT, parameters=rest).connected()
        pair.run(2)
        assert pair.popups == [parameters.SETUP, parameters.MISSING.format(name)]

    def test_nothing_is_asked_for_again_after_a_silence(self) -> None:
        pair = Pair().connected()
        pair.stub.talks = False
        pair.run(5)
        pair.stub.talks = True
        before = len(pair.stub.heard)
        pair.run(5)
        assert [each.text[:18] for each in pair.party.qgc.screen.notices] == [
            "Communication lost",
            "Communication rega",
        ]
        assert {name for _, name, _ in pair.stub.heard[before:]} == {"HEARTBEAT"}
        pair.party.check()


class TestSequenceNumbers:
    @pytest.mark.parametrize("each", [5, 10])
    def test_left_out_ones_are_a_loss(self, each: int) -> None:
        pair = Pair(leaves_out_each=each).connected()
        pair.run(60)
        lost, received = pair.party.qgc.lost[1, 1], pair.party.qgc.wire.received[1, 1]
        assert lost / (lost + received) == pytest.approx(1 / each, rel=0.4)
        with pytest.raises(AssertionError, match="seems to have lost"):
            pair.party.check()

    def test_one_counter_for_two_components_is_a_loss(self) -> None:
        pair = Pair(counts_together=True).connected()
        pair.run(10)
        assert set(pair.party.qgc.lost) == {(1, 1), (1, 191)}


class TestTexts:
    @pytest.mark.parametrize(
        ("severity", "text", "is_popup"),
        [(3, "broken", True), (4, "careful", False), (6, "news", False), (2, "old\t", False)],
    )
    def test_errors_are_popups_and_doubles_of_events_are_dropped(
        self, severity: int, text: str, is_popup: bool
    ) -> None:
        pair = Pair().connected()
        pair.stub.say(severity, text, component=191)
        pair.run(0.1)
        assert pair.popups == ([text] if is_popup else [])

    @pytest.mark.parametrize("length", [51, 74, 99, 100, 149])
    def test_pieces_are_joined(self, length: int) -> None:
        pair = Pair().connected()
        text = ("The mission leads over the fence at item 3. " * 4)[:length].strip()
        pair.stub.say(3, text)
        pair.run(1.1)
        assert pair.popups == [text]


def test_what_is_no_packet_is_noticed() -> None:
    pair = Pair().connected()
    pair.net.send(CLIENT_LINK, "qgc", b"\xfd\x01\x00\x00no packet at all")
    pair.run(0.1)
    with pytest.raises(AssertionError):
        pair.party.check()


def test_a_version_that_hears_only_heartbeats_in_mavlink_1() -> None:
    assert not MASTER.hears_mavlink1
    pair = Pair(replace(V4, hears_mavlink1=False)).connected()
    pair.party.check()


def test_it_is_made_of_nothing_of_the_servers() -> None:
    """What the server misunderstands would else be misunderstood on both sides alike."""
    joins_them = {"party.py", "pair.py", "stub.py", "joined.py"}
    files = [path for path in Path(qgc.__path__[0]).glob("*.py") if path.name not in joins_them]
    assert len(files) > 12
    for path in files:
        assert not re.search(r"(import|from) (mav_tasks|rover_sim)", path.read_text()), path.name
