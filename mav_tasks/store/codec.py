"""Converts frozen dataclasses to rows of JSON values and back, driven by their annotations.

A row is a flat list. A format, stored beside the rows, tells the meaning of its columns: for each
class the paths of its fields, dotted for a nested dataclass. An optional dataclass is a nested row;
if several classes are possible, the class name is its first item. When a row of an older format is
read, a missing field takes its default and an unknown one is skipped: a new field needs no
migration. (Names in every row would cost three times the size, and twice the time.)

Stored times are UTC seconds: encoding adds ``offset``, UTC minus monotonic seconds, to the fields
named in MONOTONIC, and decoding subtracts it. NaN and infinity are refused.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from functools import cache
from json import JSONEncoder, loads
from operator import attrgetter, itemgetter
from types import NoneType, UnionType
from typing import Any, NewType, Union, get_args, get_origin, get_type_hints

__all__ = ["MONOTONIC", "Decoder", "Encoder", "Unreadable", "dumps", "format_of", "loads"]

#: fields in monotonic seconds, in any class
MONOTONIC = frozenset(
    {"at", "submitted_at", "changed_at", "start_at", "deadline", "booted_at", "heard_at"}
)

#: class name -> paths of its fields, in their order
Format = Mapping[str, tuple[str, ...]]
#: value, offset -> value for JSON, or back
Converter = Callable[[Any, float], Any]

SAMPLE = 50  # values of a class, to estimate whether many are equal
MOST_SHARED = 10_000  # cached values of a class that equal rows share

_PLAIN = frozenset({int, float, str, bool, NoneType})

# The check for circular references costs a dict entry for each list; frozen values have none.
_encoder = JSONEncoder(separators=(",", ":"), allow_nan=False, check_circular=False)


class Unreadable(ValueError):
    """Stored text that this version cannot decode."""


def dumps(value: object) -> str:
    """Return compact JSON; raise ValueError for NaN and infinity."""
    return _encoder.encode(value)


def format_of(*kinds: type) -> dict[str, tuple[str, ...]]:
    """Return the format of dataclasses and their fields; raise TypeError for other fields."""
    found: dict[str, tuple[str, ...]] = {}
    waiting = list(kinds)
    while waiting:
        kind = waiting.pop()
        if kind.__name__ not in found:
            leaves = _leaves(kind)
            found[kind.__name__] = tuple(leaves)
            waiting += [inner for hint in leaves.values() for inner in _records(hint)]
    return dict(sorted(found.items()))


class Encoder:
    """Converts dataclasses to rows, in the order of ``format_of``.

    ``is_exact``: times are left unchanged, bit for bit, and ``offset`` is ignored.
    """

    def __init__(self, *, is_exact: bool = False) -> None:
        self._moved: frozenset[str] = frozenset() if is_exact else MONOTONIC
        self._encoders: dict[type, Callable[[Any, float], list[Any]]] = {}

    def row(self, value: Any, *, offset: float) -> list[Any]:
        kind = type(value)
        encode = self._encoders.get(kind)
        if encode is None:
            encode = self._encoders[kind] = self._encoder_of(kind)
        return encode(value, offset)

    def _encoder_of(self, kind: type) -> Callable[[Any, float], list[Any]]:
        leaves = _leaves(kind)
        get = _getter(tuple(leaves))
        special = [
            (index, convert)
            for index, (path, hint) in enumerate(leaves.items())
            if (convert := self._converter(path, hint)) is not None
        ]

        def encode(value: Any, offset: float) -> list[Any]:
            row = list(get(value))
            for index, convert in special:
                if row[index] is not None:
                    row[index] = convert(row[index], offset)
            return row

        return encode

    def _converter(self, path: str, hint: Any) -> Converter | None:
        if path.rpartition(".")[2] in self._moved:
            return lambda value, offset: value + offset
        inner = _records(hint)
        if get_origin(hint) is tuple:
            part = self._converter("", get_args(hint)[0])
            return lambda value, offset: [part(v, offset) if part else v for v in value]
        if len(inner) > 1:
            return lambda v, offset: [type(v).__name__, *self.row(v, offset=offset)]
        if inner:
            return lambda value, offset: self.row(value, offset=offset)
        return None  # JSON has such values; enums are whole numbers


class Decoder:
    """Converts rows of one format to dataclasses: many at once, column by column.

    ``is_exact`` must be as in the Encoder. If set, equal rows do not share a value: -0.0 and 0.0
    are equal, too.
    """

    def __init__(self, written: Format, *, is_exact: bool = False) -> None:
        self._moved: frozenset[str] = frozenset() if is_exact else MONOTONIC
        self._shares = not is_exact
        self._written = written
        self._decoders: dict[type, _Decode] = {}

    def values(self, kind: type, rows: Sequence[list[Any]], *, offset: float) -> list[Any]:
        """Return the values of rows; raise Unreadable if one cannot be decoded."""
        if not rows:
            return []
        if not fields(kind):
            return [kind() for _ in rows]
        decode = self._decoders.get(kind)
        if decode is None:
            decode = self._decoders[kind] = self._decoder_of(kind)
        try:
            return decode(list(zip(*rows, strict=True)), offset)
        except Unreadable:
            raise
        except KeyError as error:
            raise Unreadable(f"{kind.__name__}: this version does not know {error}") from error
        except (TypeError, ValueError, IndexError, AttributeError) as error:
            raise Unreadable(f"{kind.__name__}: {error}") from error

    def _decoder_of(self, kind: type) -> "_Decode":
        if kind.__name__ not in self._written:
            raise Unreadable(f"{kind.__name__} has another format")
        places = {path: index for index, path in enumerate(self._written[kind.__name__])}
        special = [
            (places[path], convert)
            for path, hint in _leaves(kind).items()
            if path in places and (convert := self._converter(path, hint)) is not None
        ]
        build = _builder(kind, places, shares=self._shares)

        def decode(columns: list[Sequence[Any]], offset: float) -> list[Any]:
            for index, convert in special:
                columns[index] = convert(columns[index], offset)
            return build(columns)

        return decode

    def _converter(self, path: str, hint: Any) -> "_Decode | None":
        """Return the converter of a column, or None if JSON values need no conversion."""
        if path.rpartition(".")[2] in self._moved:
            return lambda column, offset: [None if v is None else v - offset for v in column]
        inner = {kind.__name__: kind for kind in _records(hint)}
        if get_origin(hint) is tuple:
            part = self._converter("", get_args(hint)[0])
            return lambda column, offset: [
                tuple(part(value, offset) if part else value) for value in column
            ]
        if len(inner) > 1:
            return lambda column, offset: self._tagged(inner, column, offset)
        if inner:
            (only,) = inner.values()
            return lambda column, offset: self._optional(only, column, offset)
        enum = _enum_in(hint)
        if enum is None:
            return None
        members = {None: None, **{member.value: member for member in enum}}
        return lambda column, _: [members[value] for value in column]

    def _optional(self, kind: type, column: Sequence[Any], offset: float) -> list[Any]:
        there = [row for row in column if row is not None]
        values = iter(self.values(kind, there, offset=offset))
        return [None if row is None else next(values) for row in column]

    def _tagged(self, kinds: Mapping[str, type], column: Sequence[Any], offset: float) -> list[Any]:
        rows: dict[str, list[list[Any]]] = {}
        for row in column:
            if row is not None:
                rows.setdefault(row[0], []).append(row[1:])
        values = {
            name: iter(self.values(kinds[name], of_kind, offset=offset))
            for name, of_kind in rows.items()
        }
        return [None if row is None else next(values[row[0]]) for row in column]


#: columns of converted values, offset -> values; or one column
_Decode = Callable[[Any, float], list[Any]]


def _builder(
    kind: type, places: Mapping[str, int], prefix: str = "", *, shares: bool
) -> Callable[[list[Sequence[Any]]], list[Any]]:
    """Return a function from columns to dataclasses; fields not in ``places`` get defaults."""
    hints = _hints(kind)
    sources: dict[str, Callable[[list[Sequence[Any]]], Sequence[Any]]] = {}
    for field in fields(kind):
        path = prefix + field.name
        if path in places:
            sources[field.name] = itemgetter(places[path])
        elif any(place.startswith(f"{path}.") for place in places):
            sources[field.name] = _builder(hints[field.name], places, f"{path}.", shares=shares)
    takes = tuple(sources.values())
    make = _maker(kind, tuple(sources))
    shared: dict[tuple[Any, ...], Any] = {}

    def build(columns: list[Sequence[Any]]) -> list[Any]:
        parts = [take(columns) for take in takes]
        if not prefix or not shares:
            return list(map(make, *parts))
        rows = list(zip(*parts, strict=True))
        if 2 * len(set(rows[:SAMPLE])) > len(rows[:SAMPLE]):  # mostly different, as dedup keys are
            return list(map(make, *parts))
        different = dict.fromkeys(rows)
        if len(shared) > MOST_SHARED:
            shared.clear()
        shared.update((row, make(*row)) for row in different if row not in shared)
        return [shared[row] for row in rows]  # mostly equal, as task options and submitters are

    return build


def _maker(kind: type, names: tuple[str, ...]) -> Callable[..., Any]:
    if names == tuple(field.name for field in fields(kind)):
        return kind
    return lambda *values: kind(**dict(zip(names, values, strict=True)))


@cache  # the annotations of a class are slow to read, and each opening of a store asks for them
def _leaves(kind: type) -> Mapping[str, Any]:
    """Return the annotation of each column of a class's row, by path."""
    hints, leaves = _hints(kind), dict[str, Any]()
    for field in fields(kind):
        hint = _real(hints[field.name])
        if is_dataclass(hint):
            assert isinstance(hint, type)
            leaves |= {f"{field.name}.{path}": leaf for path, leaf in _leaves(hint).items()}
        else:
            leaves[field.name] = hint
    return leaves


