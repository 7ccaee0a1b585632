"""What a MAVSDK script does and sees while other clients are there: it is told by lines to its
standard input, and answers each by a line of JSON.

``rates ATTITUDE POSITION``: asks for these, Hz. ``move METRES``: sends TASK_MOVE, gives the ack.
``seen``: what has come so far.
"""

import json
import sys
from typing import Any

from mavsdk.plugins.mavlink_direct import MavlinkDirect
from mavsdk.plugins.mavlink_direct.mavlink_direct import MavlinkMessage
from mavsdk.plugins.telemetry import Telemetry

from tests.interop.scripts.common import system_at, wait_for
from tests.interop.scripts.facts import SERVER, TASK_MOVE, command_long

COUNTED = ("ATTITUDE", "GLOBAL_POSITION_INT")
KEPT = ("COMMAND_ACK", "MISSION_ACK", "MISSION_REQUEST_INT", "MISSION_REQUEST", "MISSION_CURRENT")


class Client:
    """What it hears."""

    def __init__(self, system: Any) -> None:
        self.telemetry = Telemetry(system)
        self.direct = MavlinkDirect(system)
        self.counts = dict.fromkeys(COUNTED, 0)
        self.kept: dict[str, list[dict[str, Any]]] = {kind: [] for kind in KEPT}
        self.texts: list[str] = []
        self.telemetry.subscribe_status_text(lambda each, _: self.texts.append(each.text))
        for kind in (*COUNTED, *KEPT):
            self.direct.subscribe_message(kind, lambda message, _: self.take(message))

    def take(self, message: Any) -> None:
        if message.message_name in self.counts:
            self.counts[message.message_name] += 1
        else:
            self.kept[message.message_name].append(json.loads(message.fields_json))

    def rates(self, attitude: str, position: str) -> Any:
        self.telemetry.set_rate_attitude_euler(float(attitude))
        self.telemetry.set_rate_position(float(position))
        return "asked"

    def move(self, metres: str) -> Any:
        fields = json.dumps(command_long(SERVER, TASK_MOVE, param1=float(metres)))
        message = MavlinkMessage("COMMAND_LONG", 0, 0, 1, SERVER, fields)
        return json.loads(self.direct.send_command(message).fields_json)

    def seen(self) -> Any:
        return {
            "counts": self.counts,
            "texts": self.texts,
            "armed": self.telemetry.armed(),
            "mode": self.telemetry.flight_mode().name,
            "latitude": self.telemetry.position().latitude_deg,
            **self.kept,
        }


def main() -> None:
    with system_at(sys.argv[1]) as system:
        client = Client(system)
        wait_for(client.telemetry.health_all_ok, "health")
        print(json.dumps("ready"), flush=True)
        for line in sys.stdin:
            what, *arguments = line.split()
            print(json.dumps(getattr(client, what)(*arguments)), flush=True)


if __name__ == "__main__":
    main()
