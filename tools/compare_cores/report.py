"""What a comparison prints in the end."""

from collections import Counter
from collections.abc import Iterable, Iterator

from .compared import Compared
from .intended import INTENDED

MOST_SHOWN = 20  # records with something unexplained


def lines(results: Iterable[Compared]) -> Iterator[str]:
    """Give the report, line by line."""
    found = sorted(results, key=lambda each: each.whose)
    usable = [each for each in found if not each.unusable]
    unexplained = [each for each in usable if each.unexplained]
    same = [each for each in usable if not each.intended and not each.unexplained]
    yield f"records               {len(found)}"
    yield f"  of no use           {len(found) - len(usable)}"
    yield f"  the same            {len(same)}"
    yield f"  as intended         {len(usable) - len(same) - len(unexplained)}"
    yield f"  UNEXPLAINED         {len(unexplained)}"
    yield f"inputs                {sum(each.inputs for each in usable)}"
    yield f"packets compared      {sum(each.packets for each in usable)}"
    yield f"packets after a split {sum(each.left_out for each in usable)}"
    yield f"seconds compared      {sum(each.seconds for each in usable):.0f}"
    skipped, added = (sum(getattr(e, name) for e in usable) for name in ("skipped", "added"))
    yield f"wake-ups              {skipped} only of the old core, {added} only of the new one"
    yield from _table(usable)
    for why, count in Counter(_short(each.unusable) for each in found if each.unusable).items():
        yield f"of no use, {count}: {why}"
    for each in [each for each in found if each.unusable][:MOST_SHOWN]:
        yield f"  {each.whose}: {each.unusable}"
    for each in unexplained[:MOST_SHOWN]:
        yield f"\nUNEXPLAINED: {each.whose}, {each.seconds:.3f} s after its beginning"
        yield from (f"  {line}" for line in each.unexplained)
    if len(unexplained) > MOST_SHOWN:
        yield f"\nand {len(unexplained) - MOST_SHOWN} records more"


def _table(usable: list[Compared]) -> Iterator[str]:
    yield "intended differences: packets, records, records that diverge by it"
    for entry in INTENDED:
        packets = sum(each.intended[entry.name] for each in usable)
        records = sum(entry.name in each.intended for each in usable)
        diverged = sum(each.diverged.startswith(f"{entry.name}, from") for each in usable)
        yield f"  {packets:7} {records:5} {diverged:5}  {entry.name}: {entry.why}"


def _short(text: str) -> str:
    return text.partition(": ")[0]
