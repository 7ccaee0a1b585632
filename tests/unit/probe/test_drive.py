"""Driving in an area: what is measured, and that it ends well, whatever happens on the way."""

from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import pytest

from mav_tasks.engine.vehicles.motion_monitor import MotionMonitor
from mav_tasks.links.memory import Conditions
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.packet import split_datagram
from mav_tasks.probe.probe import Interrupted
from mav_tasks.probe.profile import profile_of, why_none
from mav_tasks.probe.report import Mark, lines_of
from rover_sim.body import Pose
from rover_sim.faults import Faults
from rover_sim.parameters import INT16, Parameter
from rover_sim.personas import ARDUPILOT, GENERIC, PX4, Mode, Persona
from tests.kit.car import Car
from tests.kit.probing import BOX, ProbeWorld, is_moving

TURNING_PX4 = replace(PX4, honours_yaw_rate=True)
MAKES = [ARDUPILOT, PX4, GENERIC]
EACH = pytest.mark.parametrize("persona", MAKES, ids=lambda p: p.name)
#: a generic one is spoken to as a PX4
TWO = pytest.mark.parametrize("persona", [ARDUPILOT, PX4], ids=lambda p: p.name)
POSITION, ATTITUDE = m.LocalPositionNed.id, m.Attitude.id


@EACH
@pytest.mark.parametrize("yaw", [0.0, 2.5])
def test_all_is_measured_inside_its_area_and_the_rover_is_left_at_rest(
    persona: Persona, yaw: float
) -> None:
    world = ProbeWorld(drive=True, persona=persona, start=Pose(north=5.0, east=-3.0, yaw=yaw))
    world.finish()
    driven = world.driven
    assert (driven.ended, driven.arming, driven.hold) == ("", "accepted", "yes")
    assert world.rests()
    assert sorted(driven.accepted) == ["BODY_NED 0x05C7", "BODY_NED 0x0DC7", "LOCAL_NED 0x0DC7"]
    turns = persona is ARDUPILOT
    assert driven.yaw_rate == ("honoured" if turns else "ignored")
    assert driven.reverse == ("yes" if turns else "no")
    assert driven.speed == pytest.approx(0.3, abs=0.02)
    assert driven.stopping_distance is not None
    assert 0.04 < driven.stopping_distance < 0.15
    assert driven.loss_stop == "yes"
    assert driven.setpoint_timeout == pytest.approx(3.1 if turns else 1.1, abs=0.2)
    assert 0.1 < driven.farthest < BOX
    assert world.farthest < BOX


def test_a_px4_that_turns_at_a_yaw_rate_gets_a_profile_that_says_so() -> None:
    world = ProbeWorld(drive=True, persona=TURNING_PX4)
    found = world.finish().findings
    assert why_none(found) == ""
    profile = profile_of(found, probed="2026-11-21T12:00:00Z")
    assert (profile.yaw_rate, profile.reverse, profile.autopilot) == ("honoured", "yes", "px4")
    assert (profile.system_id, profile.uid) == (1, "1")


def test_zeros_come_first_and_the_mode_before_arming() -> None:
    world = ProbeWorld(drive=True)
    world.finish()
    assert not is_moving(world.setpoints()[0][1])
    orders = [each for each in world.commands() if each[0] in (176, 400)]
    assert [order[0] for order in orders][:2] == [176, 400]
    assert orders[-1] == (400, 0.0)
    last = [is_moving(message) for _, message in world.setpoints()][-3:]
    assert last == [False, False, False]


def test_setpoints_come_at_20_hertz_but_for_the_silence_that_is_meant() -> None:
    world = ProbeWorld(drive=True)
    world.finish()
    times = [at for at, _ in world.setpoints()]
    gaps = [later - earlier for earlier, later in pairwise(times)]
    assert len([gap for gap in gaps if gap > 0.2]) == 1


@TWO
def test_a_bad_radio_spoils_the_figures_and_not_the_end(persona: Persona) -> None:
    world = ProbeWorld(drive=True, persona=persona)
    world.net.conditions = Conditions(delay=0.05, jitter=0.05, loss=0.08, duplication=0.05)
    world.finish()
    world.run(2.0)
    assert (world.driven.ended, world.driven.loss_stop) == ("", "yes")
    assert (world.rests(), world.farthest < BOX) == (True, True)
    assert world.probe.findings.rates_given_back == "as before"


