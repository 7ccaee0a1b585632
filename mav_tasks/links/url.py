"""Link URLs: ``udpin`` and ``tcpin`` listen, ``udpout`` and ``tcp`` dial, ``serial`` is a line.

The form is ``kind:host:port``, or ``serial:/dev/ttyUSB0:57600`` with the baud rate. Options follow
a question mark: ``unsigned=allow`` or ``refuse`` and ``key=NAME`` for signing, and those of a kind.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import NamedTuple, Protocol, cast

from mav_tasks.basics.errors import LinkUrlError
from mav_tasks.links.base import Link
from mav_tasks.links.link_limits import LinkLimits


class Kind(NamedTuple):
    form: str  # of what follows the kind and a colon
    module: str  # has the function of ``KindModule``; it is imported when it is used
    options: tuple[str, ...] = ()  # of this kind only


KINDS = {
    "udpin": Kind("host:port", "mav_tasks.links.udp"),
    "udpout": Kind("host:port", "mav_tasks.links.udp", ("local=PORT",)),
    "tcpin": Kind("host:port", "mav_tasks.links.tcp_in"),
    "tcp": Kind("host:port", "mav_tasks.links.tcp_out"),
    "serial": Kind("device:baud", "mav_tasks.links.serial"),
}
SIGNING = ("unsigned=allow", "unsigned=refuse", "key=NAME")
UNSIGNED = {"allow": True, "refuse": False}


@dataclass(frozen=True, slots=True)
class UrlOptions:
    """The options of a URL; they do not affect its equality."""

    unsigned: bool | None = None  # whether unsigned packets are accepted; None: not given
    key: str = ""
    others: Mapping[str, str] = field(default_factory=dict)  # of the kind


NO_OPTIONS = UrlOptions()


class LinkUrl(Protocol):
    """A parsed link URL; ``str`` returns it without its options. Equal ones are the same link."""

    @property
    def options(self) -> UrlOptions:
        """The options."""

    @property
    def is_nearby(self) -> bool:
        """Whether no other machine can dial the link."""

    @property
    def can_push(self) -> bool:
        """Whether the link can send to clients that it has not heard."""

    def __hash__(self) -> int: ...

    def open(self, *, limits: LinkLimits, push: tuple[tuple[str, int], ...] = ()) -> Link:
        """Open the link; raise LinkOpenError if that fails. ``push``: only if ``can_push``.

        A link that dials is open before its peer exists, and tries until it connects.
        """


class KindModule(Protocol):
    """The interface of a module in KINDS."""

    def parse(self, kind: str, rest: str, options: UrlOptions, /, *, what: str) -> LinkUrl:
        """Return the URL; raise LinkUrlError, which names ``what``."""


def parse_url(text: str) -> LinkUrl:
    """Return the parts of a link URL; raise LinkUrlError if it is malformed."""
    where, _, options = text.partition("?")
    name, _, rest = where.partition(":")
    what = f"link {text!r}"
    kind = KINDS.get(name)
    if kind is None:
        forms = [f"{name}:{kind.form}" for name, kind in KINDS.items()]
        raise LinkUrlError(f"{what}: expected {_listed(forms, 'or')}")
    parsed = _parse_options(options, kind, what=what)
    module = cast(KindModule, import_module(kind.module))
    return module.parse(name, rest, parsed, what=what)


def _parse_options(text: str, kind: Kind, *, what: str) -> UrlOptions:
    known = (*SIGNING, *kind.options)
    options: dict[str, str] = {}
    for each in text.split("&") if text else ():
        name, _, value = each.partition("=")
        if name in options:
            raise LinkUrlError(f"{what}: {name} is given twice")
        if name not in {form.partition("=")[0] for form in known}:
            raise LinkUrlError(f"{what}: unknown option {name!r}: expected {_listed(known, 'and')}")
        if not value or (name == "unsigned" and value not in UNSIGNED):
            raise LinkUrlError(f"{what}: {name}: expected one of {_listed(known, 'and')}")
        options[name] = value
    unsigned, key = options.pop("unsigned", ""), options.pop("key", "")
    return UrlOptions(UNSIGNED.get(unsigned), key, options)


def _listed(words: "list[str] | tuple[str, ...]", last: str) -> str:
    return f"{', '.join(words[:-1])} {last} {words[-1]}"
