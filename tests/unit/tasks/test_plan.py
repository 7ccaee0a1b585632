"""A plan being driven, step after step."""

from dataclasses import replace
from math import hypot, radians

import pytest

from mav_tasks.tasks.events import StepReached
from mav_tasks.tasks.goal import (
    Delay,
    Face,
    GlobalPlace,
    GoTo,
    Jump,
    LocalPlace,
    Move,
    Near,
    Nothing,
    Perform,
    Plan,
    SetSpeed,
    Step,
    Wait,
)
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from mav_tasks.tasks.task import Frame, Terms
from tests.unit.tasks.rig import BY, Rig, Rover, run, run_until

RADIUS = 0.5


def to(north: float, east: float = 0.0, *, passes: bool = True, wait: float = 0.0) -> GoTo:
    return GoTo(LocalPlace(north, east), passes=passes, wait=wait)


class Drive:
    """A plan on its way, and what was seen of it."""

    def __init__(self, *steps: Step) -> None:
        self.rig, self.rover = Rig(), Rover()
        self.plan = Plan(steps)
        self.rig.submit(self.plan)
        self.reached: list[int] = []
        self.performed: list[int] = []
        self.times: dict[int, float] = {}
        self.track: list[tuple[float, float, float]] = []  # north, east, speed

    def look(self) -> None:
        for event in self.rig.registry.take_events():
            if isinstance(event, StepReached):
                self.reached.append(event.step)
                self.times.setdefault(event.step, event.at)
                if event.performs:
                    self.performed.append(event.step)
        pose = self.rover.pose
        self.track.append((pose.north, pose.east, self.rover.velocity.forward))

    def until_over(self, *, within: float = 200.0) -> "Drive":
        def is_over() -> bool:
            self.look()
            return self.rig.state(1) is S.COMPLETED

        run_until(self.rig, self.rover, is_over, within=within)
        return self

    def until_at(self, step: int) -> "Drive":
        def is_there() -> bool:
            self.look()
            task = self.rig.task(1)
            return task.state is S.EXECUTING and task.progress.step == step

        run_until(self.rig, self.rover, is_there)
        return self

    def nearest(self, north: float, east: float) -> float:
        return min(hypot(n - north, e - east) for n, e, _ in self.track)


def test_every_place_is_passed_within_its_radius_and_the_last_is_stood_at() -> None:
    drive = Drive(Nothing(), to(4), to(4, 4), to(0, 4), to(0, 0, passes=False)).until_over()
    assert drive.reached == [1, 2, 3, 4]
    for place in ((4, 0), (4, 4), (0, 4), (0, 0)):
        assert drive.nearest(*place) <= RADIUS
    assert drive.rover.velocity.forward == 0.0


def test_a_gentle_bend_is_driven_without_stopping() -> None:
    drive = Drive(to(4), to(8, 1.5), to(12, 1.5, passes=False)).until_over()
    between = [speed for north, _, speed in drive.track if 1.0 < north < 10.5]
    assert min(between) > 0.3
    assert drive.nearest(4, 0) <= RADIUS
    assert drive.nearest(8, 1.5) <= RADIUS


def test_before_a_sharp_corner_it_slows_down() -> None:
    drive = Drive(to(4), to(4, 4, passes=False)).until_over()
    assert max(north for north, _, _ in drive.track) < 4.6
    turned = [speed for north, east, speed in drive.track if north > 3.4 and east < 0.2]
    assert min(turned) == 0.0


def test_a_place_with_a_stay_is_stood_at_for_that_time() -> None:
    drive = Drive(to(2, wait=3.0, passes=False), to(4, passes=False)).until_over()
    here = [speed for north, _, speed in drive.track if 1.4 < north < 2.2]
    assert here.count(0.0) * 0.05 > 2.9


def test_a_speed_counts_from_its_place_in_the_plan_on() -> None:
    drive = Drive(to(3), SetSpeed(0.3), to(6), SetSpeed(1.5), to(12, passes=False)).until_over()
    first = max(speed for north, _, speed in drive.track if north < 2.4)
    second = [speed for north, _, speed in drive.track if 3.5 < north < 5.4]
    third = max(speed for north, _, speed in drive.track if north > 6)
    assert first == pytest.approx(0.5, abs=0.02)
    assert max(second) == pytest.approx(0.3, abs=0.02)
    assert third == pytest.approx(1.5, abs=0.05)


def test_commands_are_sent_on_the_way_when_their_conditions_are_met() -> None:
    steps = (to(4), Delay(2.0), Perform(), Near(1.0), Perform(), to(8, passes=False), Perform())
    drive = Drive(*steps).until_over()
    assert drive.performed == [2, 4, 6]
    assert drive.reached == [0, 1, 2, 3, 4, 5, 6]
    assert drive.times[2] - drive.times[0] == pytest.approx(2.0, abs=0.1)
    assert drive.times[4] > drive.times[2]
    driven = (drive.times[4] - drive.times[0]) * 0.5  # m, from where the first was passed
    assert driven == pytest.approx(4 + RADIUS - 1, abs=0.1)


def test_what_is_pending_at_the_end_is_still_done() -> None:
    drive = Drive(to(1, passes=False), Delay(4.0), Perform()).until_over()
    assert drive.performed == [2]
    assert drive.times[2] - drive.times[0] == pytest.approx(4.0, abs=0.2)


