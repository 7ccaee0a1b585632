"""Files as people have them load, or are refused in words that lead on."""

from pathlib import Path

import pytest

from mav_tasks import read_plan
from mav_tasks.basics.errors import PlanFileError
from mav_tasks.plans import parse_plan
from tests.kit.found_files import FILES, Found


def test_a_file_loads_or_is_refused_in_words(tmp_path: Path) -> None:
    for found in FILES:
        file = tmp_path / "some file"
        file.write_bytes(found.data)
        if found.holds is None:
            with pytest.raises(PlanFileError) as refusal:
                read_plan(file)
            assert found.words in str(refusal.value)
        else:
            plan = read_plan(file)
            assert (len(plan.items), len(plan.fence), len(plan.rally)) == found.holds
            assert repr(parse_plan(found.text)) == repr(plan)


def of_name(name: str) -> Found:
    return next(each for each in FILES if each.name == name)


def test_home_and_jumps_are_as_in_the_program_that_wrote_the_file() -> None:
    assert parse_plan(of_name("home unset").text).home is None
    relative = parse_plan(of_name("frame of home").text)
    assert relative.home == (614981000, 237610000, 95.0)
    assert parse_plan(of_name("a jump").text).items[1].params[0] == 0.0, "the first item"
    oldest = parse_plan(of_name("old.mission").text)
    assert oldest.home == (614981000, 237610000, 95.0)
    assert (oldest.items[0].x, oldest.items[0].y) == (614982000, 237612000)


def test_a_fence_does_not_have_the_corner_to_which_it_returns() -> None:
    for name in ("mavproxy.fen", "planner.fen", "area.poly"):
        (ring,) = parse_plan(of_name(name).text).fence
        assert ring == parse_plan(of_name("old.fence").text).fence[0]
