"""What a MAVSDK script hears of a rover that drives: each stream of telemetry, and the texts."""

from typing import Any

from mavsdk.plugins.action import Action

from tests.interop.scripts.common import arm, connected, wait_for
from tests.interop.scripts.facts import METRES, NAN, OFFBOARD
from tests.interop.scripts.heard import STREAMS, tell


def main() -> None:
    with connected() as (here, system, telemetry, home):
        heard: dict[str, list[Any]] = {name: [] for name in STREAMS}
        for name, values in heard.items():
            subscribe = getattr(telemetry, f"subscribe_{name}")
            subscribe(lambda value, _, values=values: values.append(value))
        action = Action(system)
        arm(here, action, telemetry)
        north = home.latitude_deg + 1 / METRES
        here.attempt(action.goto_location, north, home.longitude_deg, 0.0, NAN)
        wait_for(lambda: OFFBOARD in heard["flight_mode"], "the mode of a task")
        wait_for(
            lambda: heard["position"] and abs(heard["position"][-1].latitude_deg - north) < 1e-6,
            "arrival",
        )
        wait_for(
            lambda: here.is_lossy or any("Task 1 done" in t.text for t in heard["status_text"]),
            "the task's text",
        )
        wait_for(lambda: all(heard.values()), f"each stream: {heard}")
        tell(heard, here.persona, home)


if __name__ == "__main__":
    main()
