"""What tells one make of autopilot from another: numbers and names, no behaviour.

``ardupilot`` is Rover 4.6.3 as observed on the wire. Behaviour that differs by make (setpoint
rules, order of arming and mode) belongs into the flight stack, chosen by persona.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from mav_tasks.mavlink.enums import MavAutopilot
from rover_sim.parameters import ARDUPILOT_PARAMETERS, Parameter


class Mode(Enum):
    """What the flight stack can be doing; each persona has its own numbers for them."""

    INITIALISING = "initialising"
    MANUAL = "manual"
    HOLD = "hold"
    AUTO = "auto"
    RTL = "rtl"
    GUIDED = "guided"


@dataclass(frozen=True, slots=True)
class Persona:
    """One make and version of autopilot."""

    name: str
    autopilot: MavAutopilot
    modes: Mapping[Mode, int]  # HEARTBEAT.custom_mode
    capabilities: int  # AUTOPILOT_VERSION.capabilities
    flight_sw_version: int  # AUTOPILOT_VERSION: major, minor, patch, type, a byte each
    firmware_hash: bytes  # AUTOPILOT_VERSION.flight_custom_version, 8 bytes
    parameters: tuple[Parameter, ...]
    announces_changes: bool  # a HEARTBEAT at once when mode or arming changes, or only each second

    def mode_of(self, custom_mode: int) -> Mode | None:
        """Give the mode of a number, or None if there is no such mode."""
        return next((mode for mode, number in self.modes.items() if number == custom_mode), None)


ARDUPILOT = Persona(
    name="ardupilot",
    autopilot=MavAutopilot.ARDUPILOTMEGA,
    modes={
        Mode.MANUAL: 0,
        Mode.HOLD: 4,
        Mode.AUTO: 10,
        Mode.RTL: 11,
        Mode.GUIDED: 15,
        Mode.INITIALISING: 16,
    },
    capabilities=61935,
    flight_sw_version=4 << 24 | 6 << 16 | 3 << 8 | 255,  # 4.6.3, official
    firmware_hash=b"3fc7011a",
    parameters=ARDUPILOT_PARAMETERS,
    announces_changes=False,  # observed: 1 Hz
)

PERSONAS: Mapping[str, Persona] = {ARDUPILOT.name: ARDUPILOT}
