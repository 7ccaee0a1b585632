"""Links in the README of a wheel lead somewhere, or are plain words."""

from pathlib import Path
from runpy import run_path

TOOLS = Path(__file__).resolve().parents[3] / "tools"
with_links = run_path(str(TOOLS / "hatch.py"))["with_links"]

TEXT = "See [the guide](mav_tasks/GUIDE.md#keys) and [SemVer](https://semver.org), [below](#x).\n"


def test_without_a_place_links_are_plain_words() -> None:
    told = "See the guide and [SemVer](https://semver.org), [below](#x).\n"
    assert with_links(TEXT, "") == told


def test_they_lead_to_the_source() -> None:
    link = "[the guide](https://host/x/blob/main/mav_tasks/GUIDE.md#keys)"
    assert link in with_links(TEXT, "https://host/x/")
