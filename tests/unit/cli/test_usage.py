"""The command line without a server: what is understood, and how it says what is not."""

import os
import re
import sqlite3
import sys
from datetime import UTC, datetime
from io import StringIO
from math import inf
from pathlib import Path

import pytest

from mav_tasks.cli.output import wrapped
from mav_tasks.cli.times import moment_ago
from mav_tasks.cli.words import silence_of
from tests.kit.commands import called

NOBODY = "udpout:127.0.0.1:9"
DURATION, MOMENT = "30s, 5m or 1h30m", "14:30"

#: options of a submission -> what is said of them; "": they are understood
DURATIONS = {
    **dict.fromkeys(("30s", "30", "0", "0.5s", "1.5h", "1h5", "2d1h1m1s", " 5M ", "365d"), ""),
    **dict.fromkeys(("s", "+5", "5 m", "30m1h", "1h1h", "1e3", "inf", ".5"), DURATION),
    **dict.fromkeys(("5.", "5w", "٥s", "14:30"), DURATION),
    **dict.fromkeys(("367d", "9" * 400 + "d", "99999999999h"), "more than a year"),
}
MOMENTS = {
    **dict.fromkeys(("23:59", "14:30Z", "00:00+01:00"), ""),
    **dict.fromkeys(("noon", "14", "1430", "2026-11-20", "25:00", "2026-02-30T10:00"), MOMENT),
    "2020-01-01T10:00": "in the past",
    "2020-01-01T10:00Z": "in the past",
    "2099-01-01T10:00": "more than a year",
}
ASKED_BACK = "latitude and longitude? Add --global; if"
PLACES = {
    **dict.fromkeys(("5 3", "-1 2", "0.5 0.25", "100 5", "47.3 8.5 --local"), ""),
    **dict.fromkeys(("47.3977 8.5456 --global", "-35.36326 149.16524 --global"), ""),
    **dict.fromkeys(("47.3977 8.5456", "47.3 8.5", "-1.29 36.82", "5.6037 -0.187"), ASKED_BACK),
    **dict.fromkeys(("0.001 0.001", "60 10", "-35.36 149.16"), ASKED_BACK),
    "north 1": "NORTH|LAT 'north'",
    "91 0 --global": "latitude 91",
    "0 181 --global": "181",
    "47.3977 8.5456 --global --local": "choose one",
}
EMPTY = "create table metadata (name, value); create table tiles (zoom_level);"
VECTOR = "insert into metadata values ('format', 'pbf'); insert into tiles values (1);"
TILES = {"empty": EMPTY, "vector": EMPTY + VECTOR}
#: in FOLDER there is a FILE
OTHERS = """queue -s pigeon:1: udpout:host:port
submit move 1 --in 5s --at 14:30: --in and --at
submit wait -5: DURATION -5
submit act relay-onn: command 'relay-onn': expected photo, camera-trigger
submit act 65536: command 65536: expected
submit act servo --param1 two: param1 'two': not a number
submit act servo --param5 1.5: param5 1.5: not a whole number
submit act servo --time-limit 11m: time_limit 660.0: not in 0.1..600 s
submit move 1 --every 5w: 30s, 5m or 1h30m
submit wait 9 --deadline 5w: --deadline 5w
submit wait 9 --in 400d: --in 400d
submit move 1 --priority 11: --priority 11
modify 3: --priority
release perhaps: again, remainder or skip
release x again: id of a task
clear --all: --yes
cancel --series --kill: leave out --series
resume --all --epoch 1: --epoch needs one rover
stop --all --vehicle 1: choose one of them
queue --keys FILE: --keys needs --sign
queue --sign anna --keys FILE: --sign: no key
mission upload no/such/file: No such file
mission upload FILE --stage --label x: only --wait goes with it
mission upload FILE --stage --vehicle any: name it with --vehicle N
export x --mcap FOLDER: not a file
export FILE --mcap FILE: is also read
export x --mcap FILE: use --force to overwrite
export x --mcap FOLDER/no/out: No such file
probe: the URL of the rover is missing
probe tcp:127.0.0.1:9 --drive --set-failsafe: use one, then the other
probe tcp:127.0.0.1:9 --drive: without a terminal, add --yes
log --json --csv: choose one of them
log --task -1: not a valid id
log --until 2h --follow: choose one of them
log --store=: path or the URL of a store
log --store FOLDER/no: does not exist; choose another with --store
log --store FILE: it is empty
log --store ~nobody.there/x: store ~nobody.there/x
log --store postgresql://host:no/x: the port is a number
log --store postgresql://host/x?colour=red: invalid URI query parameter
log --store postgresql://a:b/c@host/x: write %40 for @
log --store postgres://aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa/x: not valid
log --store postgresql://a:secret@nowhere.invalid/x: store postgresql://a@nowhere.invalid/x: failed
log --store postgresql://nowhere.invalid/x: check the host's name in the URL
log --store postgresql://127.0.0.1:9/x: is the server running there?
log --store postgresql:///x?host=/nowhere: is the server running there?
log --store mysql://a:sec@ret@x/x?sslpassword=y: store mysql://a@x/x: unknown kind; expected a path
qgc-actions --install --documents FILE: Not a directory
export FOLDER --mcap FOLDER/out: not a file
export FOLDER/no --mcap FOLDER/out: FOLDER/no
qgc-actions --only: give at least one --action
mcp --max-queued 3: keys add agent --role submitter --quota 3
mcp --http 127.0.0.1: expected HOST:PORT
mcp --http 10.0.0.1:80: can be reached from other machines
mcp --http localhost:80 --sign anna --keys FILE: --sign: no key
mcp --http here:80: can be reached from other machines
web --listen 8560: expected HOST:PORT
web --role observer: roles.unsigned=observer
web --tokens FILE: keys of the key ring now
web tokens list: keys of the key ring now
web --name rover.example: who sits elsewhere needs a token
web --tiles http://x/1: expected a URL with
web --tiles FOLDER/no --listen localhost:80: no such file
web --tiles FOLDER/empty: it has no tiles
web --tiles FOLDER/vector: it has vector tiles
web --tiles FILE: not an MBTiles file
web --records FOLDER/no: no such folder
web --listen 127.0.0.1:99999: expected HOST:PORT"""