def test_a_loop_is_driven_so_often() -> None:
    drive = Drive(to(2), to(0), Jump(0, 2), to(3, passes=False)).until_over()
    assert drive.reached == [0, 1, 0, 1, 0, 1, 3]


def test_moves_turns_and_waits_are_steps_too() -> None:
    drive = Drive(Move(1.0), Face(radians(90)), Wait(1.0), Move(-0.5)).until_over()
    pose = drive.rover.pose
    assert (pose.north, pose.east) == pytest.approx((1.0, -0.5), abs=0.04)


def test_a_pause_in_mid_step_goes_on_with_that_step() -> None:
    drive = Drive(to(3), to(6), to(9, passes=False)).until_at(1)
    run(drive.rig, drive.rover, seconds=2)
    drive.rig.tasks.pause(R.OPERATOR, actor=BY, now=drive.rig.now)
    run(drive.rig, drive.rover, seconds=3)
    stood = drive.rover.pose
    drive.rig.tasks.proceed(drive.rover.view(drive.rig.now), actor=BY, now=drive.rig.now)
    drive.until_over()
    assert drive.reached == [0, 1, 2]
    assert stood.north < 6


def test_another_task_in_between_leads_back_to_the_same_step() -> None:
    drive = Drive(to(3), to(6), to(9, passes=False)).until_at(1)
    drive.rig.submit(Move(0.5), terms=Terms(priority=9, is_preemptive=True))
    drive.until_over()
    assert drive.reached == [0, 1, 2]
    assert drive.rig.state(2) is S.COMPLETED
    assert drive.nearest(6, 0) <= RADIUS


def test_a_crash_in_mid_plan_is_continued_with_the_same_step() -> None:
    drive = Drive(to(3), Jump(0, 1), to(6), to(9, passes=False)).until_at(2)
    assert drive.reached == [0, 0]
    again = drive.rig.restarted()
    assert again.state(1) is S.HELD
    drive.rig = again
    drive.rover.is_ours = False
    seen = drive.rover.view(again.now)
    again.tasks.releases.release(
        again.task(1), again=True, may_continue=True, seen=seen, actor=BY, now=again.now
    )
    drive.until_over()
    assert drive.reached == [0, 0, 0, 0, 2, 3], "all of it again"


def test_another_step_can_be_gone_on_with_at_once() -> None:
    drive = Drive(to(3), to(6), to(6, 3, passes=False)).until_at(0)
    run(drive.rig, drive.rover, seconds=2)
    drive.rig.tasks.skip_to(drive.rig.task(1), 2, now=drive.rig.now)
    drive.until_over()
    assert drive.reached == [2]
    assert drive.nearest(6, 0) > 1.0


def test_another_step_is_kept_over_a_pause() -> None:
    drive = Drive(to(3), to(6), to(9, passes=False)).until_at(0)
    drive.rig.tasks.pause(R.OPERATOR, actor=BY, now=drive.rig.now)
    run(drive.rig, drive.rover, seconds=1)
    drive.rig.tasks.skip_to(drive.rig.task(1), 2, now=drive.rig.now)
    drive.rig.tasks.proceed(drive.rover.view(drive.rig.now), actor=BY, now=drive.rig.now)
    drive.until_over()
    assert drive.reached == [2]


def test_a_plan_of_nothing_is_done_at_once() -> None:
    assert Drive(Nothing(), SetSpeed(1.0)).until_over(within=10).reached == [1]


def test_places_on_earth_wait_for_the_origin() -> None:
    rig, rover = Rig(), Rover()
    rig.submit(Plan((Nothing(), GoTo(GlobalPlace(470000000, 80000000), radius=RADIUS))))
    rig.step(rover.view)
    assert rig.state(1) is S.QUEUED
    rover.frame = Frame(470000000, 80000000 - 200, 0.0)
    run_until(rig, rover, lambda: rig.state(1) is S.COMPLETED)


def test_points_close_together_are_driven_without_stopping() -> None:
    drive = Drive(*(to(0.4 * n) for n in range(1, 15)), to(6, passes=False)).until_over()
    between = [speed for north, _, speed in drive.track if 0.8 < north < 5.0]
    assert min(between) > 0.2


def test_a_place_that_is_missed_is_faced_and_driven_to_again() -> None:
    drive = Drive(to(3), to(6), to(9, passes=False)).until_at(1)
    pose = drive.rover.pose
    drive.rover.pose = replace(pose, east=0.9)  # the position is corrected
    drive.until_over()
    assert drive.nearest(6, 0) <= RADIUS
    assert min(speed for _, _, speed in drive.track) > -0.1


def test_a_condition_that_a_place_has_not_met_does_not_wait_for_another() -> None:
    steps = (to(4), Near(0.1), Perform(), to(8), to(12, passes=False))
    drive = Drive(*steps).until_over()
    assert drive.times[2] < drive.times[3] + 0.2


def test_skipping_at_speed_stands_before_it_turns() -> None:
    drive = Drive(SetSpeed(2.0), to(20), to(3, 3, passes=False)).until_at(1)
    run(drive.rig, drive.rover, seconds=5)
    assert drive.rover.velocity.forward > 1.5
    drive.rig.tasks.skip_to(drive.rig.task(1), 2, now=drive.rig.now)
    demand = drive.rig.step(drive.rover.view)
    assert demand.velocity.is_zero
    drive.until_over()
