"""Whether the keys that links need are there."""

from datetime import UTC, datetime

import pytest

from mav_tasks.errors import InsecureLinkError, UsageError
from mav_tasks.key_ring.ring import Entry, KeyRing, key_of
from mav_tasks.link_keys import check_keys, in_words
from mav_tasks.links.config_check import links_of
from mav_tasks.settings import Links

AT = datetime(2026, 11, 21, 14, 30, tzinfo=UTC)
FAR, NEAR = "udpin:0.0.0.0:1", "udpin:127.0.0.1:1"


def ring(**kinds: str) -> KeyRing:
    whole = KeyRing()
    for name, kind in kinds.items():
        key = key_of(name, kind, name.encode().ljust(32))
        whole = whole.with_added(Entry(name, kind, key))
    return whole


def check(links: Links, keys: KeyRing | None) -> None:
    check_keys(links, keys, where="keys.toml")


@pytest.mark.parametrize(
    "keys",
    [None, ring(), ring(r1="vehicle"), ring(a="safety").with_revoked("a", at=AT)],
    ids=["no ring", "empty", "of vehicles", "revoked"],
)
def test_a_link_for_others_needs_somebody_who_can_sign(keys: KeyRing | None) -> None:
    for links in (Links(clients=(FAR,)), Links(push=("192.0.2.1:1",))):
        with pytest.raises(InsecureLinkError, match=r"no client has a signing key: .* use --in"):
            check(links, keys)
    check(Links(clients=(FAR,), insecure=True), keys)
    check(Links(clients=(NEAR,)), keys)


def test_one_usable_key_is_enough() -> None:
    check(Links(clients=(FAR,)), ring(a="observer"))


@pytest.mark.parametrize("side", ["clients", "vehicles"])
def test_a_key_that_is_named_must_be_there(side: str) -> None:
    links = Links(**{side: (f"{NEAR}?key=ben",)})  # type: ignore[arg-type]
    for keys, there in ((None, "none"), (ring(anna="safety"), "anna")):
        with pytest.raises(UsageError) as caught:
            check(links, keys)
        assert (
            str(caught.value) == f"link {NEAR}: no key 'ben' (usable keys: {there}), in keys.toml"
        )
    with pytest.raises(UsageError, match="key ben was revoked on 2026-11-21"):
        check(links, ring(ben="safety").with_revoked("ben", at=AT))
    check(links, ring(ben="safety" if side == "clients" else "vehicle"))


def test_a_vehicles_key_is_none_of_a_clients() -> None:
    with pytest.raises(UsageError, match="key r1 has role vehicle"):
        check(Links(clients=(f"{NEAR}?key=r1",)), ring(r1="vehicle"))


def test_a_clients_key_is_none_of_a_vehicles() -> None:
    """Or who overhears what the rover is told could have it done on a link for clients."""
    with pytest.raises(UsageError, match="key ben has role safety: "):
        check(Links(vehicles=(f"{NEAR}?key=ben",)), ring(ben="safety"))


def test_what_is_asked_is_said() -> None:
    links = Links(clients=(NEAR, FAR), vehicles=("tcp:127.0.0.1:2?key=r1",))
    said = [in_words(link, has_ring=True) for link in links_of(links)]
    assert said == [", unsigned, too", ", signed only", ", signed only, key r1"]
    assert in_words(links_of(links)[0], has_ring=False) == ""
