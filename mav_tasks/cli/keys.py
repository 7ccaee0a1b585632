"""``mav-tasks keys``: add, list and revoke the keys of the key ring.

A secret is read without echo or from a pipe. It is never an option: all users of a machine can read
a command line.
"""

import sys
from datetime import UTC, datetime
from getpass import getpass
from typing import Annotated, Any

import typer

from mav_tasks.basics.errors import KeyRingError, UsageError
from mav_tasks.cli import output
from mav_tasks.cli.lazy import completing, group
from mav_tasks.cli.options import Json, RingFile
from mav_tasks.cli.ring import ring_path
from mav_tasks.config.key_ring import derivation as how
from mav_tasks.config.key_ring.limits import LIMITS, limits_in_words, limits_of, plain_limits
from mav_tasks.config.key_ring.ring import Entry, KeyRing, key_of
from mav_tasks.config.key_ring.ring_file import change, load

app = group("Add, list and revoke signing keys.")
LONGEST = 4096  # characters of a passphrase that are read


def _limit(name: str, metavar: str) -> Any:
    """Return the option for a limit of the key, by its declaration."""
    meaning = LIMITS[name].meaning.replace("this role", "this key")
    return typer.Option(metavar=metavar, help=f"{meaning[0].upper()}{meaning[1:]}.")


Name = Annotated[str, typer.Argument(metavar="NAME", help="Name of the key.")]


@app.command()
def add(
    name: Name,
    role: Annotated[
        str,
        typer.Option(
            metavar="ROLE",
            autocompletion=completing("mav_tasks.config.key_ring.ring:KINDS"),
            help="Role of the client: observer, submitter, operator or safety; "
            "or vehicle, for the link to a rover.",
        ),
    ],
    passphrase: Annotated[bool, typer.Option("--passphrase", help="Ask for a passphrase.")] = False,
    hex_: Annotated[bool, typer.Option("--hex", help="Ask for 64 hexadecimal digits.")] = False,
    generate: Annotated[
        bool, typer.Option("--generate", help="Generate a random key and print it once (default).")
    ] = False,
    derivation: Annotated[
        str | None,
        typer.Option(
            metavar="HOW",
            autocompletion=completing("mav_tasks.config.key_ring.derivation:PASSPHRASES"),
            help="How the key is derived from the passphrase: sha256 (default; QGroundControl 5.0, "
            "MAVProxy) or pbkdf2 (later QGroundControl).",
        ),
    ] = None,
    max_speed: Annotated[float | None, _limit("max_speed", "M/S")] = None,
    max_distance: Annotated[float | None, _limit("max_distance", "METRES")] = None,
    max_priority: Annotated[int | None, _limit("max_priority", "0..10")] = None,
    quota: Annotated[int | None, _limit("quota", "N")] = None,
    rate: Annotated[float | None, _limit("rate", "N")] = None,
    tasks: Annotated[str | None, _limit("tasks", "KIND,...")] = None,
    keys: RingFile = "",
) -> None:
    """Add a key; a running server accepts it at once.

    Limits of the key hold beside those of its role: the tighter one counts.
    If standard input is not a terminal, its first line must be the passphrase or the digits.
    """
    if passphrase + hex_ + generate > 1:
        raise UsageError("--passphrase, --hex and --generate: choose one of them")
    if derivation is not None and (not passphrase or derivation not in how.PASSPHRASES):
        words = " or ".join(how.PASSPHRASES)
        raise UsageError(f"--derivation: expected {words}, and --passphrase")
    key_of(name, role, b"")  # check before the user types a passphrase
    given = {
        "max_speed": max_speed,
        "max_distance": max_distance,
        "max_priority": max_priority,
        "quota": quota,
        "rate": rate,
        "tasks": None if tasks is None else LIMITS["tasks"].shape.read(tasks),
    }
    limits = limits_of(name, {limit: each for limit, each in given.items() if each is not None})
    if passphrase:
        derivation = derivation or how.SHA256
        secret = how.from_passphrase(_asked("Passphrase", is_new=True), derivation)
    elif hex_:
        derivation, secret = how.HEX, how.from_hex(_asked("64 hexadecimal digits"))
    else:
        derivation, secret = how.GENERATED, how.generated()
    key = key_of(name, role, secret)
    path = ring_path(keys)

    def with_it(ring: KeyRing) -> KeyRing:
        entry = Entry(name, role, key, derivation, datetime.now(UTC), limits=limits)
        return ring.with_added(entry)

    change(path, with_it)
    if derivation == how.GENERATED:
        output.say(secret.hex())
        sys.stderr.write(
            "mav-tasks: this is the secret; enter it at the other end, or as the token of the web "
            "page. It is not shown again\n"
        )
    sys.stderr.write(f"mav-tasks: added key {name} ({key.fingerprint}), role {role}, to {path}\n")


