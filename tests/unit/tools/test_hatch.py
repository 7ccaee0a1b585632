"""Links in the README of a wheel lead somewhere, or are plain words."""

from pathlib import Path
from runpy import run_path

TOOLS = Path(__file__).resolve().parents[3] / "tools"
with_links = run_path(str(TOOLS / "hatch.py"))["with_links"]

TEXT = "See [keys](mav_tasks/guide/people.md#limits), [SemVer](https://semver.org), [below](#x).\n"


def test_without_a_place_links_are_plain_words() -> None:
    told = "See keys, [SemVer](https://semver.org), [below](#x).\n"
    assert with_links(TEXT, "") == told


def test_they_lead_to_the_source() -> None:
    link = "[keys](https://host/x/blob/main/mav_tasks/guide/people.md#limits)"
    assert link in with_links(TEXT, "https://host/x/")
