"""Families of metrics and their text, in Prometheus' text format 0.0.4. Pure.

The text is written here and not by the ``prometheus-client`` package, because that makes all of it
in one call: with 255 rovers it would keep the interpreter's lock (GIL) from the event loop for tens
of milliseconds. Here each line comes by itself, and the caller pauses between them.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import accumulate
from math import inf, isnan
from typing import Literal

from mav_tasks.basics.histogram import Distribution

#: of an HTTP answer with this text
CONTENT_TYPE = "text/plain; version=0.0.4; charset=utf-8"
PREFIX = "mav_tasks_"

Kind = Literal["counter", "gauge", "histogram"]
#: the values of a family's labels, in their order, and the figure
Sample = tuple[tuple[str, ...], float | Distribution]


@dataclass(frozen=True, slots=True)
class Family:
    """A metric: its full name, kind, meaning in one line, and the names of its labels."""

    name: str
    kind: Kind
    meaning: str
    labels: tuple[str, ...] = ()

    @property
    def series(self) -> tuple[str, ...]:
        """The names that queries use."""
        if self.kind != "histogram":
            return (self.name,)
        return tuple(f"{self.name}_{part}" for part in ("bucket", "sum", "count"))


def lines_of(family: Family, samples: Iterable[Sample]) -> Iterator[str]:
    """Yield the lines of a family, without line ends; none if there are no samples."""
    has_begun = False
    for values, figure in samples:
        if not has_begun:
            has_begun = True
            yield f"# HELP {family.name} {_escaped(family.meaning)}"
            yield f"# TYPE {family.name} {family.kind}"
        pairs = [
            f'{label}="{_quoted(value)}"'
            for label, value in zip(family.labels, values, strict=True)
        ]
        if isinstance(figure, Distribution):
            yield from _histogram(family.name, pairs, figure)
        else:
            yield f"{family.name}{_braced(pairs)} {_number(figure)}"


def _histogram(name: str, pairs: list[str], figure: Distribution) -> Iterator[str]:
    bounds = (*figure.bounds, inf)
    for bound, count in zip(bounds, accumulate(figure.counts), strict=True):
        up_to = f'le="{_number(bound)}"'
        yield f"{name}_bucket{_braced([*pairs, up_to])} {count}"
    yield f"{name}_sum{_braced(pairs)} {_number(figure.total)}"
    yield f"{name}_count{_braced(pairs)} {figure.count}"


def _braced(pairs: list[str]) -> str:
    return f"{{{','.join(pairs)}}}" if pairs else ""


def _number(value: float) -> str:
    if value in (inf, -inf):
        return "+Inf" if value > 0 else "-Inf"
    return "NaN" if isnan(value) else repr(value)


def _escaped(text: str) -> str:
    return text.replace("\\", "\\\\").replace("\n", "\\n")


def _quoted(text: str) -> str:
    return _escaped(text).replace('"', '\\"')
