"""The probe and a rover in virtual time: what it finds, and that it ends well in any case."""

import json
from dataclasses import replace
from functools import partial
from itertools import pairwise
from math import nan
from typing import Any

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Encoder
from mav_tasks.mavlink.enums import MavAutopilot, MavCmd, MavState, MavType
from mav_tasks.probe.findings import Drive, Findings, Rate
from mav_tasks.probe.probe import Interrupted, Options
from mav_tasks.probe.profile import profile_of, why_none
from mav_tasks.probe.report import Mark, as_json, lines_of
from rover_sim.actuators import Actuator
from rover_sim.body import Pose
from rover_sim.faults import Faults
from rover_sim.parameters import INT16, Parameter
from rover_sim.personas import ARDUPILOT, GENERIC, PX4, Mode, Persona
from tests.kit.car import Car
from tests.kit.probing import BOX, ProbeWorld, is_moving

MAKES = (ARDUPILOT, PX4, GENERIC)  # a generic one is spoken to as a PX4
EACH = pytest.mark.parametrize("persona", MAKES, ids=lambda p: p.name)
SLOW = replace(ARDUPILOT, streams=replace(ARDUPILOT.streams, shortest_interval=0.5))
OTHER = replace(GENERIC, autopilot=MavAutopilot.INVALID)
STATION = m.Heartbeat(MavType.GCS, MavAutopilot.INVALID, 0, 0, MavState.ACTIVE, 3)
COMPUTER = m.Heartbeat(MavType.ONBOARD_CONTROLLER, MavAutopilot.INVALID, 0, 0, MavState.ACTIVE, 3)
SETPOINT = m.SetPositionTargetLocalNed(0, 1, 1, 8, 0x05C7, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0)
QUEUE = m.TaskQueueStatus(0, 1, 0, 1, 1000, [0] * 14, 0, 0)
ASKED = {
    MavCmd.REQUEST_MESSAGE,
    MavCmd.GET_MESSAGE_INTERVAL,
    MavCmd.SET_MESSAGE_INTERVAL,
    MavCmd.RUN_PREARM_CHECKS,
}


def moving_at(world: ProbeWorld) -> list[float]:
    """When it sent setpoints that move the rover."""
    return [at for at, message in world.setpoints() if is_moving(message)]


def marks_of(world: ProbeWorld) -> dict[str, tuple[Mark, str]]:
    return {line.topic: (line.mark, line.words) for line in lines_of(world.probe.findings)}


def attitudes(world: ProbeWorld) -> int:
    """How often the rover says its attitude in two seconds."""
    link = world.net.link(f"watch {world.now}", peers=("rover1",))
    link.send("rover1", Encoder(Address(245, 190)).encode(STATION))
    world.run(2.0)
    return sum(data[7] == m.Attitude.id for _, data in link.receive(len(link.arrived)))


# without leave to drive


@EACH
def test_it_finds_who_it_is_and_changes_and_moves_nothing(persona: Persona) -> None:
    world = ProbeWorld(persona=persona)
    mode = world.rover.autopilot.mode
    found = world.finish().findings
    assert (found.system_id, found.autopilot, found.is_rover) == (1, persona.name, True)
    assert (found.uid, found.mission_items, found.rates_given_back) == ("1", 0, "as before")
    assert found.firmware.startswith({"ardupilot": "4.6.3", "px4": "1.17"}.get(persona.name, "1."))
    assert found.heartbeat_rate == pytest.approx(1.0, abs=0.05)
    granted = {rate.name: rate.granted for rate in found.rates}
    assert granted["LOCAL_POSITION_NED"] == pytest.approx(25, abs=1)
    assert granted["ATTITUDE"] == pytest.approx(25, abs=1)
    assert {command for command, _ in world.commands()} <= ASKED
    forbidden = m.ParamSet | m.SetMode | m.SetPositionTargetLocalNed
    assert not [each for _, each in world.party.sent if isinstance(each, forbidden)]
    assert (world.rover.autopilot.mode, world.rover.autopilot.armed) == (mode, False)
    assert world.farthest == 0.0
    assert why_none(found) == "only --drive measures one"
    assert marks_of(world)["driving"] == (Mark.PLAIN, "not tried: needs --drive")


