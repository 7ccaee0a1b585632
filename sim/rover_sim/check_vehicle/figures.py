"""What is measured in a drive: the figures of real rovers beside those of the simulated ones.

real.csv has the figures of the real ones, recorded in November 2026, in real time, in the same
manoeuvres: ArduPilot Rover 4.6.3 SITL, true pose from SIM_STATE; PX4 1.17.0 SITL, a kinematic
differential rover in lock-step and the Ackermann rover of its SIH. All settings at their defaults
(the differential rover: RO_SPEED_LIM 1.8, RO_MAX_THR_SPEED 2, RO_ACCEL_LIM 4, RO_DECEL_LIM 6,
RO_JERK_LIM 10, RO_YAW_RATE_LIM 250, RO_YAW_P 5), no radio, one ground station.

A dash: it did not happen or was never sent; empty: not driven; in texts # replaces a number. In
brackets is what a simulated rover may show instead, where a difference is meant or cannot be
helped: a range or a text, so that it hides no change, and ``why``.
"""

import csv
import re
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from pymavlink.dialects.v20 import development as mav

from rover_sim.check_vehicle.manoeuvres import ASK_PLACES, ASKED, Moment
from rover_sim.observing.driver import ARMED

Value = float | str | None  # None: it did not happen, or was never sent

FACTOR = 1.5  # either way, between a figure and the real one
NOTHING = "–"
STANDS = 0.03  # m/s, true speed
STANDS_FOR = 0.4  # s of standing, or up to the end of the places
STEADY_FROM = 0.6  # of a step's time: the overshoot is over
RISEN = 0.63  # of the speed that was asked
HOME_MOVED = 2.7e-6  # deg, 0.3 m; less is the estimate's noise
MODE_BEFORE = 1.5  # s: the last HEARTBEAT before the start has the first mode
HOME_BEFORE = ASK_PLACES + 0.1  # s, the same for home
PREARM = 0x10000000  # MAV_SYS_STATUS_PREARM_CHECK
REASONS = ("Arm:", "PreArm", "Arming denied", "Preflight Fail")
MODES = {
    0: "MANUAL",
    4: "HOLD",
    11: "RTL",
    15: "GUIDED",
    16: "INITIALISING",
    0x03040000: "HOLD",  # of PX4: sub mode, main mode
    0x05040000: "RTL",
    0x06040000: "LAND",
    0x00060000: "OFFBOARD",
}
GUIDED = 15


def _first(name: str, it: Moment, fits: Callable[[Any], object] = lambda _: True) -> Value:
    """Return the seconds until the first message that fits, or None."""
    return next((row.at - it.begin for row in it.heard(name) if fits(row.message)), None)


def _accepted(command: int, it: Moment, param: float) -> Value:
    """Return the seconds until a command with this parameter was accepted, or None."""
    found = (each for each in it.answers if (each.command, each.is_accepted) == (command, True))
    return next((a.asked_at + a.took - it.begin for a in found if param in a.params[:2]), None)


def _refusals(it: Moment) -> list[str]:
    arming = (each for each in it.answers if each.command == mav.MAV_CMD_COMPONENT_ARM_DISARM)
    return [str(each).partition(" after")[0] for each in arming if each.is_refused]


def _joined(texts: list[str], by: str = "; ") -> Value:
    """Return the different texts in their order, None if there are none."""
    return by.join(dict.fromkeys(texts)) or None


def _texts(it: Moment) -> list[str]:
    return [str(row.message.text).strip() for row in it.heard("STATUSTEXT")]


def _modes(it: Moment) -> list[str]:
    beats = [row.message for row in it.heard("HEARTBEAT", MODE_BEFORE)]
    names = [MODES.get(beat.custom_mode, f"mode {beat.custom_mode}") for beat in beats]
    shown = zip(names, beats, strict=True)
    return [name if beat.base_mode & ARMED else f"{name} disarmed" for name, beat in shown]


def _home_moves(it: Moment) -> Value:
    places = it.fields("HOME_POSITION", "latitude", "longitude", before=HOME_BEFORE) * 1e-7
    return "yes" if (np.abs(np.diff(places)) > HOME_MOVED).any() else "no"


def _reported(share: float, it: Moment) -> Value:
    return float(np.quantile(np.hypot(*it.fields("LOCAL_POSITION_NED", "vx", "vy")), share))


def _wandered(it: Moment) -> Value:
    places = it.fields("LOCAL_POSITION_NED", "x", "y")
    return float(np.quantile(np.hypot(*(places.T - places.mean(axis=1)).T), 0.95))


def _landed(it: Moment) -> Value:
    states = it.fields("EXTENDED_SYS_STATE", "landed_state")
    return float(states[0, -1]) if states.size else None


def _at(fits: ArrayLike) -> int | None:
    """Return the index of the first true place that fits, or None."""
    found = np.flatnonzero(fits)
    return int(found[0]) if found.size else None


def _rest(it: Moment) -> int | None:
    still = np.abs(it.speed) < STANDS
    moved = np.cumsum(~still)
    ends = np.searchsorted(it.time, it.time + STANDS_FOR).clip(max=len(moved) - 1)
    return _at(still & (moved[ends] == moved))


