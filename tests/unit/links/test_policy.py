"""What is asked of signatures on a link, and which links are refused for it."""

from dataclasses import replace

import pytest

from mav_tasks.errors import InsecureLinkError, UsageError
from mav_tasks.links.config_check import faults_of, links_of, pushed_to
from mav_tasks.links.policy import LinkPolicy, Side, policy_of
from mav_tasks.links.url import parse_url
from mav_tasks.settings import Links

OPEN, CLOSED = LinkPolicy(), LinkPolicy(takes_unsigned=False)
NEAR, FAR, WIRE = "udpin:127.0.0.1:1", "udpin:0.0.0.0:1", "serial:/dev/ttyUSB0:57600"


def faults(**links: object) -> list[tuple[str, str]]:
    wanted = replace(Links(push=()), **links)  # type: ignore[arg-type]
    return [(field, str(fault)) for field, fault in faults_of(wanted)]


@pytest.mark.parametrize(
    ("url", "unsigned", "insecure", "policy"),
    [
        (NEAR, "loopback", False, OPEN),
        (NEAR, "nowhere", False, CLOSED),
        (NEAR, "nowhere", True, CLOSED),  # who asks for both means the stricter
        (FAR, "loopback", False, CLOSED),
        (FAR, "loopback", True, OPEN),
        (FAR, "nowhere", True, CLOSED),
        (WIRE, "loopback", False, OPEN),
        (WIRE, "nowhere", False, CLOSED),
        (f"{FAR}?unsigned=allow", "nowhere", False, OPEN),
        (f"{NEAR}?unsigned=refuse", "loopback", True, CLOSED),
        (f"{WIRE}?unsigned=refuse", "loopback", False, CLOSED),
    ],
)
@pytest.mark.parametrize("side", ["clients", "vehicles"])
def test_unsigned_packets_are_taken_where_nobody_else_can_be(
    url: str, unsigned: str, insecure: bool, policy: LinkPolicy, side: Side
) -> None:
    rules = Links(unsigned=unsigned, insecure=insecure)
    assert policy_of(parse_url(url), side, rules) == policy


@pytest.mark.parametrize("insecure", [False, True])
@pytest.mark.parametrize("url", [NEAR, FAR, WIRE])
def test_on_a_link_to_vehicles_that_has_a_key_only_that_counts(url: str, insecure: bool) -> None:
    rules = Links(insecure=insecure)
    mine = parse_url(f"{url}?key=r1")
    assert policy_of(mine, "vehicles", rules) == LinkPolicy(takes_unsigned=False, key="r1")
    both = parse_url(f"{url}?key=r1&unsigned=allow")
    assert policy_of(both, "vehicles", rules) == LinkPolicy(takes_unsigned=True, key="r1")


def test_a_link_for_clients_that_signs_takes_unsigned_ones_as_any_other() -> None:
    url = parse_url(f"{NEAR}?key=anna")
    assert policy_of(url, "clients", Links()) == LinkPolicy(takes_unsigned=True, key="anna")


def test_who_pushes_to_other_machines_is_no_loopback_link() -> None:
    links = Links(push=("127.0.0.1:14550", "192.0.2.1:14550"))
    client, vehicle = links_of(links)
    assert client.pushes_far
    assert client.policy == CLOSED
    assert vehicle.policy == OPEN


@pytest.mark.parametrize(
    ("field", "url", "words"),
    [
        ("clients", f"{FAR}?unsigned=allow", "needs no signing key"),
        ("vehicles", FAR, "has no signing key"),
        ("vehicles", "tcp:192.0.2.1:5760", "has no signing key"),
        ("vehicles", f"{FAR}?unsigned=refuse", "has no signing key"),
        ("vehicles", f"{FAR}?key=r1&unsigned=allow", "needs no signing key"),
    ],
)
def test_what_reaches_others_without_a_key_needs_a_word(field: str, url: str, words: str) -> None:
    ((where, fault),) = faults(**{field: (url,)})
    assert where == field
    assert words in fault
    assert "use --insecure" in fault


@pytest.mark.parametrize(
    "links",
    [
        {"clients": (FAR,)},  # whether there is a key is seen later
        {"clients": (f"{FAR}?unsigned=refuse",)},
        {"clients": (WIRE,), "vehicles": ("serial:/dev/ttyUSB1:57600",)},
        {"vehicles": (f"{FAR}?key=r1",)},
        {"vehicles": (f"{FAR}?key=r1&unsigned=allow",), "insecure": True},
        {"clients": (f"{FAR}?unsigned=allow",), "insecure": True},
        {"vehicles": ("udpout:192.0.2.1:1",), "insecure": True},
        {"push": ("192.0.2.1:14550",)},
        {"unsigned": "nowhere", "vehicles": (f"{NEAR}?key=r1",)},
        {"unsigned": "nowhere", "vehicles": (f"{NEAR}?unsigned=allow",)},
    ],
)
def test_other_links_are_good_as_far_as_their_words_say(links: dict[str, object]) -> None:
    assert faults(**links) == []


def test_who_pushes_to_others_unsigned_needs_a_word() -> None:
    clients = (f"{NEAR}?unsigned=allow",)
    ((where, fault),) = faults(clients=clients, push=("127.0.0.1:2", "192.0.2.1:14550"))
    assert (where, fault[:45]) == ("push", "push 192.0.2.1:14550 reaches beyond this mach")
    assert faults(clients=clients, push=("192.0.2.1:14550",), insecure=True) == []


def test_a_rover_that_could_not_be_heard_is_a_fault() -> None:
    ((where, fault),) = faults(unsigned="nowhere")
    assert where == "vehicles"
    assert "accepts no unsigned packets, but has no key: add ?key=NAME" in fault


def test_a_link_is_the_same_whatever_is_asked_on_it() -> None:
    ((where, fault),) = faults(clients=(NEAR,), vehicles=(f"{NEAR}?key=a",))
    assert (where, fault) == ("vehicles", f"link {NEAR} is given twice")


def test_faults_are_of_the_kinds_that_they_were() -> None:
    kinds = {
        type(fault)
        for url in (FAR, f"{NEAR}?unsigned=refuse")
        for _, fault in faults_of(Links(vehicles=(url,), push=()))
    }
    assert kinds == {InsecureLinkError, UsageError}


def test_a_server_does_not_push_to_itself() -> None:
    """Its heartbeats would come in as those of a rover."""
    links = Links(vehicles=("udpin:127.0.0.1:14540", "udpin:0.0.0.0:7", "udpin:10.0.0.5:8"))
    assert pushed_to(links) == (("127.0.0.1", 14550),)
    links = replace(links, push=("127.0.0.1:7", "localhost:14540", "10.0.0.5:8", "127.0.0.1:8"))
    assert pushed_to(links) == (("127.0.0.1", 8),)