def test_parameters_are_read_as_their_make_writes_them() -> None:
    ardupilot = ProbeWorld()
    ardupilot.rover.autopilot.parameters["FS_GCS_ENABLE"] = 1
    ardupilot.rover.autopilot.parameters["SYSID_ENFORCE"] = 1
    found = ardupilot.finish().findings
    assert (found.parameters["FS_GCS_ENABLE"], found.parameters["SYSID_MYGCS"]) == (1, 255)
    assert "FS_CRASH_CHECK" in found.missing_parameters
    marks = marks_of(ardupilot)
    assert marks["FS_GCS_ENABLE"][0] is marks["SYSID_ENFORCE"][0] is Mark.WARNING
    px4 = ProbeWorld(persona=PX4)
    px4.rover.autopilot.parameters["COM_OBL_RC_ACT"] = -1
    px4.rover.autopilot.parameters["COM_OF_LOSS_T"] = 2.5
    found = px4.finish().findings
    assert (found.parameters["COM_OBL_RC_ACT"], found.parameters["COM_OF_LOSS_T"]) == (-1, 2.5)
    assert found.loss_by_parameters == (
        "keeps moving when setpoints stop: COM_OBL_RC_ACT is -1: nothing, it keeps driving"
    )
    found.parameters["COM_OF_LOSS_T"] = nan
    text = json.dumps(as_json(found), allow_nan=False)
    assert json.loads(text)["parameters"]["COM_OF_LOSS_T"] is None


def test_who_else_drives_it_is_left_alone() -> None:
    """Also a server that the probe has dialled instead of the rover."""
    for said, words in (
        ([(COMPUTER, (1, 191)), (QUEUE, (1, 191))], "task server 1/191 is on this link: probe on"),
        ([(STATION, (250, 192))], "task server 250/192 is on this link: end it first"),
        ([(m.CommandAck(400, 2, 0, 108, 245, 190), (1, 1))], "task server 1/1 is on this link"),
        ([(STATION, (250, 191))], "task server 250/191 is on this link: end it first"),
        ([(SETPOINT, (245, 190))], "245/190 sends setpoints: the rover is being driven"),
    ):
        world = ProbeWorld(drive=True)
        world.run(1.5)
        for message, source in said:
            world.somebody_sends(message, Address(*source))
            world.run(2.5)  # it is asked what it is
        assert str(world.finish().error).startswith(words)
        assert (world.setpoints(), world.rests()) == ([], False)


def test_the_rates_that_it_asked_for_are_given_back_if_it_ends_before_its_time() -> None:
    world = ProbeWorld(persona=PX4)
    before = attitudes(world)
    assert world.run_until(lambda: len(world.commands()) > 8, within=10)
    world.run(1.0)
    assert attitudes(world) < 0.8 * before
    world.probe.interrupt("ended", now=world.now)
    world.finish()
    assert attitudes(world) == pytest.approx(before, abs=4)


def test_what_a_rover_does_not_tell_is_unknown() -> None:
    quiet: dict[Any, tuple[str, str]] = {
        m.AutopilotVersion: ("firmware", "unknown"),
        m.MissionCount: ("mission on board", "unknown"),
        m.CommandAck: ("rates restored", "as before"),
        m.SysStatus: ("arming checks", "unknown"),
        m.MessageInterval: ("rates restored", "to the default, because the rover did not report"),
        m.ParamValue: ("without setpoints", "does not report whether it stops"),
    }
    for kind, (topic, words) in quiet.items():
        world = ProbeWorld(persona=PX4)
        world.fault(Faults(withheld=frozenset({kind.id})))
        world.run(1.0)
        world.somebody_sends(STATION, Address(255, 190))
        world.somebody_sends(m.Heartbeat(30, 8, 0, 0, 4, 3), Address(1, 154))  # a camera
        assert world.finish().error is None
        assert marks_of(world)[topic][1].startswith(words), kind
        assert marks_of(world)["also connected"][1] == "ground station 255/190"
    world = ProbeWorld(persona=PX4, options=Options(set_failsafe=True))
    world.fault(Faults(withheld=frozenset({m.ParamValue.id})))
    assert "does not report what it does" in str(world.finish().error)
    for fault, words in (
        (Faults(outputs_frozen=frozenset(Actuator)), "the rover does not follow BODY_NED"),
        (Faults(heading_frozen=True), "the rover does not reach 0.30 m/s"),
    ):
        world = ProbeWorld(drive=True)
        world.fault(fault)
        world.finish()
        assert world.driven.ended.startswith(words)
        assert world.rests()


