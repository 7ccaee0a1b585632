"""What a MAVSDK script that knows our dialect learns of its tasks through mavlink_direct."""

import json
from typing import Any

from mavsdk.plugins.action import Action
from mavsdk.plugins.mavlink_direct import MavlinkDirect
from mavsdk.plugins.mavlink_direct.mavlink_direct import MavlinkMessage
from mavsdk.plugins.mission_raw import MissionRaw

from tests.interop.scripts.circumstances import Circumstances
from tests.interop.scripts.common import arm, connected, wait_for
from tests.interop.scripts.facts import (
    COMPLETED,
    DIALECT,
    GOTO,
    METRES,
    NAN,
    SERVER,
    move,
    status_request,
)
from tests.interop.scripts.plans import raw_items

KINDS = ("TASK_STATUS", "COMMAND_ACK", "MISSION_ACK", "MISSION_CURRENT")
Heard = dict[str, list[dict[str, Any]]]


def command(here: Circumstances, direct: Any, fields: dict[str, Any]) -> Any:
    message = MavlinkMessage("COMMAND_LONG", 0, 0, 1, SERVER, json.dumps(fields))
    return json.loads(here.attempt(direct.send_command, message).fields_json)


def move_as_a_task(here: Circumstances, direct: Any, heard: Heard) -> int:
    """Submit a move, follow it to its end by TASK_STATUS; gives its id."""
    ack = command(here, direct, move())
    assert ack["result"] == 0, ack
    task_id = int(ack["result_param2"])

    def is_completed() -> bool:
        if here.is_lossy:  # the report of the end comes once, and may be lost: so ask for it
            assert command(here, direct, status_request(task_id))["result"] == 0
        return any(status["state"] == COMPLETED for status in heard["TASK_STATUS"])

    wait_for(is_completed, "the task's end")
    assert {status["task_id"] for status in heard["TASK_STATUS"]} == {task_id}
    return task_id


def main() -> None:
    with connected() as (here, system, telemetry, home):
        direct, action, raw = MavlinkDirect(system), Action(system), MissionRaw(system)
        direct.load_custom_xml(DIALECT.read_text(encoding="utf-8"))
        heard: Heard = {kind: [] for kind in KINDS}
        for kind, messages in heard.items():
            direct.subscribe_message(
                kind, lambda m, _, messages=messages: messages.append(json.loads(m.fields_json))
            )
        arm(here, action, telemetry)
        task_id = move_as_a_task(here, direct, heard)
        print("task", task_id, "completed")

        north = home.latitude_deg + 1 / METRES
        here.attempt(action.goto_location, north, home.longitude_deg, 0.0, NAN)
        wait_for(lambda: any(a["command"] == GOTO for a in heard["COMMAND_ACK"]), "the ack")
        acks = [ack for ack in heard["COMMAND_ACK"] if ack["command"] == GOTO]
        print("goto", sorted({(ack["result"], ack["result_param2"]) for ack in acks}))

        here.attempt(raw.upload_mission, raw_items(home))
        # a try that failed for loss has an ack of its own, with the reason in place of the id
        acks = heard["MISSION_ACK"]
        wait_for(lambda: any(ack["opaque_id"] > ack["type"] == 0 for ack in acks), "the ack")
        mission_id = max(ack["opaque_id"] for ack in acks if not ack["type"])
        wait_for(
            lambda: (
                heard["MISSION_CURRENT"]
                and heard["MISSION_CURRENT"][-1]["mission_id"] == mission_id
            ),
            "the mission's id",
        )
        print("mission", mission_id)


if __name__ == "__main__":
    main()
