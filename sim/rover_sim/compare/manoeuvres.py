"""The manoeuvres: demands on a rover, their order and duration.

The reference figures come from the same manoeuvres, so that both can be compared.
"""

import math

from rover_sim.compare.driver import Driver, Step

STANDING_TIME = 40.0  # s disarmed; half as long armed
#: s from a real rover's first message to its first HEARTBEAT, by which a driver detects it. The
#: simulated ones send a HEARTBEAT first
FIRST_HEARTBEAT = 1.0
RETRY = 3.0  # s between two attempts to arm
STICK = 1750  # µs, channel 3: half forward
STILL = 0.15  # m/s reported; a slower rover counts as standing while nothing is sent
ARMED = "armed for the first time"
STANDING_DISARMED, STANDING_ARMED = "standing disarmed", "standing armed"
READYING = "arming and taking control"
HOLD, SILENCE, DISARM = "HOLD at 1 m/s", "set-points end at 1 m/s", "disarm at 1 m/s"
DISARMED, DRIVEN, DISARMED_AGAIN = "home: disarmed", "home: driven", "home: disarmed again"
THEN_ZEROS = ", then zeros"
FREE, PUSHED, RELEASED = "stick free, ", "stick forward, ", "stick released, "


SPEED_STEPS = (
    Step("0.5 m/s", 0.5),
    Step("1 m/s", 1.0),
    Step("2 m/s", 2.0),
    Step("-0.5 m/s", -0.5),
    Step("0.1 m/s", 0.1, seconds=8.0),
    Step("0.05 m/s", 0.05, seconds=8.0),
    Step("0.02 m/s", 0.02, seconds=8.0),
)
SPOT_TURNS = (
    Step("+30 deg/s on the spot", 0.0, math.radians(30), seconds=4.0, rest=3.0),
    Step("-30 deg/s on the spot", 0.0, math.radians(-30), seconds=4.0, rest=3.0),
)
SIDEWAYS = (
    Step("0.1 m/s at +90 deg", 0.1, aside=math.pi / 2, seconds=4.0, rest=3.0),
    Step("0.1 m/s at -90 deg", 0.1, aside=-math.pi / 2, seconds=4.0, rest=3.0),
)
BEND = Step("0.5 m/s with 20 deg/s", 0.5, math.radians(20))
STICK_SPEEDS = (("0 m/s", 0.0), ("0.5 m/s", 0.5))


ZEROS = Step("zeros", 0.0)
FULL = Step("1 m/s", 1.0)


def drive_all(driver: Driver, *, standing: float = STANDING_TIME) -> None:
    """Drive all manoeuvres; ``standing`` is the time at rest, disarmed, at the start (s)."""
    _start(driver)
    _stand(driver, standing)
    turns = SIDEWAYS if driver.is_px4 else SPOT_TURNS
    for step in (*SPEED_STEPS, *turns, BEND):
        _drive_step(driver, step)
    _end_by_hold(driver)
    _end_by_silence(driver)
    _end_by_disarming(driver)
    if not driver.is_px4:
        for name, speed in STICK_SPEEDS:
            _push_stick(driver, name, speed)
    _move_home(driver)
    driver.mark("end")


def _start(driver: Driver) -> None:
    driver.mark("start")
    driver.wait_for_rover()
    driver.wait(FIRST_HEARTBEAT)
    in_control = driver.is_px4  # PX4 needs a stream before OFFBOARD
    while not driver.is_armed:
        in_control = in_control or driver.take_control()
        driver.hold()
        driver.arm()
        driver.wait(1.2)
        if not driver.is_armed:
            driver.wait(RETRY - 1.2)
    driver.mark(ARMED)
    driver.wait(1.0)
    driver.disarm()
    while not in_control:
        driver.wait(RETRY)
        in_control = driver.take_control()
    driver.hold()
    driver.wait(1.0)


def _stand(driver: Driver, seconds: float) -> None:
    driver.mark(STANDING_DISARMED)
    driver.wait(seconds)
    _make_ready(driver)
    driver.mark(STANDING_ARMED)
    driver.drive(seconds / 2, ZEROS)


def _make_ready(driver: Driver) -> None:
    for _ in range(10):
        if driver.is_ready:
            return
        driver.mark(READYING)
        if not driver.is_armed:
            if driver.is_px4:
                driver.hold()
            driver.arm()
        driver.drive(1.2, ZEROS)
        driver.take_control()
        driver.drive(1.2, ZEROS)


def _drive_step(driver: Driver, step: Step) -> None:
    _make_ready(driver)
    driver.mark(step.name)
    driver.drive(step.seconds, step)
    driver.mark(step.name + THEN_ZEROS)
    driver.drive(step.rest, ZEROS)


def _up_to_speed(driver: Driver) -> None:
    _make_ready(driver)
    driver.mark("1 m/s for the next")
    driver.drive(5.0, FULL)


def _end_by_hold(driver: Driver) -> None:
    _up_to_speed(driver)
    driver.mark(HOLD)
    driver.hold()
    _wait_until_it_stands(driver, at_most=15.0)


def _end_by_silence(driver: Driver) -> None:
    _up_to_speed(driver)
    driver.mark(SILENCE)
    _wait_until_it_stands(driver, at_most=25.0)
    driver.mark("set-points again")
    driver.drive(2.0, Step("0.3 m/s", 0.3))
    driver.drive(1.0, ZEROS)


def _end_by_disarming(driver: Driver) -> None:
    _up_to_speed(driver)
    driver.mark(DISARM)
    driver.disarm()
    _wait_until_it_stands(driver, at_most=15.0)


def _wait_until_it_stands(driver: Driver, *, at_most: float) -> None:
    """Wait until the rover has reported standstill for 5 s."""
    stood = waited = 0.0
    while stood < 5.0 and waited < at_most:
        driver.wait(0.1)
        waited += 0.1
        stood = stood + 0.1 if driver.reported_speed <= STILL else 0.0


def _push_stick(driver: Driver, name: str, speed: float) -> None:
    step = Step(name, speed)
    _make_ready(driver)
    driver.mark(FREE + name)
    driver.drive(4.0, step)
    driver.mark(PUSHED + name)
    driver.push_stick(STICK)
    driver.drive(3.0, step)
    driver.mark(RELEASED + name)
    driver.push_stick(None)
    driver.drive(4.0, step)
    driver.mark("stick: zeros")
    driver.drive(4.0, ZEROS)


def _move_home(driver: Driver) -> None:
    driver.disarm()
    driver.mark(DISARMED)
    driver.wait(6.0)
    _make_ready(driver)
    driver.mark(DRIVEN)
    driver.drive(8.0, FULL)
    driver.drive(4.0, ZEROS)
    driver.disarm()
    driver.mark(DISARMED_AGAIN)
    driver.wait(7.0)
    _make_ready(driver)
    driver.mark("home: armed again")
    driver.drive(5.0, ZEROS)
    driver.disarm()
    driver.mark("home: disarmed at last")
    driver.wait(4.0)