#: findings -> lines of the report: mark, topic and words
REPORTS = (
    (
        Findings(),
        """!!rover: 0: unsupported autopilot, type 0, not a rover
        !firmware: unknown
        arming checks: unknown
        mission on board: unknown
        !without setpoints: unknown
        driving: not tried: needs --drive""",
    ),
    (
        Findings(
            others=["task server 1/191"],
            rates=[Rate("ATTITUDE", 25.0, 1.0, "DENIED", 1.0), Rate("SYS_STATUS", 1.0, 1.0)],
            rates_given_back="no answer",
            prearm_texts=["PreArm: GPS", "PreArm: compass"],
            mission_items=3,
            capabilities=8,
            failsafe_set="COM_OBL_RC_ACT 0, now 5",
            turning="steered",
            turning_radius=1.25,
            parameters={"SYSID_ENFORCE": 1.0},
            drive=Drive(loss_stop="no", turned_standing_deg=9.0, speed=None),
        ),
        """!also connected: task server 1/191
        !ATTITUDE: 1.0 Hz of 25.0 requested, 1.0 unasked; answer: DENIED
        SYS_STATUS: 1.0 Hz unasked
        !rates restored: no answer
        !arming checks: PreArm: GPS; PreArm: compass
        !mission on board: 3 items: its mission mode would drive them, unseen by the server
        takes COMMAND_INT: yes
        takes local setpoints: not reported
        okloss failsafe: COM_OBL_RC_ACT 0, now 5
        turns: like a car, according to its parameters, minimum radius 1.2 m
        !SYSID_ENFORCE: 1; the server is 250
        okdriving: completed
        !standing: turned by 9 deg in 2 s of zero setpoints
        !!setpoints stop: does NOT stop by itself; it keeps driving""",
    ),
    (
        Findings(
            drive=Drive(
                ended="the rover was disarmed",
                left="Hold, ARMED",
                hold="no",
                refused=["BODY_NED 0x05C7"],
                loss_stop="yes",
                loss_distance=0.25,
                loss_speed=0.3,
            )
        ),
        """!!driving: the rover was disarmed
        !!left in: Hold, ARMED
        !!HOLD: NOT seen
        setpoint: BODY_NED 0x05C7: not followed
        oksetpoints stop: stops by itself, 0.25 m further, from 0.30 m/s""",
    ),
)


def test_the_report_marks_what_is_not_as_it_must_be() -> None:
    for found, expected in REPORTS:
        lines = [f"{line.mark.value}{line.topic}: {line.words}" for line in lines_of(found)]
        why = why_none(found)
        assert why in ("only --drive measures one", "the rover does not report its firmware")
        assert {each.strip() for each in expected.splitlines()} - set(lines) == set(), lines


# a loss failsafe is set

BY_DEFAULT = {"COM_OBL_RC_ACT": 0, "NAV_RCL_ACT": 2, "COM_OF_LOSS_T": 1.0, "NAV_DLL_ACT": 0}


def test_a_loss_failsafe_is_set_where_it_is_wrong_and_nothing_else_is_changed() -> None:
    stands = "stops when setpoints stop: Hold"
    for persona, wrong, written, done, then in (
        (PX4, {}, ["COM_OBL_RC_ACT"], "COM_OBL_RC_ACT 0, now 5", stands),
        (GENERIC, {}, ["COM_OBL_RC_ACT"], "COM_OBL_RC_ACT 0, now 5", stands),
        (
            *(PX4, {"COM_OBL_RC_ACT": 7, "COM_OF_LOSS_T": 60, "NAV_DLL_ACT": 2}),
            *(["COM_OF_LOSS_T", "NAV_DLL_ACT"], "", "stops when setpoints stop: motors off"),
        ),
        (PX4, {"COM_OBL_RC_ACT": 5}, [], "nothing to change", stands),
        (ARDUPILOT, None, [], "nothing to set", "stops 3 s after the last setpoint, as ArduPilot"),
    ):
        world = ProbeWorld(persona=persona, options=Options(set_failsafe=True))
        for name, value in {} if wrong is None else (BY_DEFAULT | wrong).items():
            world.rover.autopilot.parameters[name] = value
        found = world.finish().findings
        sets = [each for _, each in world.party.sent if isinstance(each, m.ParamSet)]
        assert [str(each.param_id).rstrip("\0") for each in sets] == written
        assert done in found.failsafe_set
        assert found.loss_by_parameters.startswith(then)
        assert (world.setpoints(), world.rover.autopilot.armed) == ([], False)


# driven


