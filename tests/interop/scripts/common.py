"""What the scripts of MAVSDK 4's synchronous face begin with, and how they wait."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from mavsdk import ComponentType, Configuration, Mavsdk, MavsdkError
from mavsdk.plugins.telemetry import Telemetry

from tests.interop.scripts.circumstances import PATIENCE, Circumstances
from tests.interop.scripts.facts import HOLD

STEP = 0.05  # s


def wait_for(condition: Callable[[], Any], what: str, *, within: float = PATIENCE) -> None:
    """Ask until it is true; TimeoutError names what did not come."""
    end = time.monotonic() + within
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(what)
        time.sleep(STEP)


def wait_for_motion(telemetry: Any, *, moves: bool) -> None:
    """Wait until the rover drives, or stands."""

    def speed() -> float:
        velocity = telemetry.velocity_ned()
        return float(abs(velocity.north_m_s) + abs(velocity.east_m_s))

    wait_for(lambda: (speed() > 0.2) is moves, "motion" if moves else "standstill")


@contextmanager
def system_at(url: str, *, within: float = PATIENCE) -> Iterator[Any]:
    """Return the system that is found there."""
    configuration = Configuration.create_with_component_type(ComponentType.GROUND_STATION)
    with Mavsdk(configuration) as mavsdk:
        mavsdk.add_any_connection(url)
        system = mavsdk.first_autopilot(within)
        assert system is not None, "no autopilot"
        yield system


@contextmanager
def connected() -> Iterator[tuple[Circumstances, Any, Any, Any]]:
    """Return the circumstances, the system, its telemetry and its home, once it is healthy."""
    circumstances = Circumstances.from_arguments(MavsdkError)
    with system_at(circumstances.address) as system:
        telemetry = Telemetry(system)
        homes: list[Any] = []
        telemetry.subscribe_home(lambda home, _: homes.append(home))
        wait_for(telemetry.health_all_ok, "health")
        wait_for(lambda: homes, "home")
        yield circumstances, system, telemetry, homes[0]
    print("done")


def arm(here: Circumstances, action: Any, telemetry: Any) -> None:
    """Arm it in HOLD: a rover that somebody else has armed is taken over from no other mode."""
    here.attempt(action.hold)
    wait_for(lambda: telemetry.flight_mode() == HOLD, "HOLD")
    here.attempt(action.arm)