@app.command("list")
def list_(
    as_json: Json = False,
    keys: RingFile = "",
) -> None:
    """List the keys with their fingerprints, without the secrets."""
    path = ring_path(keys)
    entries = load(path).ring.entries
    if as_json:
        for entry in entries:
            output.say_json({"file": str(path), **_as_json(entry)})
        return
    usable = sum(entry.is_usable for entry in entries)
    output.say(f"key ring {path}, {usable} key{'' if usable == 1 else 's'}")
    if entries:
        _show(entries)


@app.command()
def revoke(
    name: Name,
    forget: Annotated[
        bool,
        typer.Option(
            "--forget",
            help="Also delete the secret; records that need the key can no longer be replayed.",
        ),
    ] = False,
    keys: RingFile = "",
) -> None:
    """Revoke a key; a running server rejects it at once.

    The key ring keeps the secret only to replay old records.
    """
    path = ring_path(keys)
    load(path)  # raises if there is none: do not create one

    def without_it(ring: KeyRing) -> KeyRing:
        is_revoked = any(each.name == name and not each.is_usable for each in ring.entries)
        revoked = ring if forget and is_revoked else ring.with_revoked(name, at=datetime.now(UTC))
        return revoked.with_forgotten(name) if forget else revoked

    change(path, without_it)
    output.say(f"revoked key {name} in {path}{', and deleted its secret' if forget else ''}")


def _asked(what: str, *, is_new: bool = False) -> str:
    """Return a secret, prompted for without echo, or the first line of standard input."""
    if sys.stdin is None:
        raise UsageError(f"{what.lower()}: standard input is closed")
    if not sys.stdin.isatty():
        return sys.stdin.readline(LONGEST).removesuffix("\n").removesuffix("\r")
    try:
        text = getpass(f"{what}: ")
        if is_new and getpass("Repeat it: ") != text:
            raise KeyRingError("the entries differ")
    except EOFError:
        raise UsageError(f"{what.lower()}: nothing was entered") from None
    return text


def _as_json(entry: Entry) -> dict[str, Any]:
    dates = {"created": entry.created, "revoked": entry.revoked}
    return {
        "name": entry.name,
        "role": entry.kind,
        "fingerprint": entry.key.fingerprint,
        "derivation": entry.derivation,
        "usable": entry.is_usable,
        "limits": plain_limits(entry.limits),
        **{name: None if at is None else at.isoformat() for name, at in dates.items()},
    }


def _show(entries: tuple[Entry, ...]) -> None:
    from rich import table, text  # noqa: PLC0415

    shown = table.Table(box=None, padding=(0, 2, 0, 0), pad_edge=False, header_style="bold")
    for name in ("key", "role", "fingerprint", "derivation", "created", "revoked", "limits"):
        shown.add_column(name)
    for entry in entries:
        made, revoked = (
            "" if at is None else f"{at:%Y-%m-%d}" for at in (entry.created, entry.revoked)
        )
        shown.add_row(
            *(entry.name, entry.kind, entry.key.fingerprint, entry.derivation, made),
            text.Text(revoked, style="red"),
            limits_in_words(entry.limits),
        )
    output.show(shown)