class TestFaults:
    def test_arming_that_is_refused_is_told_with_the_rovers_words(self) -> None:
        world = ProbeWorld(drive=True)
        world.fault(Faults(refuse_arm=True))
        world.finish()
        assert world.driven.ended.startswith("arming refused")
        assert world.driven.arming == world.driven.ended
        assert not any(is_moving(message) for _, message in world.setpoints())
        assert (world.rests(), world.farthest) == (True, 0.0)
        assert why_none(world.probe.findings) == "the drive was not completed"

    @EACH
    def test_a_mode_that_is_refused_is_told(self, persona: Persona) -> None:
        world = ProbeWorld(drive=True, persona=persona)
        world.fault(Faults(refuse_mode=True))
        world.finish()
        assert "refused" in world.driven.ended
        assert not any(is_moving(message) for _, message in world.setpoints())
        assert not world.rover.autopilot.armed

    @EACH
    @pytest.mark.parametrize("deaf", [False, True])
    def test_a_rover_that_falls_silent_midway_is_stopped(
        self, persona: Persona, deaf: bool
    ) -> None:
        world = ProbeWorld(drive=True, persona=persona)
        world.until_moving()
        world.fault(Faults(silent=True, deaf=deaf))
        silent_at = world.now
        world.finish()
        assert world.driven.ended.startswith("no position for 0.3")
        moving = [at for at, message in world.setpoints() if is_moving(message)]
        assert max(moving) < silent_at + 0.45
        world.run(4.0)
        assert world.stands()
        assert world.farthest < BOX
        assert world.rests() is not deaf  # a dead link leaves it to its own time-out

    def test_a_position_that_stands_still_stops_it(self) -> None:
        world = ProbeWorld(drive=True)
        world.until_moving()
        world.fault(Faults(position_frozen=True))
        world.finish()
        assert world.driven.ended.startswith("no position for 0.3")
        assert world.rests()

    @EACH
    @pytest.mark.parametrize("jump", [(1.2, 0.0), (0.0, -1.2)])
    def test_a_rover_that_is_outside_its_area_is_stopped(
        self, persona: Persona, jump: tuple[float, float]
    ) -> None:
        world = ProbeWorld(drive=True, persona=persona)
        world.until_moving()
        world.fault(Faults(position_jump=jump))
        jumped_at = world.now
        world.finish()
        assert world.driven.ended.startswith("at the edge of the area")
        assert max(at for at, message in world.setpoints() if is_moving(message)) < jumped_at + 0.15
        assert world.rests()

    @EACH
    def test_hold_by_somebody_else_ends_it(self, persona: Persona) -> None:
        world = ProbeWorld(drive=True, persona=persona)
        world.until_moving()
        world.rover.autopilot.operator_mode(Mode.HOLD, now=world.now)
        world.finish()
        assert "its mode changed to" in world.driven.ended
        assert world.rests()

    @EACH
    def test_a_person_who_takes_it_by_hand_has_it(self, persona: Persona) -> None:
        world = ProbeWorld(drive=True, persona=persona)
        world.until_moving()
        world.rover.autopilot.operator_mode(Mode.MANUAL, now=world.now)
        taken_at = world.now
        world.finish()
        assert "its mode changed to" in world.driven.ended
        assert (world.rover.autopilot.mode, world.rover.autopilot.armed) == (Mode.MANUAL, True)
        later = [
            message.command
            for at, message in world.party.sent
            if at > taken_at and isinstance(message, m.CommandLong)
        ]
        assert MavCmd.DO_SET_MODE not in later
        assert MavCmd.COMPONENT_ARM_DISARM not in later

    def test_disarming_by_somebody_else_ends_it(self) -> None:
        world = ProbeWorld(drive=True)
        world.until_moving()
        world.rover.autopilot.operator_arm(False, now=world.now)
        world.finish()
        assert world.driven.ended == "the rover was disarmed"
        assert world.rests()

    def test_setpoints_of_somebody_else_end_it(self) -> None:
        world = ProbeWorld(drive=True)
        world.until_moving()
        setpoint = m.SetPositionTargetLocalNed(0, 1, 1, 8, 0x05C7, *[0.0] * 11)
        world.somebody_sends(setpoint, Address(245, 190))
        world.finish()
        assert world.driven.ended == "245/190 sends setpoints: the rover is being driven"
        assert world.rests()

    def test_a_machine_that_stood_still_does_not_drive_on_what_it_finds_then(self) -> None:
        world = ProbeWorld(drive=True)
        world.until_moving()
        world.leave(world.party)
        world.run(1.0)
        world.join(world.party)
        woken_at = world.now
        world.finish()
        assert world.driven.ended.startswith("a setpoint was 1.")
        late = [at for at, message in world.setpoints() if is_moving(message) and at >= woken_at]
        assert (late, world.rests()) == ([], True)

    def test_a_rover_that_is_armed_already_is_nobody_elses_to_drive(self) -> None:
        world = ProbeWorld(drive=True)
        world.rover.autopilot.operator_arm(True, now=world.now)
        world.finish()
        assert world.driven.ended == "not driven: it is armed already"
        assert (world.setpoints(), world.rover.autopilot.armed) == ([], True)

    @pytest.mark.parametrize("missing", [POSITION, ATTITUDE])
    def test_a_rover_that_does_not_say_where_it_is_is_not_driven(self, missing: int) -> None:
        world = ProbeWorld(drive=True)
        world.fault(Faults(withheld=frozenset({missing})))
        world.finish()
        assert world.driven.ended == "not driven: its position is unknown or too old"
        assert world.setpoints() == []

    def test_a_rover_that_says_it_too_seldom_is_not_driven(self) -> None:
        slow = replace(ARDUPILOT, streams=replace(ARDUPILOT.streams, shortest_interval=0.5))
        world = ProbeWorld(drive=True, persona=slow)
        world.finish()
        assert world.driven.ended.startswith("not driven: ")
        assert world.setpoints() == []


