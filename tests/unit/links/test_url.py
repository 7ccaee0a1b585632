"""Link URLs; every error names what is wrong."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.errors import InsecureLinkError, LinkUrlError
from mav_tasks.links.url import LinkUrl, is_loopback, parse_endpoint, parse_url, refuse_insecure


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("udpin:127.0.0.1:14560", LinkUrl("udpin", "127.0.0.1", 14560)),
        ("udpout:localhost:14580", LinkUrl("udpout", "localhost", 14580)),
        ("udpin://0.0.0.0:14550", LinkUrl("udpin", "0.0.0.0", 14550)),
        ("udpout:[::1]:65535", LinkUrl("udpout", "::1", 65535)),
    ],
)
def test_a_url_names_kind_host_and_port(text: str, url: LinkUrl) -> None:
    assert parse_url(text) == url


def test_a_url_reads_as_it_is_written() -> None:
    assert str(parse_url("udpin:127.0.0.1:14560")) == "udpin:127.0.0.1:14560"


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("14560", "link '14560': expected udpin:host:port or udpout:host:port"),
        ("udp:127.0.0.1:1", "link 'udp:127.0.0.1:1': expected udpin:host:port or udpout:host:port"),
        ("", "link '': expected udpin:host:port or udpout:host:port"),
        ("tcp:host:1", "link 'tcp:host:1': tcp links are not supported in this version"),
        (
            "serial:/dev/ttyUSB0:57600",
            "link 'serial:/dev/ttyUSB0:57600': serial links are not supported in this version",
        ),
        *[
            (text, f"link {text!r}: expected host:port with a port from 1 to 65535")
            for text in (
                "udpin:127.0.0.1",
                "udpin:127.0.0.1:",
                "udpin::14560",
                "udpin:127.0.0.1:0",
                "udpin:127.0.0.1:65536",
                "udpin:127.0.0.1:-1",
                "udpin:127.0.0.1:http",
                "udpout:",
            )
        ],
    ],
)
def test_an_error_names_what_is_wrong(text: str, words: str) -> None:
    with pytest.raises(LinkUrlError) as error:
        parse_url(text)
    assert str(error.value) == words


def test_an_endpoint_error_names_what_it_is_for() -> None:
    with pytest.raises(LinkUrlError, match=r"^--push x: expected host:port with a port"):
        parse_endpoint("x", what="--push x")


@given(st.text(max_size=40))
def test_any_text_is_a_url_or_a_clear_error(text: str) -> None:
    problem = ""
    try:
        assert 0 < parse_url(text).port < 65536
    except LinkUrlError as error:
        problem = str(error)
    assert not problem or repr(text) in problem


@pytest.mark.parametrize(
    ("host", "loopback"),
    [
        ("127.0.0.1", True),
        ("127.9.9.9", True),
        ("::1", True),
        ("localhost", True),
        ("0.0.0.0", False),
        ("192.168.1.2", False),
        ("rover.local", False),
        ("", False),
    ],
)
def test_only_this_machine_is_loopback(host: str, loopback: bool) -> None:
    assert is_loopback(host) is loopback


def test_a_link_beyond_this_machine_is_refused_and_the_way_out_is_said() -> None:
    refuse_insecure(parse_url("udpin:127.0.0.1:14560"))
    with pytest.raises(InsecureLinkError, match=r"udpin:0\.0\.0\.0:14560 .* say --insecure"):
        refuse_insecure(parse_url("udpin:0.0.0.0:14560"))