def test_each_option_is_understood_or_named_in_one_line(tmp_path: Path) -> None:
    file = tmp_path / "keys.toml"
    file.touch(0o600)
    for name, script in TILES.items():
        sqlite3.connect(tmp_path / name).executescript(script).connection.close()
    others = OTHERS.replace("FILE", str(file)).replace("FOLDER", str(tmp_path))
    cases: dict[tuple[str, ...], str] = {
        **{("submit", "move", "1", "--in", text): words for text, words in DURATIONS.items()},
        **{("submit", "move", "1", "--at", text): words for text, words in MOMENTS.items()},
        **{("submit", "goto", *text.split()): words for text, words in PLACES.items()},
        **{tuple(said.split()): words for said, words in re.findall("(.*?): (.*)", others)},
    }
    wrong = []
    for arguments, words in cases.items():
        more = () if "-s" in arguments else ("--timeout", "0.1", "--server", NOBODY)
        done = called(*arguments, *(more if arguments[0] == "submit" else ()))
        is_one_line = done.error.count("\n") == 1 and done.error.startswith("mav-tasks: ")
        if not is_one_line or done.status != (2 if words else 3) or words not in done.error:
            wrong.append((arguments, done.status, done.error))
    assert wrong == []


NOON = datetime(2026, 11, 22, 12, tzinfo=UTC)


def test_times_are_told_in_words_and_lines_are_wrapped_at_words() -> None:
    assert moment_ago(86_400.0, now=NOON) == "2026-11-21 12:00"
    assert silence_of(inf) == "not heard since the server started"
    assert wrapped("one two\n", 7) == "one two\n"
    assert wrapped("a line of several words\n", 20) == "a line of several\n    words\n"


class Typed(StringIO):
    """What somebody types at a terminal."""

    def isatty(self) -> bool:
        return True


def test_a_rover_is_driven_only_after_a_yes(monkeypatch: pytest.MonkeyPatch) -> None:
    for answer, words in {"no": "the answer was not yes", "yes": "Connection refused"}.items():
        monkeypatch.setattr(sys, "stdin", Typed(answer))
        done = called("probe", "tcp:127.0.0.1:9", "--drive", "--timeout", "1")
        assert "yes" in done.error.partition("?")[2]
        assert words in done.error


#: a configuration -> what the doctor says
ILL = """x = 1: serve would not start
store.path = "x://y": choose another with --store
store.path = "postgresql:///x": the server looks at it when it starts
store.path = "FILE": chmod 600
store.path = "/dev/null/x": this user may not write it
store.path = "/proc/none/x": less than 100 MB free
signing.keys = "/dev/null/x": mav-tasks keys list
signing.keys = "RING": no usable key
links.clients = ["udpin:0.0.0.0:14560"]: no client has a signing key
links.clients = ["udpin:127.0.0.1:9", "udpin:127.0.0.1:9"]: is given twice
links.vehicles = ["serial:/dev/null:57600"]: end the other program
links.vehicles = ["udpin:127.0.0.1:14999"]: can be opened"""


