"""A key ring as TOML: one table ``[keys.NAME]`` a key. Faults name key and line, never a value."""

import re
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from typing import Any

from mav_tasks.basics.errors import ConfigError, KeyRingError
from mav_tasks.config.key_ring.derivation import DERIVATIONS, from_hex
from mav_tasks.config.key_ring.limits import LIMITS, limits_of, plain_limits
from mav_tasks.config.key_ring.ring import Entry, KeyRing, key_of
from mav_tasks.config.setting_keys.literals import literal
from mav_tasks.config.toml_file import parsed
from mav_tasks.mavlink.signing import Key

TABLE = "keys"
FIELDS = (
    *("role", "secret", "fingerprint", "derivation", "created", "revoked"),
    *("retired_secret", *LIMITS),
)
HEADER = """\
# The key ring of mav-tasks: secrets. Nobody else may read this file.
# "mav-tasks keys" rewrites this file at each change; comments are lost.
"""
_FINGERPRINT = re.compile(r"[0-9a-f]{16}")
_DIGITS = re.compile(r"[0-9A-Fa-f]{33,}")  # longer than any name: perhaps a misplaced secret
_MOST_FAULTS = 20


def ring_of(text: str, *, name: str) -> KeyRing:
    """Return the ring of a TOML text; raise KeyRingError with all faults. ``name``: the file's."""
    try:
        found = parsed(text, name=name)
    except ConfigError as error:
        raise KeyRingError(*(_DIGITS.sub("…", fault) for fault in error.faults)) from None
    faults: list[str] = []
    ring = KeyRing()
    tables = found.values.get(TABLE, {})
    if set(found.values) - {TABLE} or not isinstance(tables, dict):
        faults.append(f"{name}: expected only tables [{TABLE}.NAME]")
    for key_name, table in tables.items() if isinstance(tables, dict) else ():
        here = found.where(TABLE, key_name)
        try:
            if not isinstance(table, dict):
                raise KeyRingError(f"expected a table [{TABLE}.NAME]")
            ring = ring.with_added(_entry(key_name, table))
        except KeyRingError as error:
            faults += [f"{here}: {_DIGITS.sub('…', fault)}" for fault in error.faults]
    if faults:
        raise KeyRingError(*faults[:_MOST_FAULTS])
    return ring


def text_of(ring: KeyRing) -> str:
    return HEADER + "".join(f"\n{table}" for table in map(_table, ring.entries))


def _entry(name: str, table: Mapping[str, Any]) -> Entry:
    kind, revoked = table.get("role"), _date(name, table, "revoked")
    key = key_of(name, kind if isinstance(kind, str) else "", b"")
    if faults := list(_faults(name, table, is_revoked=revoked is not None)):
        raise KeyRingError(*faults)
    if revoked is None:
        try:
            key = Key(name, from_hex(table["secret"]), role=key.role)
        except KeyRingError as error:
            raise KeyRingError(f"key {name}: secret: {error}") from None
    else:
        key = Key(name, b"", role=key.role, fingerprint=table["fingerprint"])
    retired = _retired(name, table, key.fingerprint) if "retired_secret" in table else b""
    derivation, created = table.get("derivation", ""), _date(name, table, "created")
    limits = limits_of(name, {each: table[each] for each in LIMITS if each in table})
    return Entry(name, str(kind), key, derivation, created, revoked, retired, limits)


def _retired(name: str, table: Mapping[str, Any], fingerprint: str) -> bytes:
    try:
        secret = from_hex(table["retired_secret"])
    except KeyRingError as error:
        raise KeyRingError(f"key {name}: retired_secret: {error}") from None
    if Key(name, secret).fingerprint != fingerprint:
        raise KeyRingError(f"key {name}: retired_secret does not match fingerprint {fingerprint}")
    return secret


def _faults(name: str, table: Mapping[str, Any], *, is_revoked: bool) -> Iterator[str]:
    if "passphrase" in table:
        yield (
            f"key {name}: the key ring has the derived key, not the passphrase: "
            "use mav-tasks keys add --passphrase"
        )
    elif set(table) - set(FIELDS):
        yield f"key {name}: only {', '.join(FIELDS)} are allowed"
    elif is_revoked and "secret" in table:
        yield f"key {name}: it was revoked, but still has a secret: remove that"
    elif not is_revoked and "retired_secret" in table:
        yield f"key {name}: retired_secret: the key is not revoked"
    elif not isinstance(table.get("retired_secret", ""), str):
        yield f"key {name}: retired_secret: expected 64 hexadecimal digits in quotes"
    elif is_revoked and not _is_text(table.get("fingerprint"), _FINGERPRINT):
        yield f"key {name}: fingerprint: expected 16 hexadecimal digits"
    elif not is_revoked and not isinstance(table.get("secret"), str):
        yield f"key {name}: expected a secret, 64 hexadecimal digits in quotes"
    if table.get("derivation", "") not in ("", *DERIVATIONS):
        yield f"key {name}: derivation: expected one of {', '.join(DERIVATIONS)}"


def _is_text(value: object, form: re.Pattern[str]) -> bool:
    return isinstance(value, str) and form.fullmatch(value) is not None


def _date(name: str, table: Mapping[str, Any], field: str) -> datetime | None:
    value = table.get(field)
    if value is None:
        return None
    if not isinstance(value, datetime):
        raise KeyRingError(f"key {name}: {field}: expected a time such as 2026-11-21T14:30:00Z")
    return value if value.tzinfo else value.astimezone()


def _table(entry: Entry) -> str:
    lines = [f"[{TABLE}.{entry.name}]", f'role = "{entry.kind}"']
    if entry.is_usable:
        lines.append(f'secret = "{entry.key.secret.hex()}"')
    else:
        lines.append(f'fingerprint = "{entry.key.fingerprint}"')
    if entry.retired:
        lines.append(f'retired_secret = "{entry.retired.hex()}"  # for replays of old records only')
    if entry.derivation:
        lines.append(f'derivation = "{entry.derivation}"')
    lines += [f"{name} = {literal(value)}" for name, value in plain_limits(entry.limits).items()]
    for field, date in (("created", entry.created), ("revoked", entry.revoked)):
        if date is not None:
            lines.append(f"{field} = {date.astimezone(UTC):%Y-%m-%dT%H:%M:%SZ}")
    return "\n".join(lines) + "\n"
