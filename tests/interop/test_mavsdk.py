"""The real MAVSDK 4 (PyPI ``mavsdk``), unmodified, finds the rover through the server."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.mavlink_direct import MavlinkDirect
from mavsdk.plugins.mavlink_direct.mavlink_direct import MavlinkMessage
from mavsdk.plugins.telemetry import Telemetry

from tests.kit.processes import Stand, stand, wait_until

pytestmark = [pytest.mark.interop, pytest.mark.timeout(90)]

DIALECT = Path(__file__).resolve().parents[2] / "dialects" / "mav_tasks.xml"
TASK_COMPLETED = 9


@pytest.fixture
def running(tmp_path: Path) -> Iterator[Stand]:
    with stand(tmp_path) as it:
        yield it


@pytest.mark.parametrize("way", ["it listens and is pushed to", "it dials"])
def test_a_script_finds_the_rover_and_gets_a_task_id(running: Stand, way: str) -> None:
    if way == "it dials":
        url = f"udpout://127.0.0.1:{running.client_port}"
    else:
        url = f"udpin://127.0.0.1:{running.push_port}"
    with Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION)) as mavsdk:
        mavsdk.add_any_connection(url)
        system = mavsdk.first_autopilot(10.0)
        assert system is not None
        telemetry = Telemetry(system)
        wait_until(
            lambda: telemetry.position().latitude_deg == telemetry.position().latitude_deg,
            within=10,
        )

        direct = MavlinkDirect(system)
        direct.load_custom_xml(DIALECT.read_text(encoding="utf-8"))
        statuses: list[Any] = []
        direct.subscribe_message(
            "TASK_STATUS", lambda message, _: statuses.append(json.loads(message.fields_json))
        )
        fields = {
            "target_system": 1,
            "target_component": 191,
            "command": 54000,
            "confirmation": 0,
            "param1": 0.5,
            **{f"param{n}": None for n in range(2, 8)},
        }
        ack = direct.send_command(MavlinkMessage("COMMAND_LONG", 0, 0, 1, 191, json.dumps(fields)))
        assert json.loads(ack.fields_json)["result_param2"] == 1
        wait_until(lambda: [s for s in statuses if s["state"] == TASK_COMPLETED], within=20)
        assert {s["task_id"] for s in statuses} == {1}
