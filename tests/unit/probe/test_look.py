"""Asking without driving: what is found, and that nothing is changed or moved."""

from dataclasses import replace

import pytest

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.enums import MavAutopilot, MavCmd, MavState, MavType
from mav_tasks.probe.probe import NothingHeard, Occupied
from mav_tasks.probe.profile import why_none
from mav_tasks.probe.report import Mark, lines_of
from rover_sim.faults import Faults
from rover_sim.personas import ARDUPILOT, GENERIC, PX4, Persona
from tests.kit.probing import ProbeWorld

EACH = pytest.mark.parametrize("persona", [ARDUPILOT, PX4, GENERIC], ids=lambda p: p.name)
ASKED = {
    MavCmd.REQUEST_MESSAGE,
    MavCmd.GET_MESSAGE_INTERVAL,
    MavCmd.SET_MESSAGE_INTERVAL,
    MavCmd.RUN_PREARM_CHECKS,
}
STATION = m.Heartbeat(MavType.GCS, MavAutopilot.INVALID, 0, 0, MavState.ACTIVE, 3)
COMPUTER = m.Heartbeat(MavType.ONBOARD_CONTROLLER, MavAutopilot.INVALID, 0, 0, MavState.ACTIVE, 3)


@EACH
def test_without_leave_it_is_neither_armed_nor_moved_nor_changed(persona: Persona) -> None:
    world = ProbeWorld(persona=persona)
    mode = world.rover.autopilot.mode
    intervals = dict(world.rover.autopilot._streams._intervals)
    parameters = dict(world.rover.autopilot.parameters._values)
    world.finish()
    assert world.setpoints() == []
    assert {command for command, _ in world.commands()} <= ASKED
    assert not [each for _, each in world.party.sent if isinstance(each, m.ParamSet | m.SetMode)]
    assert (world.rover.autopilot.mode, world.rover.autopilot.armed) == (mode, False)
    assert dict(world.rover.autopilot._streams._intervals) == pytest.approx(intervals)
    assert dict(world.rover.autopilot.parameters._values) == parameters
    assert world.farthest == 0.0
    assert why_none(world.probe.findings) == "only --drive measures one"


@EACH
def test_it_is_found_who_it_is_and_what_it_grants(persona: Persona) -> None:
    world = ProbeWorld(persona=persona)
    found = world.finish().findings
    assert (found.system_id, found.autopilot, found.is_rover) == (1, persona.name, True)
    assert found.uid == "1"
    assert found.firmware.startswith(
        {"ardupilot": "4.6.3", "px4": "1.17.0"}.get(persona.name, "1.")
    )
    assert found.heartbeat_rate == pytest.approx(1.0, abs=0.05)
    granted = {rate.name: rate.granted for rate in found.rates}
    assert granted["LOCAL_POSITION_NED"] == pytest.approx(25, abs=1)
    assert granted["ATTITUDE"] == pytest.approx(25, abs=1)
    assert (found.mission_items, found.rates_given_back) == (0, "as before")


def test_a_rate_that_is_refused_is_told() -> None:
    slow = replace(ARDUPILOT, streams=replace(ARDUPILOT.streams, shortest_interval=0.5))
    found = ProbeWorld(persona=slow).finish().findings
    rate = next(each for each in found.rates if each.name == "ATTITUDE")
    assert rate.answer == "DENIED"
    assert rate.granted == pytest.approx(1.0, abs=0.4)
    line = next(each for each in lines_of(found) if each.topic == "ATTITUDE")
    assert (line.mark, "DENIED" in line.words) == (Mark.WARNING, True)


def test_parameters_are_read_as_their_make_writes_them() -> None:
    ardupilot = ProbeWorld()
    ardupilot.rover.autopilot.parameters["FS_GCS_ENABLE"] = 1
    ardupilot.rover.autopilot.parameters["SYSID_ENFORCE"] = 1
    found = ardupilot.finish().findings
    assert (found.parameters["FS_GCS_ENABLE"], found.parameters["SYSID_MYGCS"]) == (1, 255)
    assert "FS_CRASH_CHECK" in found.missing_parameters
    marks = {line.topic: line.mark for line in lines_of(found)}
    assert (marks["FS_GCS_ENABLE"], marks["SYSID_ENFORCE"]) == (Mark.WARNING, Mark.WARNING)
    px4 = ProbeWorld(persona=PX4)
    px4.rover.autopilot.parameters["COM_OBL_RC_ACT"] = -1
    px4.rover.autopilot.parameters["COM_OF_LOSS_T"] = 2.5
    found = px4.finish().findings
    assert (found.parameters["COM_OBL_RC_ACT"], found.parameters["COM_OF_LOSS_T"]) == (-1, 2.5)
    assert found.loss_by_parameters == (
        "keeps moving when setpoints stop: COM_OBL_RC_ACT is -1: nothing, it keeps driving"
    )


