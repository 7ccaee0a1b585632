import pytest

from mav_tasks.errors import UsageError

pytest.importorskip("mcp", reason="the MCP SDK is missing: pip install 'mav-tasks[mcp]'")

from mav_tasks.agents.streamable_http import Place, place_of


@pytest.mark.parametrize(
    ("text", "place", "authority"),
    [
        ("127.0.0.1:8765", Place("127.0.0.1", 8765), "127.0.0.1:8765"),
        ("127.8.9.1:0", Place("127.8.9.1", 0), "127.8.9.1:0"),
        ("localhost:80", Place("localhost", 80), "localhost:80"),
        ("[::1]:8765", Place("::1", 8765), "[::1]:8765"),
    ],
)
def test_a_place_on_this_machine(text: str, place: Place, authority: str) -> None:
    assert place_of(text) == place
    assert place.authority == authority


@pytest.mark.parametrize(
    "text", ["0.0.0.0:80", "192.168.1.4:80", "[::]:80", "example.org:80", "localhost.evil.org:80"]
)
def test_other_machines_cannot_reach_it(text: str) -> None:
    with pytest.raises(UsageError, match=r"can be reached from other machines.*reverse proxy"):
        place_of(text)


@pytest.mark.parametrize("text", ["", "8765", "127.0.0.1", ":80", "127.0.0.1:x", "127.0.0.1:65536"])
def test_what_is_no_place_is_refused(text: str) -> None:
    with pytest.raises(UsageError, match="expected HOST:PORT"):
        place_of(text)
