"""The table: each figure, real and simulated side by side."""

from collections import Counter
from collections.abc import Iterator, Sequence

from rover_sim.compare.figure import Figure, Scale, Value
from rover_sim.compare.pairs import Pair
from rover_sim.compare.verdict import Comparison, Verdict

NAME_WIDTH, VALUE_WIDTH = 56, 22


def lines(
    pair: Pair, comparisons: Sequence[Comparison], *, hidden: frozenset[Verdict]
) -> Iterator[str]:
    """Yield the table of one rover, without the lines of the hidden verdicts."""
    yield f"{pair.name}: simulated, beside {pair.real}"
    yield _row("figure", "real", "simulated", "ratio", "verdict")
    group = ""
    for each in comparisons:
        if each.verdict in hidden:
            continue
        figure = each.figure
        if figure.group != group:
            group = figure.group
            yield group
        yield _line(figure, each)
    yield summary(pair, comparisons)


def summary(pair: Pair, comparisons: Sequence[Comparison]) -> str:
    """Return the number of near, explained and differing figures."""
    count = Counter(each.verdict for each in comparisons)
    return (
        f"{pair.name}: {len(comparisons)} figures, {count[Verdict.OK]} within a factor of 1.5,"
        f" {count[Verdict.EXPLAINED]} explained, {count[Verdict.DIFFERS]} differ"
    )


def _line(figure: Figure, comparison: Comparison) -> str:
    name = f"  {figure.name}, {figure.scale.unit}" if figure.scale.unit else f"  {figure.name}"
    ratio = "" if comparison.ratio is None else f"{comparison.ratio:.2f}"
    verdict = comparison.verdict.value
    if comparison.why:
        verdict += f": {comparison.why}"
    real, simulated = (_text(each, figure.scale) for each in (comparison.real, figure.value))
    if max(len(real), len(simulated)) <= VALUE_WIDTH:
        return _row(name, real, simulated, ratio, verdict)
    return "\n".join((_row(name, "", "", ratio, verdict), f"    {real}", f"    {simulated}"))


def _row(name: str, real: str, simulated: str, ratio: str, verdict: str) -> str:
    values = f"{real:>{VALUE_WIDTH}} {simulated:>{VALUE_WIDTH}}"
    return f"{name:<{NAME_WIDTH}} {values} {ratio:>7}  {verdict}"


def _text(value: Value, scale: Scale) -> str:
    if value is None:
        return "–"
    return value if isinstance(value, str) else f"{value:.{scale.digits}f}"
