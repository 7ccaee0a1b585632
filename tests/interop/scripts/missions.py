"""What a MAVSDK script does with missions, without knowing of a task server. Prints what it saw."""

from typing import Any

from mavsdk.plugins.action import Action
from mavsdk.plugins.mission import Mission
from mavsdk.plugins.mission_raw import MissionRaw

from tests.interop.scripts.circumstances import Circumstances
from tests.interop.scripts.common import arm, connected, wait_for, wait_for_motion
from tests.interop.scripts.facts import METRES, NAN
from tests.interop.scripts.plans import places, plan, raw_items
from tests.interop.scripts.progress import is_told_to_the_end, pairs


def raw_mission(here: Circumstances, system: Any, telemetry: Any, home: Any) -> None:
    raw = MissionRaw(system)
    here.attempt(raw.upload_mission, raw_items(home))
    back = here.attempt(raw.download_mission)
    print("raw downloaded", places(back, home, here.persona)[-3:])
    seen: list[Any] = []
    raw.subscribe_mission_progress(lambda report, _: seen.append(report))
    here.attempt(raw.start_mission)
    wait_for(lambda: seen and seen[-1].current >= 2, "an item")
    here.attempt(raw.pause_mission)
    wait_for_motion(telemetry, moves=False)
    here.attempt(raw.set_current_mission_item, 3)
    here.attempt(raw.start_mission)
    wait_for(raw.is_mission_finished, "the end")
    wait_for(lambda: is_told_to_the_end(seen), "the last item")
    print("raw progress", set(pairs(seen)))
    here.attempt(raw.clear_mission)


def mission(here: Circumstances, system: Any, home: Any) -> None:
    plugin = Mission(system)
    seen: list[Any] = []
    plugin.subscribe_mission_progress(lambda report, _: seen.append(report))
    here.attempt(plugin.upload_mission, plan(home))
    print("downloaded", len(here.attempt(plugin.download_mission).mission_items))
    here.attempt(plugin.start_mission)
    wait_for(lambda: seen and seen[-1].current >= 1, "the first item")
    here.attempt(plugin.pause_mission)
    here.attempt(plugin.set_current_mission_item, 1)
    here.attempt(plugin.start_mission)
    wait_for(plugin.is_mission_finished, "the end")
    wait_for(lambda: is_told_to_the_end(seen), "the last item")
    print("progress", pairs(seen))
    here.attempt(plugin.clear_mission)


def actions(here: Circumstances, system: Any, telemetry: Any, home: Any) -> None:
    action = Action(system)
    # so far that it still drives when an answer has come through at last
    place = (home.latitude_deg + 30 / METRES, home.longitude_deg, 0.0, NAN)
    here.attempt(action.goto_location, *place)
    wait_for_motion(telemetry, moves=True)
    here.attempt(action.hold)
    wait_for_motion(telemetry, moves=False)
    here.attempt(action.return_to_launch)
    wait_for_motion(telemetry, moves=True)


def main() -> None:
    with connected() as (here, system, telemetry, home):
        arm(here, Action(system), telemetry)
        raw_mission(here, system, telemetry, home)
        mission(here, system, home)
        actions(here, system, telemetry, home)


if __name__ == "__main__":
    main()