def test_a_mission_on_board_is_counted_without_home() -> None:
    world = ProbeWorld()
    sent: list[m.Message] = [m.MissionCount(1, 1, 3, 0)]
    sent += [m.MissionItemInt(1, 1, n, 6, 16, 0, 1, 0, 0, 0, 0, 10, 10, 0, 0) for n in range(3)]
    for message in sent:
        world.rover.autopilot.handle(message, Address(255, 190), now=world.now)
        world.run(0.2)
    found = world.finish().findings
    assert found.mission_items == 2
    line = next(each for each in lines_of(found) if each.topic == "mission on board")
    assert line.mark is Mark.WARNING


def test_nobody_there_is_told() -> None:
    world = ProbeWorld()
    world.fault(Faults(silent=True))
    error = world.finish().error
    assert isinstance(error, NothingHeard)
    assert str(error) == "no heartbeat from a rover within 10 s"


def test_a_task_server_inside_the_rover_is_left_alone() -> None:
    """What a server shows to its clients: the probe has dialled the server, and not the rover."""
    world = ProbeWorld(drive=True)
    world.run(1.0)
    world.somebody_sends(COMPUTER, Address(1, 191))
    world.run(2.5)  # it is asked what it is
    counts = [0] * 14
    queue = m.TaskQueueStatus(0, 1, 0, 1, 1000, counts, 0, 0)
    world.somebody_sends(queue, Address(1, 191))
    error = world.finish().error
    assert isinstance(error, Occupied)
    assert str(error) == "task server 1/191 is on this link: probe on a direct link"
    assert world.setpoints() == []


@pytest.mark.parametrize(
    ("message", "source", "words"),
    [
        (STATION, Address(250, 191), "task server 250/191 is on this link: end it first"),
        (
            m.SetPositionTargetLocalNed(0, 1, 1, 8, 0x05C7, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0),
            Address(245, 190),
            "245/190 sends setpoints: the rover is being driven",
        ),
    ],
)
def test_who_else_drives_it_is_left_alone(message: m.Message, source: Address, words: str) -> None:
    world = ProbeWorld(drive=True)
    world.run(2.0)
    world.somebody_sends(message, source)
    assert str(world.finish().error) == words
    assert (world.setpoints(), world.rests()) == ([], False)


@pytest.mark.parametrize(
    ("message", "source", "words"),
    [
        (
            COMPUTER,
            Address(1, 100),
            "not driven: on-board computer 1/100 may drive the rover: end it first",
        ),
        (
            m.CommandAck(400, 0, 0, 0, 245, 190),
            Address(1, 1),
            "not driven: 245/190 also commands the rover",
        ),
    ],
)
def test_where_somebody_else_may_drive_it_is_asked_but_not_driven(
    message: m.Message, source: Address, words: str
) -> None:
    world = ProbeWorld(drive=True)
    world.run(2.0)
    world.somebody_sends(message, source)
    world.finish()
    assert world.driven.ended == words
    assert (world.probe.error, world.setpoints()) == (None, [])


def test_a_ground_station_that_looks_on_is_told_and_no_hindrance() -> None:
    world = ProbeWorld()
    world.run(2.0)
    world.somebody_sends(STATION, Address(255, 190))
    probe = world.finish()
    assert (probe.error, probe.findings.others) == (None, ["ground station 255/190"])
    assert probe.talk.others.why_not_drive() == ""


def test_what_the_probe_asked_for_is_given_back_if_it_ends_before_its_time() -> None:
    world = ProbeWorld()
    intervals = dict(world.rover.autopilot._streams._intervals)
    streams = world.rover.autopilot._streams
    assert world.run_until(lambda: dict(streams._intervals) != intervals, within=10)
    world.run(1.0)
    world.probe.interrupt("ended", now=world.now)
    world.finish()
    assert dict(world.rover.autopilot._streams._intervals) == intervals