@EACH
def test_all_is_measured_inside_its_area_and_the_rover_is_left_at_rest(persona: Persona) -> None:
    world = ProbeWorld(drive=True, persona=persona, start=Pose(north=5.0, east=-3.0, yaw=2.5))
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
    assert 0.02 < driven.stopping_distance < 0.15  # a PX4 brakes at once
    assert driven.loss_stop == "yes"
    assert driven.setpoint_timeout == pytest.approx(3.1 if turns else 1.1, abs=0.2)
    assert 0.1 < driven.farthest < BOX
    assert world.farthest < BOX
    # zeros come first and last, the mode before arming; one silence is meant
    moves = [is_moving(message) for _, message in world.setpoints()]
    assert not moves[0]
    if turns:
        assert moves[-3:] == [False] * 3
        orders = [each for each in world.commands() if each[0] in (176, 400)]
        assert [order for order, _ in orders][:2] == [176, 400]
        assert orders[-1] == (400, 0.0)
    gaps = [later - earlier for (earlier, _), (later, _) in pairwise(world.setpoints())]
    assert len([gap for gap in gaps if gap > 0.2]) == 1


def test_a_car_is_driven_in_a_larger_area_and_not_asked_to_turn_on_the_spot() -> None:
    outputs = (Parameter("SERVO1_FUNCTION", 26, INT16), Parameter("SERVO3_FUNCTION", 70, INT16))
    persona = replace(ARDUPILOT, parameters=(*ARDUPILOT.parameters, *outputs))
    world = ProbeWorld(drive=True, persona=persona, body=partial(Car, radius=1.2))
    profile = profile_of(world.finish().findings, probed="2026-11-22T10:00:00Z")
    assert (world.driven.ended, world.rests()) == ("", True)
    assert [profile.turning, profile.yaw_rate, profile.reverse] == ["steered", "honoured", "yes"]
    assert (world.farthest < 4.0, why_none(world.probe.findings)) == (True, "")
    assert not [each for _, each in world.setpoints() if each.vx == 0.0 and each.yaw_rate]


def test_what_cannot_be_driven_safely_is_not_driven() -> None:
    withheld = [Faults(withheld=frozenset({kind.id})) for kind in (m.LocalPositionNed, m.Attitude)]
    unknown = "not driven: its position is unknown or too old"
    other = "not driven: on-board computer 1/100 may drive the rover: end it first"
    for persona, fault, said, words in (
        (ARDUPILOT, withheld[0], None, unknown),
        (ARDUPILOT, withheld[1], None, unknown),
        (SLOW, Faults(), None, "not driven: "),
        (
            OTHER,
            Faults(),
            None,
            "not driven: the server does not drive",
        ),
        (ARDUPILOT, Faults(), (COMPUTER, (1, 100)), other),
        (
            *(ARDUPILOT, Faults(), (m.CommandAck(400, 0, 0, 0, 245, 190), (1, 1))),
            "not driven: 245/190 also commands the rover",
        ),
    ):
        world = ProbeWorld(drive=True, persona=persona)
        world.fault(fault)
        world.run(2.0)
        if said is not None:
            world.somebody_sends(said[0], Address(*said[1]))
        world.finish()
        assert world.driven.ended.startswith(words)
        assert (world.probe.error, world.setpoints()) == (None, [])
    world = ProbeWorld(drive=True)
    world.rover.autopilot.operator_arm(True, now=world.now)
    world.finish()
    assert world.driven.ended == "not driven: it is armed already"
    assert (world.setpoints(), world.rover.autopilot.armed) == ([], True)


@EACH
def test_a_rover_that_refuses_is_not_moved_and_its_words_are_told(persona: Persona) -> None:
    for fault, ended in (
        (Faults(refuse_arm=True), "arming refused"),
        (Faults(refuse_mode=True), ""),
    ):
        world = ProbeWorld(drive=True, persona=persona)
        world.fault(fault)
        world.finish()
        assert "refused" in world.driven.ended
        assert world.driven.ended.startswith(ended)
        assert (moving_at(world), world.rover.autopilot.armed) == ([], False)
        assert world.farthest == 0.0
        assert why_none(world.probe.findings) == "the drive was not completed"
        assert marks_of(world)["driving"][0] is Mark.BAD


@EACH
def test_what_goes_wrong_midway_stops_it_soon_and_it_rests(persona: Persona) -> None:
    silence, edge = "no position for 0.3", "at the edge of the area"
    for fault, within, words in (
        (Faults(silent=True), 0.45, silence),
        (Faults(silent=True, deaf=True), 0.45, silence),
        (Faults(position_frozen=True), 0.45, silence),
        (Faults(position_jump=(1.2, 0.0)), 0.15, edge),
        (Faults(position_jump=(0.0, -1.2)), 0.15, edge),
    ):
        world = ProbeWorld(drive=True, persona=persona)
        world.until_moving()
        world.fault(fault)
        began = world.now
        world.finish()
        assert world.driven.ended.startswith(words), fault
        assert max(moving_at(world)) < began + within, fault
        world.run(4.0)
        assert (world.stands(), world.farthest < BOX) == (True, True)
        assert world.rests() is not fault.deaf  # a dead link leaves it to its own time-out


