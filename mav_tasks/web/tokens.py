"""Tokens of the web page and the API: kept as hashes, in a private file of the user.

A token has a name and a role, as a signing key has. Only its hash is stored: a token that is lost
must be replaced.
"""

import json
import os
import secrets
from collections.abc import Callable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from hashlib import sha256
from hmac import compare_digest
from pathlib import Path

from platformdirs import user_config_path

from mav_tasks.errors import UsageError
from mav_tasks.folders import make_private
from mav_tasks.settings import ROLES
from mav_tasks.web.identity import OPEN_NAME
from mav_tasks.whole_file import replace_whole

FILE_NAME = "web-tokens.json"
RESERVED = (OPEN_NAME, "nobody")  # names of users without a token
BYTES = 32
LONGEST_NAME = 32


class TokenError(UsageError):
    """A file of tokens that cannot be read or written, or a name that is not usable."""


@dataclass(frozen=True, slots=True)
class Token:
    """A stored token: ``digest`` is the SHA-256 of its text, as hexadecimal digits."""

    name: str
    role: str
    digest: str
    added: str


def path_of_tokens(asked: str) -> Path:
    """Return the file of tokens, for "" the user's own."""
    if asked:
        return Path(asked).expanduser()
    return user_config_path("mav-tasks", appauthor=False) / FILE_NAME


def load(path: Path) -> tuple[Token, ...]:
    """Return the stored tokens, none if there is no file. Raise TokenError if it is unusable."""
    try:
        with path.open("rb") as file:
            if os.fstat(file.fileno()).st_mode & 0o077:
                raise TokenError(
                    f"{path}: other users can read or change it; run: chmod 600 {path}"
                )
            tokens = json.load(file)["tokens"]
        found = tuple(Token(**each) for each in tokens)
        for each in found:
            if not all(isinstance(part, str) for part in asdict(each).values()):
                raise ValueError("a part of a token is not a text")
            bytes.fromhex(each.digest)
    except FileNotFoundError:
        return ()
    except OSError as error:
        raise TokenError(f"{path}: {error.strerror}") from error
    except (ValueError, TypeError, KeyError) as error:
        raise TokenError(f"{path}: it is not a file of tokens, or damaged ({error})") from error
    for each in found:
        if each.role not in ROLES:
            raise TokenError(f"{path}: token {each.name}: no role {each.role!r}")
    return found


def add(path: Path, name: str, role: str) -> str:
    """Store a new token. Return its text, which is shown once. Raise TokenError if that fails."""
    if not name or len(name) > LONGEST_NAME or not name.replace("-", "").isalnum():
        raise TokenError(f"token name {name!r}: expected letters, digits and -, at most 32")
    if name in RESERVED:
        raise TokenError(f"token name {name!r}: it is that of a user without a token")
    if role not in ROLES:
        raise TokenError(f"role {role!r}: expected one of {', '.join(ROLES)}")
    text = secrets.token_urlsafe(BYTES)
    added = datetime.now(UTC).isoformat(timespec="seconds")
    token = Token(name, role, _digest(text), added)

    def with_it(tokens: tuple[Token, ...]) -> tuple[Token, ...]:
        if any(each.name == name for each in tokens):
            raise TokenError(f"there is a token {name} already; revoke it first")
        return (*tokens, token)

    _change(path, with_it)
    return text


def revoke(path: Path, name: str) -> None:
    """Remove a token. A running web process refuses it at once. Raise TokenError without it."""

    def without_it(tokens: tuple[Token, ...]) -> tuple[Token, ...]:
        left = tuple(each for each in tokens if each.name != name)
        if len(left) == len(tokens):
            raise TokenError(f"there is no token {name}")
        return left

    _change(path, without_it)


class Tokens:
    """The tokens of a running web process: reads the file again whenever it has changed."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._mark: tuple[int, int] | None = None
        self._tokens: tuple[Token, ...] = ()

    def __repr__(self) -> str:
        return f"Tokens({self._path}, {len(self._tokens)})"

    def of_text(self, text: str) -> Token | None:
        """Return the token of a text; None if the file does not have it, or is unreadable."""
        digest = _digest(text)
        found = [each for each in self._current() if compare_digest(each.digest, digest)]
        return found[0] if found else None

    def is_valid(self, token: Token) -> bool:
        """Return whether a token has not been revoked."""
        return token in self._current()

    def _current(self) -> tuple[Token, ...]:
        try:
            found = self._path.stat()
            mark = (found.st_mtime_ns, found.st_ino)
        except OSError:
            self._mark, self._tokens = None, ()
            return ()
        if mark != self._mark:
            try:
                self._tokens = load(self._path)
            except TokenError:
                self._tokens = ()
            self._mark = mark
        return self._tokens


def _change(path: Path, to: Callable[[tuple[Token, ...]], tuple[Token, ...]]) -> None:
    try:
        make_private(path.parent)
        tokens = to(load(path))
        text = json.dumps({"tokens": [asdict(each) for each in tokens]}, indent=2) + "\n"
        replace_whole(path, text, mode=0o600)
    except OSError as error:
        raise TokenError(f"{path}: {error.strerror}") from error


def _digest(text: str) -> str:
    return sha256(text.encode()).hexdigest()
