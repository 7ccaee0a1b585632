"""The command line without a server: what is understood, and how it says what is not."""

import os
from pathlib import Path

from tests.kit.commands import called

NOBODY = "udpout:127.0.0.1:9"
DURATION, MOMENT = "30s, 5m or 1h30m", "14:30"

#: options of a submission -> what is said of them; "": they are understood
DURATIONS = {
    **dict.fromkeys(("30s", "30", "0", "0.5s", "1.5h", "1h5", "2d1h1m1s", " 5M ", "366d"), ""),
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
OTHERS = {
    ("queue", "-s", "pigeon:1"): "udpout:host:port",
    ("submit", "move", "1", "--in", "5s", "--at", "14:30"): "--in and --at",
    ("submit", "wait", "-5"): "DURATION -5",
    ("modify", "3"): "--priority",
    ("release", "perhaps"): "again, remainder or skip",
    ("release", "x", "again"): "id of a task",
    ("clear", "--all"): "--yes",
    ("mission", "upload", "no/such/file"): "No such file",
    ("submit", "move", "1", "--every", "5w"): DURATION,
}


def test_each_option_is_understood_or_named_in_one_line() -> None:
    cases: dict[tuple[str, ...], str] = {
        **{("submit", "move", "1", "--in", text): words for text, words in DURATIONS.items()},
        **{("submit", "move", "1", "--at", text): words for text, words in MOMENTS.items()},
        **{("submit", "goto", *text.split()): words for text, words in PLACES.items()},
        **OTHERS,
    }
    wrong = []
    for arguments, words in cases.items():
        more = () if "-s" in arguments else ("--timeout", "0.1", "--server", NOBODY)
        done = called(*arguments, *(more if arguments[0] == "submit" else ()))
        is_one_line = done.error.count("\n") == 1 and done.error.startswith("mav-tasks: ")
        if not is_one_line or done.status != (2 if words else 3) or words not in done.error:
            wrong.append((arguments, done.status, done.error))
    assert wrong == []


DIGITS = "0123456789abcdef" * 4
ENTRY = f'[keys.anna]\nrole = "operator"\nsecret = "{DIGITS}"\n'
REVOKED = """[keys.anna]
role = "operator"
fingerprint = "0123456789abcdef"
revoked = 2026-11-21T14:30:00Z
"""
#: a ring -> what is wrong with it
RINGS = {
    "x = 1": "expected only tables [keys.NAME]",
    "keys.anna = 1": ":1: expected a table [keys.NAME]",
    '[keys.anna]\nrole = "boss"': ":1: key anna: expected a role, one of observer, submitter,",
    '[keys.anna]\nrole = "operator"': ":1: key anna: expected a secret, 64 hexadecimal digits",
    ENTRY.replace(DIGITS, "12"): ":1: key anna: secret: expected 64 hexadecimal digits",
    ENTRY.replace(DIGITS, "0" * 64): ":1: key anna: secret: all digits are zero",
    f"{ENTRY}colour = 1": ":1: key anna: only role, secret, fingerprint,",
    f"{ENTRY}revoked = 2026-11-21T14:30:00Z": ":1: key anna: it was revoked, but still",
    f'{ENTRY}derivation = "magic"': ":1: key anna: derivation: expected one of sha256,",
    f'{REVOKED}retired_secret = "{"1" * 64}"': "retired_secret does not match fingerprint",
    f'{ENTRY}[keys.ben]\nrole = "safety"\nsecret = "{DIGITS}"': ":4: key ben: this secret exists",
    f"{ENTRY}{ENTRY}": ":4: Cannot declare ('keys', 'anna') twice",
    f"[keys.{DIGITS}]": ":1: '…' is not a key name: ",
    f"[{DIGITS}]\n[{DIGITS}]\n": ":2: Cannot declare ('…',) twice",
    "#" * 300_000: "larger than 256 kB",
}


def test_a_fault_of_a_key_ring_is_named_with_its_line_and_no_secret(tmp_path: Path) -> None:
    ring = tmp_path / "keys.toml"
    ring.touch(0o600)
    wrong = []
    for text, words in RINGS.items():
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
