"""Link URLs; every error names what is wrong."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.errors import LinkUrlError
from mav_tasks.links import serial, tcp_in, tcp_out, udp
from mav_tasks.links.endpoint import HostUrl, is_loopback, parse_endpoint
from mav_tasks.links.serial import SerialUrl
from mav_tasks.links.tcp_in import TcpInUrl
from mav_tasks.links.tcp_out import TcpOutUrl
from mav_tasks.links.udp import UdpUrl
from mav_tasks.links.url import KINDS, KindModule, LinkUrl, parse_url
from tests.kit import third_link

#: mypy checks each module against the interface
MODULES: list[KindModule] = [serial, tcp_in, tcp_out, udp, third_link]

RATES = "from 1200 to 12000000"
EXPECTED = (
    "expected udpin:host:port, udpout:host:port, tcpin:host:port, tcp:host:port "
    "or serial:device:baud"
)


@pytest.mark.parametrize(
    ("text", "url"),
    [
        ("udpin:127.0.0.1:14560", UdpUrl("udpin", "127.0.0.1", 14560)),
        ("udpout:localhost:14580", UdpUrl("udpout", "localhost", 14580)),
        ("udpin://0.0.0.0:14550", UdpUrl("udpin", "0.0.0.0", 14550)),
        ("udpout:[::1]:65535", UdpUrl("udpout", "::1", 65535)),
        ("tcpin:0.0.0.0:5760", TcpInUrl("tcpin", "0.0.0.0", 5760)),
        ("tcp:rover.local:5760", TcpOutUrl("tcp", "rover.local", 5760)),
        ("serial:/dev/ttyUSB0:57600", SerialUrl("/dev/ttyUSB0", 57_600)),
        (
            "serial:/dev/serial/by-path/pci-0:1.0:9600",
            SerialUrl("/dev/serial/by-path/pci-0:1.0", 9_600),
        ),
    ],
)
def test_a_url_names_kind_host_and_port(text: str, url: LinkUrl) -> None:
    assert parse_url(text) == url


@pytest.mark.parametrize(
    "text", ["udpin:127.0.0.1:14560", "tcp:localhost:5760", "serial:/dev/ttyACM0:115200"]
)
def test_a_url_reads_as_it_is_written(text: str) -> None:
    assert str(parse_url(text)) == text


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("14560", f"link '14560': {EXPECTED}"),
        (f"udpout:{300 * 'a'}:1", f"link 'udpout:{300 * 'a'}:1': no host has such a name"),
        ("tcp:a..b:1", "link 'tcp:a..b:1': no host has such a name"),
        ("udpin:a\0b:1", "link 'udpin:a\\x00b:1': no host has such a name"),
        ("udp:127.0.0.1:1", f"link 'udp:127.0.0.1:1': {EXPECTED}"),
        ("", f"link '': {EXPECTED}"),
        *[
            (
                text,
                f"link {text!r}: expected serial:device:baud with a baud rate {RATES}",
            )
            for text in (
                "serial:",
                "serial:/dev/ttyUSB0",
                "serial:/dev/ttyUSB0:",
                "serial::57600",
                "serial:/dev/ttyUSB0:0",
                "serial:/dev/ttyUSB0:300",
                "serial:/dev/ttyUSB0:fast",
                "serial:/dev/ttyUSB0:-57600",
                "serial:/dev/ttyUSB0:99999999999999999999",
            )
        ],
        *[
            (text, f"link {text!r}: expected host:port with a port from 1 to 65535")
            for text in (
                "udpin:127.0.0.1",
                "udpin:127.0.0.1:",
                "udpin::14560",
                "udpin:127.0.0.1:0",
                "udpin:127.0.0.1:65536",
                "udpin:127.0.0.1:-1",
                "udpin:127.0.0.1:" + "1" * 5_000,
                "udpin:[]:14560",
                "udpin:127.0.0.1:http",
                "udpout:",
                "tcp:host",
                "tcpin:",
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
        url = parse_url(text)
        assert not isinstance(url, HostUrl) or 0 < url.port < 65536
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


@pytest.mark.parametrize(
    ("options", "unsigned", "key"),
    [
        ("", None, ""),
        ("?unsigned=allow", True, ""),
        ("?unsigned=refuse", False, ""),
        ("?key=rover-1", None, "rover-1"),
        ("?key=rover-1&unsigned=allow", True, "rover-1"),
    ],
)
@pytest.mark.parametrize("link", ["udpin:0.0.0.0:14560", "serial:/dev/ttyUSB0:57600"])
def test_a_url_says_what_is_asked_of_signatures(
    link: str, options: str, unsigned: bool | None, key: str
) -> None:
    url = parse_url(link + options)
    assert (url.options.unsigned, url.options.key) == (unsigned, key)
    assert str(url) == link
    assert url == parse_url(link), "it is the same link, whatever is asked of it"


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            "?keys=a",
            "unknown option 'keys': expected unsigned=allow, unsigned=refuse and key=NAME",
        ),
        ("?unsigned=yes", "unsigned: expected one of "),
        ("?unsigned", "unsigned: expected one of "),
        ("?key=", "key: expected one of "),
        ("?key=a&key=b", "key is given twice"),
        ("?key=a&", "unknown option ''"),
        (
            "?local=14590",
            "unknown option 'local': expected unsigned=allow, unsigned=refuse and key",
        ),
    ],
)
def test_an_unknown_option_is_refused_by_name(options: str, words: str) -> None:
    with pytest.raises(LinkUrlError, match=re.escape(words)):
        parse_url(f"tcp:127.0.0.1:1{options}")


def test_a_url_says_from_which_port_it_dials() -> None:
    url = parse_url("udpout:127.0.0.1:14580?local=14590")
    assert isinstance(url, UdpUrl)
    assert (url.options.others, str(url)) == ({"local": "14590"}, "udpout:127.0.0.1:14580")
    with pytest.raises(LinkUrlError, match="local: expected a port from 1 to 65535"):
        parse_url("udpout:127.0.0.1:14580?local=0")
    with pytest.raises(LinkUrlError, match=r"unknown option 'x': expected .* and local=PORT"):
        parse_url("udpout:127.0.0.1:14580?x=0")


def test_a_third_kind_takes_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(KINDS, "unix", third_link.KIND)
    url = parse_url("unix:/tmp/rover?key=anna")
    assert (str(url), url.options.key, url.is_nearby) == ("unix:/tmp/rover", "anna", True)
    with pytest.raises(LinkUrlError, match=r"serial:device:baud or unix:path$"):
        parse_url("other:/tmp/rover")