@cache
def _hints(kind: type) -> Mapping[str, Any]:
    return get_type_hints(kind)


@cache
def _records(hint: Any) -> Sequence[type]:
    """Return the dataclasses in an annotation; raise TypeError if it allows an unsupported type."""
    hint = _real(hint)
    if get_origin(hint) in (Union, UnionType):
        return [kind for part in get_args(hint) for kind in _records(part)]
    if get_origin(hint) is tuple and get_args(hint)[1:] == (...,):
        return _records(get_args(hint)[0])
    if is_dataclass(hint):
        assert isinstance(hint, type)
        return [hint]
    if hint in _PLAIN or (isinstance(hint, type) and issubclass(hint, Enum)):
        return []
    raise TypeError(f"no way to store {hint}")


def _enum_in(hint: Any) -> type[Enum] | None:
    parts = get_args(hint) if get_origin(hint) in (Union, UnionType) else (hint,)
    for part in map(_real, parts):
        if isinstance(part, type) and issubclass(part, Enum):
            return part
    return None


def _getter(paths: tuple[str, ...]) -> Callable[[Any], tuple[Any, ...]]:
    if len(paths) > 1:
        return attrgetter(*paths)
    return lambda value: tuple(attrgetter(path)(value) for path in paths)


def _real(hint: Any) -> Any:
    while isinstance(hint, NewType):
        hint = hint.__supertype__
    return hint