class TestLoss:
    def test_a_rover_whose_failsafe_is_off_is_not_left_alone_while_it_drives(self) -> None:
        world = ProbeWorld(drive=True, persona=PX4)
        world.rover.autopilot.parameters["COM_OBL_RC_ACT"] = -1
        found = world.finish().findings
        assert (world.driven.ended, world.driven.loss_stop) == ("", "")
        why = "COM_OBL_RC_ACT is -1: nothing, it keeps driving"
        assert world.driven.loss_note == f"not tried: {why}"
        line = next(each for each in lines_of(found) if each.topic == "without setpoints")
        assert line.mark is Mark.BAD
        times = [at for at, _ in world.setpoints()]
        assert max(later - earlier for earlier, later in pairwise(times)) < 0.2

    def test_nor_is_one_that_would_drive_home(self) -> None:
        world = ProbeWorld(drive=True, persona=PX4)
        world.rover.autopilot.parameters["COM_OBL_RC_ACT"] = 3
        world.finish()
        why = "COM_OBL_RC_ACT is 3: Return, it drives home"
        assert world.driven.loss_note == f"not tried: {why}"
        assert (world.driven.loss_stop, world.rests()) == ("", True)

    def test_one_that_drives_on_in_spite_of_what_it_says_is_stopped_and_found_out(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("rover_sim.guided.SETPOINT_TIMEOUT", 1e9)
        world = ProbeWorld(drive=True)
        found = world.finish().findings
        assert world.driven.loss_stop == "no"
        assert world.driven.ended
        assert (world.rests(), world.farthest < BOX) == (True, True)
        assert profile_of(found, probed="2026-11-21").loss_stop == "no"


class TestInterrupt:
    @TWO
    @pytest.mark.parametrize("after", [1.0, 7.0, 12.0, 15.0, 17.5, 20.0, 22.5, 25.0])
    def test_whenever_it_is_ended_the_rover_comes_to_rest(
        self, persona: Persona, after: float
    ) -> None:
        world = ProbeWorld(drive=True, persona=persona)
        world.run(after)
        control = world.probe.talk.control
        was_driving = control is not None and control.is_engaged
        asked_at = world.now
        world.probe.interrupt("ended by SIGINT", now=world.now)
        probe = world.finish()
        assert isinstance(probe.error, Interrupted)
        assert world.now < asked_at + 8.0
        assert not any(is_moving(each) for at, each in world.setpoints() if at > asked_at)
        assert world.stands()
        assert not world.rover.autopilot.armed
        if was_driving:
            assert world.rests()
            assert probe.findings.drive is not None
            assert probe.findings.drive.ended == "ended by SIGINT"

    @EACH
    def test_in_the_moment_of_arming_too(self, persona: Persona) -> None:
        world = ProbeWorld(drive=True, persona=persona)
        assert world.run_until(lambda: world.rover.autopilot.armed, within=30)
        assert not world.probe.talk.armed, "it is armed, and that is not seen yet"
        world.probe.interrupt("ended by SIGINT", now=world.now)
        world.finish()
        assert (world.rests(), world.farthest) == (True, 0.0)

    def test_zero_leaves_at_once_and_hold_with_it(self) -> None:
        world = ProbeWorld(drive=True)
        world.until_moving()
        mark = len(world.party.sent)
        world.probe.interrupt("ended by SIGINT", now=world.now)
        sent = world.probe.take_packets()
        messages = [Decoder().decode(packet) for data in sent for packet in split_datagram(data)]
        assert isinstance(messages[0], m.SetPositionTargetLocalNed)
        assert not is_moving(messages[0])
        assert isinstance(messages[1], m.CommandLong)
        assert (messages[1].command, messages[1].param2) == (MavCmd.DO_SET_MODE, 4)
        assert (len(messages), len(world.party.sent)) == (2, mark)
        world.finish()
        assert world.rests()

    @EACH
    def test_the_last_words_stop_it_where_nothing_else_can_be_done(self, persona: Persona) -> None:
        world = ProbeWorld(drive=True, persona=persona)
        world.until_moving()
        words = world.probe.emergency_stop_packets()
        world.leave(world.party)
        link = world.net.link("last", peers=("rover1",))
        for data in words:
            link.send("rover1", data)
        world.run(2.0)
        assert world.rests()

    def test_there_are_none_before_it_drives_and_after(self) -> None:
        world = ProbeWorld(drive=True)
        world.run(5.0)
        assert world.probe.emergency_stop_packets() == []
        world.finish()
        assert world.probe.emergency_stop_packets() == []


class TestCar:
    """One that steers as a car, of which its parameters tell."""

    def world(self) -> ProbeWorld:
        outputs = (Parameter("SERVO1_FUNCTION", 26, INT16), Parameter("SERVO3_FUNCTION", 70, INT16))
        persona = replace(ARDUPILOT, parameters=(*ARDUPILOT.parameters, *outputs))
        return ProbeWorld(drive=True, persona=persona, body=partial(Car, radius=1.2))

    def test_it_is_driven_in_a_larger_area_and_gets_a_profile_that_says_so(self) -> None:
        world = self.world()
        found = world.finish().findings
        assert (world.driven.ended, world.rests()) == ("", True)
        profile = profile_of(found, probed="2026-11-22T10:00:00Z")
        assert (profile.turning, profile.yaw_rate, profile.reverse) == (
            "steered",
            "honoured",
            "yes",
        )
        assert world.farthest < 4.0

    def test_it_is_not_asked_to_turn_on_the_spot(self) -> None:
        world = self.world()
        world.finish()
        assert not [each for _, each in world.setpoints() if each.vx == 0.0 and each.yaw_rate]


def test_a_rover_that_says_at_rest_that_it_creeps_is_driven_all_the_same(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Real ones say up to 0.07 m/s while they stand."""
    receive = MotionMonitor.receive

    def noisy(self: MotionMonitor, message: Any, *, now: float) -> None:
        if isinstance(message, m.LocalPositionNed):
            message.vx += 0.05
            message.vy += 0.05
        receive(self, message, now=now)

    monkeypatch.setattr(MotionMonitor, "receive", noisy)
    world = ProbeWorld(drive=True)
    world.finish()
    assert (world.driven.ended, world.rests()) == ("", True)
