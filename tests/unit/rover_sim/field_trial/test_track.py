"""Where the rover was: speeds by displacement, and when it stood."""

import pytest

from rover_sim.field_trial.track import Place, Track

STEP = 0.02  # s


def rolled(speed: float, *, until: float, total: float = 6.0) -> Track:
    """Return the track of a rover that rolls north and stands from a time on."""
    track = Track()
    north = 0.0
    for count in range(round(total / STEP)):
        time = count * STEP
        track.add(Place(time, north, 0.0, 0.0))
        north += speed * STEP if time < until else 0.0
    return track


def test_it_stood_when_its_last_displacement_ended() -> None:
    assert rolled(1.0, until=2.0).stood_after(0.0) == pytest.approx(2.0, abs=0.3)


def test_who_still_moves_has_not_stood() -> None:
    track = rolled(1.0, until=9.0)
    assert track.stood_after(0.0) is None
    assert not track.stands()
    assert track.speed() == pytest.approx(1.0, abs=0.05)


def test_who_never_moved_stood_at_once() -> None:
    assert rolled(0.0, until=0.0).stood_after(1.0) == 0.0


def test_who_only_turns_does_not_stand() -> None:
    track = Track()
    for count in range(100):
        track.add(Place(count * STEP, 0.0, 0.0, count * STEP * 0.3))
    assert not track.stands()


def test_what_is_not_later_is_passed_over() -> None:
    track = Track()
    track.add(Place(1.0, 0.0, 0.0, 0.0))
    track.add(Place(1.0, 5.0, 0.0, 0.0))
    assert track.last.north == 0.0
    assert track.travelled(0.0) == 0.0