def _rest_of(of: str, it: Moment) -> Value:
    """Return the time or the way when it rests, None if it does not."""
    found = _rest(it)
    return None if found is None else float(getattr(it, of)[found])


def _after(fits: Callable[[Moment], ArrayLike], it: Moment) -> Value:
    """Return the seconds until the first true place that fits, None if there is none."""
    found = _at(fits(it))
    return None if found is None else float(it.time[found])


def _late(of: str, it: Moment) -> float:
    """Return the median of the last part."""
    values = getattr(it, of)
    return float(np.median(values[int(len(values) * STEADY_FROM) :]))


def _turned(it: Moment) -> float:
    return float(np.degrees(it.yaw[-1] - it.yaw[0]))


#: how each figure is measured, by its name in real.csv
FIGURES: Mapping[str, Callable[[Moment], Value]] = {
    "first LOCAL_POSITION_NED": partial(_first, "LOCAL_POSITION_NED"),
    "first GPS_GLOBAL_ORIGIN": partial(_first, "GPS_GLOBAL_ORIGIN"),
    "first HOME_POSITION": partial(_first, "HOME_POSITION"),
    "pre-arm check healthy": partial(
        _first, "SYS_STATUS", fits=lambda m: m.onboard_control_sensors_health & PREARM
    ),
    "arming accepted": partial(_accepted, mav.MAV_CMD_COMPONENT_ARM_DISARM, param=1.0),
    "GUIDED accepted": partial(_accepted, mav.MAV_CMD_DO_SET_MODE, param=GUIDED),
    "GUIDED lost again": lambda it: "yes" if _modes(it).count("MANUAL disarmed") else "no",
    "arming refused, times": lambda it: len(_refusals(it)),
    "arming refused with": lambda it: _joined(_refusals(it)),
    "reasons given": lambda it: _joined([each for each in _texts(it) if each.startswith(REASONS)]),
    "reported speed, p50": partial(_reported, 0.5),
    "reported speed, p95": partial(_reported, 0.95),
    "reported velocity, its mean": lambda it: float(
        np.hypot(*it.fields("LOCAL_POSITION_NED", "vx", "vy").mean(axis=1))
    ),
    "reported position from its mean, p95": _wandered,
    "reported yaw, standard deviation": lambda it: float(
        np.degrees(np.unwrap(it.fields("ATTITUDE", "yaw")).std())
    ),
    "landed_state": _landed,
    "home moves": _home_moves,
    "speed at the start": lambda it: float(it.speed[0]),
    "speed at the end": lambda it: float(np.median(it.speed[it.time > it.time[-1] - 1.0])),
    "steady speed": partial(_late, "along"),
    "top speed": lambda it: float(np.abs(it.speed).max()),
    "rate reached": lambda it: float(np.degrees(_late("yaw_rate", it))),
    "turned": _turned,
    "turned either way": lambda it: abs(_turned(it)),
    "way": lambda it: float(it.way[-1]),
    "stands after": partial(_rest_of, "time"),
    "stands within": partial(_rest_of, "way"),
    "slower by a tenth after": partial(_after, lambda it: it.speed < 0.9 * it.speed[0]),
    "reaches 63 % of what was asked": partial(
        _after, lambda it: it.along / ASKED[it.mark] >= RISEN
    ),
    "modes": lambda it: _joined(_modes(it), ", "),
    "texts": lambda it: _joined([re.sub(r"\d+", "#", text) for text in _texts(it)]),
}


class Row(NamedTuple):
    """One figure of a real rover, as real.csv has it."""

    mark: str
    figure: str
    unit: str
    floor: float
    real: str
    why: str

    @property
    def name(self) -> str:
        """Its manoeuvre, what it is, and its unit."""
        return f"{self.mark}: {self.figure}, {self.unit}".removesuffix(", ")

    def is_right(self, value: Value) -> bool:
        """Return whether a simulated value is near the real one, or what is allowed instead."""
        real, _, instead = self.real.partition(" [")
        least, is_range, most = instead.rstrip("]").partition("..")
        if is_near(_value(real), value, floor=self.floor):
            return True
        if is_range:
            return isinstance(value, float) and float(least) <= value <= float(most)
        return value == least


def rows_of(rover: str) -> Iterator[Row]:
    """Yield each figure that the real rover of this name has."""
    with Path(__file__).with_name("real.csv").open(encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row[rover]:
                floor, names = float(row["floor"]), (row["mark"], row["figure"], row["unit"])
                yield Row(*names, floor, row[rover], row["why"] if "[" in row[rover] else "")


def is_near(real: Value, simulated: Value, *, floor: float) -> bool:
    """Return whether two values are within a factor of 1.5, or both within ± floor."""
    if not isinstance(real, float) or not isinstance(simulated, int | float):
        return real == simulated
    if max(abs(real), abs(simulated)) <= floor or real == simulated:
        return True
    return real * simulated > 0.0 and 1.0 / FACTOR <= simulated / real <= FACTOR


def _value(text: str) -> Value:
    try:
        return float(text)
    except ValueError:
        return None if text == NOTHING else text


def shown(value: Value) -> str:
    """Return a value as real.csv has it."""
    if value is None:
        return NOTHING
    return value if isinstance(value, str) else f"{value:.3f}"
