"""The list of checks, in their order."""

from collections.abc import Callable
from typing import NamedTuple

from rover_sim.check_vehicle import (
    arming,
    commands,
    driving,
    identity,
    modes,
    parameters,
    plans,
    rates,
    telemetry,
)
from rover_sim.check_vehicle.context import Context, Options
from rover_sim.check_vehicle.conventions import WAYS, way_of
from rover_sim.check_vehicle.probe import Probe
from rover_sim.check_vehicle.report import Line, Report
from rover_sim.check_vehicle.wire import Wire

FIRST_HEARD = 10.0  # s to wait for a vehicle


class Check(NamedTuple):
    """One check, and the group of its lines."""

    group: str
    run: Callable[[Context], None]


CHECKS = (
    Check("identity", identity.check_heartbeat),
    Check("identity", identity.check_version),
    Check("telemetry", telemetry.check_telemetry),
    Check("telemetry", telemetry.check_agreement),
    Check("rates", rates.check_intervals),
    Check("commands", commands.check_answers),
    Check("commands", commands.check_addresses),
    Check("commands", commands.check_modes_list),
    Check("commands", commands.check_time),
    Check("commands", commands.check_files),
    Check("parameters", parameters.check_parameters),
    Check("plans", plans.check_plans),
    Check("modes", modes.check_modes),
    Check("arming", arming.check_arming),
    Check("driving", driving.check_driving),
    Check("packets", identity.check_packets),
)
GROUPS = tuple(dict.fromkeys(check.group for check in CHECKS))


class NothingHeard(Exception):
    """No vehicle answered; the message is one line for the user."""


def check_vehicle(
    wire: Wire,
    options: Options,
    *,
    system_id: int | None,
    show: Callable[[Line], None],
    groups: tuple[str, ...] = GROUPS,
) -> Report:
    """Run the checks of these groups in order; call ``show`` with each line at once.

    ``system_id`` None selects the first vehicle that is heard. Raise NothingHeard.
    """
    probe = Probe(wire, system_id=system_id)
    first = probe.find(FIRST_HEARD)
    if first is None:
        which = "a vehicle" if system_id is None else f"vehicle {system_id}"
        raise NothingHeard(f"no heartbeat of {which} within {FIRST_HEARD:g} s")
    way = WAYS.get(options.persona) or way_of(first.message.autopilot)
    report = Report(show)
    context = Context(probe, way, report, options, first)
    for check in CHECKS:
        if check.group in groups:
            report.group = check.group
            check.run(context)
    return report
