"""The URL of a database: ``postgresql://USER@HOST:PORT/DATABASE``, as libpq takes it.

A password in it is used, and never shown. Better places for it are ``~/.pgpass``, ``PGPASSWORD``
and a service file, which libpq reads by itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from psycopg import Error
from psycopg.conninfo import conninfo_to_dict

from mav_tasks.basics.errors import StoreError
from mav_tasks.store.place import without_password

FORM = "expected postgresql://USER@HOST:PORT/DATABASE"
ESCAPES = "within a name or a password write %40 for @, %3A for :, %2F for / and %3F for ?"
_SECRET = frozenset({"password", "sslpassword"})


@dataclass(frozen=True, slots=True)
class Address:
    """Where a database is. ``shown`` is the URL without a password, which finds it again."""

    shown: str
    parameters: Mapping[str, str]

    def __repr__(self) -> str:
        return f"Address({self.shown})"  # the parameters may contain a password


def parse(place: str) -> Address:
    """Return the address in a URL. Raise StoreError, without what may be part of a password."""
    scheme, _, rest = place.partition("://")
    user = ""
    if "@" in rest.partition("/")[0]:  # as libpq does: ? is a character of a name or a password
        user, _, rest = rest.partition("@")
    path, mark, query = rest.partition("?")
    if "@" in path:
        raise _refusal(place, ESCAPES)
    try:
        found = conninfo_to_dict(place)
    except Error as error:
        words = str(error).strip() if without_password(place) == place else ESCAPES
        raise _refusal(place, f"{FORM} ({words})") from None
    parameters = {name: str(value) for name, value in found.items() if value is not None}
    for port in filter(None, parameters.get("port", "").split(",")):
        if not port.isdecimal() or not 0 < int(port) < 1 << 16:
            raise _refusal(place, f"{FORM}; the port is a number, and {ESCAPES}")
    kept = "&".join(p for p in query.split("&") if p.partition("=")[0] not in _SECRET)
    name = user.partition(":")[0]
    shown = f"{scheme}://{name}{'@' if name else ''}{path}{mark if kept else ''}{kept}"
    return Address(shown, parameters)


def _refusal(place: str, words: str) -> StoreError:
    return StoreError(f"store {without_password(place)}: {words}")
