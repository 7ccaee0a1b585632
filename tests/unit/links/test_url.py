"""Link URLs; every error names what is wrong."""

import re
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from mav_tasks.basics.errors import LinkUrlError
from mav_tasks.links import parse_url
from tests.kit.commands import called

#: text -> as it is shown, whether no other machine can dial it, what is asked of signatures
GOOD = """\
udpin:127.0.0.1:14560                           udpin:127.0.0.1:14560       True  None
udpout:localhost:14580                          udpout:localhost:14580      True  None
udpin://0.0.0.0:14550                           udpin:0.0.0.0:14550         False None
udpout:[::1]:65535                              udpout:::1:65535            True  None
udpout:127.9.9.9:1?unsigned=refuse              udpout:127.9.9.9:1          True  False
tcpin:192.168.1.2:5760?unsigned=allow           tcpin:192.168.1.2:5760      False True
tcp:rover.local:5760?key=rover-1                tcp:rover.local:5760        False None
serial:/dev/ttyUSB0:57600?key=a&unsigned=allow  serial:/dev/ttyUSB0:57600   True  True
serial:/dev/by-path/pci-0:1.0:9600              serial:/dev/by-path/pci-0:1.0:9600  True  None
udpout:127.0.0.1:14580?local=14590              udpout:127.0.0.1:14580      True  None
"""
#: what is said => of which texts
BAD = """expected udpin:host:port, udpout:host:port, tcpin:host:port, tcp: => 14560
expected udpin:host:port, udpout:host:port, tcpin:host:port, tcp:host:port or serial: => EMPTY
expected udpin:host:port, udpout:host:port, tcpin:host:port, tcp: => udp:127.0.0.1:1
no host has such a name => udpout:LONG:1 tcp:a..b:1 udpin:aNULb:1
expected serial:device:baud with a baud rate from 1200 to 12000000 => serial: serial:/dev/x
expected serial:device:baud with a baud rate from 1200 to 12000000 => serial:/dev/x: serial::57600
expected serial:device:baud with a baud rate from 1200 to 12000000 => serial:/dev/x:0
expected serial:device:baud with a baud rate from 1200 => serial:/dev/x:300 serial:/dev/x:fast
expected host:port with a port from 1 to 65535 => udpin:127.0.0.1 udpin:127.0.0.1: udpin:127.0.0.1:0
expected host:port with a port from 1 to 65535 => udpin:127.0.0.1:65536 udpin:127.0.0.1:-1
expected host:port with a port from 1 to 65535 => udpin:127.0.0.1:ONES udpin::14560 udpin:[]:14560
expected host:port with a port from 1 to 65535 => udpin:127.0.0.1:http tcp:host tcpin:
unknown option 'keys': expected unsigned=allow, unsigned=refuse and key=NAME => tcp:a:1?keys=a
unknown option 'local': expected unsigned=allow, unsigned=refuse and key=NAME => tcp:a:1?local=14590
unsigned: expected one of => tcp:127.0.0.1:1?unsigned=yes tcp:127.0.0.1:1?unsigned
key: expected one of => tcp:127.0.0.1:1?key=
key is given twice => tcp:127.0.0.1:1?key=a&key=b
local: expected a port from 1 to 65535 => udpout:127.0.0.1:1?local=0"""
ODD = {"EMPTY": "", "LONG": 300 * "a", "NUL": "\0", "ONES": 5_000 * "1"}


def test_a_url_is_shown_without_its_options_and_knows_who_can_dial_it() -> None:
    found = [
        (text, url := parse_url(text), url.is_nearby, url.options.unsigned)
        for text in (line.split()[0] for line in GOOD.splitlines())
    ]
    assert [list(map(str, each)) for each in found] == [line.split() for line in GOOD.splitlines()]
    assert parse_url("tcp:a:1?key=b") == parse_url("tcp:a:1"), "it is the same link"


def test_an_error_names_what_is_wrong() -> None:
    wrong: list[tuple[str, object]] = []
    for row in BAD.splitlines():
        words, _, texts = row.partition(" => ")
        for text in texts.split():
            text = re.sub("|".join(ODD), lambda word: ODD[word[0]], text)
            try:
                wrong.append((text, parse_url(text)))
            except LinkUrlError as error:
                if not str(error).startswith(f"link {text!r}: {words}"):
                    wrong.append((text, str(error)))
    assert wrong == []


@given(st.text(max_size=40))
def test_any_text_is_a_url_or_a_clear_error(text: str) -> None:
    words = repr(text)
    try:
        parse_url(text)
    except LinkUrlError as error:
        words = str(error)
    assert repr(text) in words


#: lines of a configuration => what is wrong with it, nothing: it is right
CONFIGURATIONS = """clients = ["FAR?unsigned=allow"] => needs no signing key
vehicles = ["FAR"] => has no signing key
vehicles = ["tcp:192.0.2.1:5760"] => has no signing key
vehicles = ["FAR?unsigned=refuse"] => has no signing key
vehicles = ["FAR?key=r1&unsigned=allow"] => needs no signing key
push = ["192.0.2.1:14550"]; clients = ["udpin:127.0.0.1:1?unsigned=allow"] => push 192.0.2.1
vehicles = ["NEAR"]; [signing]; unsigned = "nowhere" => but has no key: add ?key=NAME
clients = ["NEAR"]; vehicles = ["NEAR?key=a"] => link NEAR is given twice
clients = ["FAR"] =>
clients = ["serial:/dev/ttyUSB0:57600"]; vehicles = ["serial:/dev/ttyUSB1:57600"] =>
vehicles = ["FAR?key=r1"] =>
vehicles = ["FAR?key=r1&unsigned=allow"]; insecure = true =>
clients = ["FAR?unsigned=allow"]; insecure = true =>
vehicles = ["udpout:192.0.2.1:1"]; insecure = true =>
vehicles = ["NEAR?key=r1"]; [signing]; unsigned = "nowhere" =>"""


def test_links_that_others_reach_unsigned_need_a_word(tmp_path: Path) -> None:
    wrong = []
    rows = CONFIGURATIONS.replace("NEAR", "udpin:127.0.0.1:1").replace("FAR", "udpin:0.0.0.0:1")
    for row in rows.splitlines():
        lines, _, words = row.replace("; ", "\n").partition(" =>")
        path = tmp_path / "mav-tasks.toml"
        path.write_text(f"[links]\n{lines}\n", encoding="utf-8")
        done = called("config", "check", str(path))
        if (done.status == 0) is bool(words) or words.strip() not in done.output + done.error:
            wrong.append((lines, done))
    assert wrong == []