@EACH
def test_who_takes_the_rover_midway_has_it(persona: Persona) -> None:
    for mode, armed in ((Mode.HOLD, False), (Mode.MANUAL, True)):
        world = ProbeWorld(drive=True, persona=persona)
        world.until_moving()
        world.rover.autopilot.operator_mode(mode, now=world.now)
        taken_at = world.now
        world.finish()
        assert "its mode changed to" in world.driven.ended
        assert (world.rover.autopilot.mode, world.rover.autopilot.armed) == (mode, armed)
        later = [each for at, each in world.party.sent if at > taken_at]
        orders = {each.command for each in later if isinstance(each, m.CommandLong)}
        assert mode is Mode.HOLD or not orders & {MavCmd.DO_SET_MODE, MavCmd.COMPONENT_ARM_DISARM}


def test_disarming_or_setpoints_of_somebody_else_end_it() -> None:
    for words in ("the rover was disarmed", "245/190 sends setpoints: the rover is being driven"):
        world = ProbeWorld(drive=True)
        world.until_moving()
        if "disarmed" in words:
            world.rover.autopilot.operator_arm(False, now=world.now)
        else:
            world.somebody_sends(SETPOINT, Address(245, 190))
        world.finish()
        assert world.driven.ended == words
        assert world.run_until(world.rests, within=3.0)  # disarmed, it rolls on for a moment


def test_a_machine_that_stood_still_does_not_drive_on_what_it_finds_then() -> None:
    world = ProbeWorld(drive=True)
    world.until_moving()
    world.leave(world.party)
    world.run(1.0)
    world.join(world.party)
    woken_at = world.now
    world.finish()
    assert world.driven.ended.startswith("a setpoint was 1.")
    assert (max(moving_at(world)) < woken_at, world.rests()) == (True, True)


def test_a_rover_that_would_not_stand_by_itself_is_not_left_alone_while_it_drives() -> None:
    for value, why in ((-1, "-1: nothing, it keeps driving"), (3, "3: Return, it drives home")):
        world = ProbeWorld(drive=True, persona=PX4)
        world.rover.autopilot.parameters["COM_OBL_RC_ACT"] = value
        world.finish()
        assert (world.driven.ended, world.driven.loss_stop, world.rests()) == ("", "", True)
        assert world.driven.loss_note == f"not tried: COM_OBL_RC_ACT is {why}"
        assert marks_of(world)["without setpoints"][0] is Mark.BAD
        times = [at for at, _ in world.setpoints()]
        assert max(later - earlier for earlier, later in pairwise(times)) < 0.2


@EACH
def test_whenever_it_is_ended_the_rover_comes_to_rest(persona: Persona) -> None:
    for after in (1.0, 7.0, 12.0, 15.0, 17.5, 20.0, 22.5, 25.0, None):
        world = ProbeWorld(drive=True, persona=persona)
        if after is None:  # in the moment of arming, which is not seen yet
            assert world.run_until(lambda: world.rover.autopilot.armed, within=30)  # noqa: B023
        else:
            world.run(after)
        drives = bool(world.setpoints()) and not world.probe.is_over
        before, asked_at = len(world.party.sent), world.now
        for _ in range(2):
            world.probe.interrupt("ended by SIGINT", now=world.now)
        probe = world.finish()
        assert isinstance(probe.error, Interrupted)
        assert world.now < asked_at + 8.0
        assert not [at for at in moving_at(world) if at > asked_at]
        assert (world.stands(), world.rover.autopilot.armed) == (True, False)
        if drives:
            assert world.rests()
            first = {each.get_type() for _, each in world.party.sent[before : before + 2]}
            zero_and_hold = {"SET_POSITION_TARGET_LOCAL_NED", "COMMAND_LONG"}
            assert first == zero_and_hold or persona is not ARDUPILOT
            assert probe.findings.drive is not None
            assert probe.findings.drive.ended == "ended by SIGINT"


@EACH
def test_the_last_words_stop_it_where_nothing_else_can_be_done(persona: Persona) -> None:
    world = ProbeWorld(drive=True, persona=persona)
    assert world.probe.emergency_stop_packets() == []
    world.until_moving()
    words = world.probe.emergency_stop_packets()
    world.leave(world.party)
    link = world.net.link("last", peers=("rover1",))
    for data in words:
        link.send("rover1", data)
    world.run(2.0)
    assert world.rests()
