"""What a MAVSDK script hears of a rover that drives: each stream of telemetry, and the texts."""

import time
from typing import Any

from mavsdk.plugins.action import Action

from tests.interop.scripts.common import arm, connected, wait_for
from tests.interop.scripts.facts import METRES, NAN, OFFBOARD
from tests.interop.scripts.heard import STREAMS, is_told_of_a_task, tell


def main() -> None:
    with connected() as (here, system, telemetry, home):
        heard: dict[str, list[Any]] = {name: [] for name in STREAMS}
        for name, values in heard.items():
            subscribe = getattr(telemetry, f"subscribe_{name}")
            subscribe(lambda value, _, values=values: values.append(value))
        action = Action(system)
        arm(here, action, telemetry)
        north = home.latitude_deg + 1 / METRES
        place = (north, home.longitude_deg, 0.0, NAN)
        here.attempt(action.goto_location, *place)
        wait_for(lambda: OFFBOARD in heard["flight_mode"], "the mode of a task")
        wait_for(
            lambda: heard["position"] and abs(heard["position"][-1].latitude_deg - north) < 1e-6,
            "arrival",
        )
        texts = heard["status_text"]
        if here.is_lossy:  # each text comes once: go there again until one has come
            while not is_told_of_a_task(texts):
                here.attempt(action.goto_location, *place)
                time.sleep(1.0)
        else:
            wait_for(lambda: any("Task 1 done" in each.text for each in texts), "the task's text")
        wait_for(lambda: all(heard.values()), f"each stream: {heard}")
        tell(heard, here.persona, home)


if __name__ == "__main__":
    main()
