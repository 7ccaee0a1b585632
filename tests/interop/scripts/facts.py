"""What a script has to know of a make of autopilot, and the fields of task commands."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

NAN = float("nan")
METRES = 111_318.85  # a degree of latitude
DIALECT = Path(__file__).resolve().parents[3] / "dialects" / "mav_tasks.xml"
SERVER = 191  # the component of the task server
TASK_MOVE, TASK_STATUS, REQUEST_MESSAGE, GOTO = 54000, 54000, 512, 192
COMPLETED = 9  # TASK_STATE
HOLD, OFFBOARD = 3, 7  # MAVSDK's FlightMode; OFFBOARD is also GUIDED
NONCE = 54321
LEAD = 0.5  # s that setpoints are sent before they are to be followed: PX4 asks for it


@dataclass(frozen=True)
class Persona:
    """What differs."""

    has_home_item: bool  # item 0 of a mission is the home and comes back as the autopilot has it
    is_in_air_armed: bool  # PX4's land detector: a rover that is armed has not landed
    real: tuple[str, float]  # a parameter, and a value that it may have
    integer: tuple[str, int]  # where integers go bytewise, one that no float would bring


ARDUPILOT = Persona(
    has_home_item=True,
    is_in_air_armed=False,
    real=("WP_SPEED", 3.0),
    integer=("FS_GCS_ENABLE", 1),
)
PX4 = Persona(
    has_home_item=False,
    is_in_air_armed=True,
    real=("COM_OF_LOSS_T", 1.5),
    integer=("COM_FLTMODE1", -7),
)
PERSONAS: Mapping[str, Persona] = {"ardupilot": ARDUPILOT, "px4": PX4}


def command_long(component: int, command: int, **params: float) -> dict[str, Any]:
    """The fields of a COMMAND_LONG for mavlink_direct; a parameter that is not given is NaN."""
    filled: dict[str, float | None] = {f"param{n}": None for n in range(1, 8)}
    address = {"target_system": 1, "target_component": component}
    return {**address, "command": command, "confirmation": 0, **filled, **params}


def move() -> dict[str, Any]:
    """A TASK_MOVE by half a metre, with a nonce: to send it again is safe."""
    return command_long(SERVER, TASK_MOVE, param1=0.5, param4=float(NONCE))


def status_request(task_id: int) -> dict[str, Any]:
    """The request for a task's TASK_STATUS."""
    return command_long(SERVER, REQUEST_MESSAGE, param1=float(TASK_STATUS), param2=float(task_id))