def test_the_doctor_names_what_is_wrong(tmp_path: Path) -> None:
    file, ring = tmp_path / "config.toml", tmp_path / "ring"
    ring.touch(0o600)
    for text, words in re.findall("(.*): (.*)", ILL):
        file.write_text(text.replace("FILE", str(file)).replace("RING", str(ring)))
        done = called("doctor", "--json", "--config", str(file), "--timeout", "0.1", server=NOBODY)
        assert (done.status, words in done.output) == (1, True), (text, done)


#: a ring, ¶ for the end of a line => what is wrong with it
RINGS = """x = 1 => expected only tables [keys.NAME]
keys.anna = 1 => :1: expected a table [keys.NAME]
[keys.anna]¶role = "boss" => :1: key anna: expected a role, one of observer, submitter,
[keys.anna]¶role = "operator" => :1: key anna: expected a secret, 64 hexadecimal digits
ANNA"12" => :1: key anna: secret: expected 64 hexadecimal digits
ANNA"ZEROS" => :1: key anna: secret: all digits are zero
ANNA"DIGITS"¶colour = 1 => :1: key anna: only role, secret, fingerprint,
ANNA"DIGITS"¶revoked = 2026-11-21T14:30:00Z => :1: key anna: it was revoked, but still
ANNA"DIGITS"¶derivation = "magic" => :1: key anna: derivation: expected one of sha256,
REVOKED¶retired_secret = "ONES" => retired_secret does not match fingerprint
ANNA"DIGITS"¶[keys.ben]¶role = "safety"¶secret = "DIGITS" => :4: key ben: this secret exists
ANNA"DIGITS"¶ANNA"DIGITS" => :4: Cannot declare ('keys', 'anna') twice
[keys.DIGITS] => :1: '…' is not a key name:
[DIGITS]¶[DIGITS]¶ => :2: Cannot declare ('…',) twice
LONG => larger than 256 kB"""
DIGITS = "0123456789abcdef" * 4
SHORT = {
    "REVOKED": '[keys.anna]¶role = "operator"¶fingerprint = "0123456789abcdef"¶'
    "revoked = 2026-11-21T14:30:00Z",
    "ANNA": '[keys.anna]¶role = "operator"¶secret = ',
    "DIGITS": DIGITS,
    "ZEROS": "0" * 64,
    "ONES": "1" * 64,
    "LONG": "#" * 300_000,
    "¶": "\n",
}


def test_a_fault_of_a_key_ring_is_named_with_its_line_and_no_secret(tmp_path: Path) -> None:
    ring = tmp_path / "keys.toml"
    ring.touch(0o600)
    wrong = []
    for row in RINGS.splitlines():
        text, words = row.split(" => ")
        for short, long in SHORT.items():
            text = text.replace(short, long)
        ring.write_text(text, encoding="utf-8")
        done = called("keys", "list", "--keys", str(ring))
        told = done.output + done.error
        if done.status != 2 or words not in told or DIGITS in told or str(ring) not in told:
            wrong.append((text[:200], done))
    assert wrong == []


def test_a_ring_is_its_users_alone_and_one_that_others_can_get_at_is_refused(
    tmp_path: Path,
) -> None:
    ring = tmp_path / "folder" / "keys.toml"
    add = ("keys", "add", "--role", "operator", "--keys", str(ring))
    before = os.umask(0)
    try:
        assert called(*add, "anna").status == 0
    finally:
        os.umask(before)
    assert (ring.stat().st_mode & 0o777, ring.parent.stat().st_mode & 0o777) == (0o600, 0o700)
    content = ring.read_bytes()
    assert "exists already" in called(*add, "anna").error
    assert (ring.read_bytes(), list(ring.parent.iterdir())) == (content, [ring])
    link = tmp_path / "link.toml"
    link.symlink_to(ring)
    assert called("keys", "add", "ben", "--role", "safety", "--keys", str(link)).status == 0
    listed = called("keys", "list", "--json", "--keys", str(ring)).objects
    assert (link.is_symlink(), [each["name"] for each in listed]) == (True, ["anna", "ben"])
    for mode in (0o640, 0o604, 0o620, 0o602):
        ring.chmod(mode)
        for command in (("keys", "list", "--keys", str(ring)), (*add, "carl")):
            done = called(*command)
            assert (done.status, f"(mode {mode:04o}): chmod 600 {ring}" in done.error) == (2, True)
