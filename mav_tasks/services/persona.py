"""How an autopilot wants to be spoken to: modes, setpoint masks. Recognised from its HEARTBEAT."""

from collections.abc import Mapping
from dataclasses import dataclass

from mav_tasks.mavlink.enums import MavAutopilot, MavFrame, PositionTargetTypemask
from mav_tasks.mavlink.messages import Heartbeat

T = PositionTargetTypemask


@dataclass(frozen=True, slots=True)
class Persona:
    """The conventions of one family of autopilots."""

    name: str
    control_mode: int  # custom_mode in which setpoints are followed
    hold_mode: int  # custom_mode in which the vehicle stands
    manual_mode: int
    return_mode: int  # drives back to where it was armed
    mission_mode: int  # drives the uploaded mission
    booting_mode: int  # left without anybody's doing
    has_home_item: bool  # the first item of a mission is home
    setpoint_mask: int  # POSITION_TARGET_TYPEMASK of our velocity setpoints
    setpoint_frame: int  # MAV_FRAME of our velocity setpoints
    mode_names: Mapping[int, str]

    def mode_name(self, mode: int) -> str:
        """Give a custom_mode in words, as ground stations show it."""
        return self.mode_names.get(mode, f"mode {mode}")


#: ArduPilot Rover. With the yaw rate unmasked it turns on the spot, and vx < 0 reverses; a pure
#: velocity would turn the vehicle round instead (observed on 4.6.3). Mask 0x05C7.
ARDUPILOT = Persona(
    name="ardupilot",
    control_mode=15,  # GUIDED
    hold_mode=4,
    manual_mode=0,
    return_mode=11,  # RTL
    mission_mode=10,  # AUTO
    booting_mode=16,  # INITIALISING
    has_home_item=True,
    setpoint_mask=int(
        T.X_IGNORE
        | T.Y_IGNORE
        | T.Z_IGNORE
        | T.AX_IGNORE
        | T.AY_IGNORE
        | T.AZ_IGNORE
        | T.YAW_IGNORE
    ),
    setpoint_frame=MavFrame.BODY_NED,
    mode_names={
        0: "MANUAL",
        1: "ACRO",
        3: "STEERING",
        4: "HOLD",
        5: "LOITER",
        6: "FOLLOW",
        7: "SIMPLE",
        8: "DOCK",
        9: "CIRCLE",
        10: "AUTO",
        11: "RTL",
        12: "SMART_RTL",
        15: "GUIDED",
        16: "INITIALISING",
    },
)


def persona_of(heartbeat: Heartbeat) -> Persona | None:
    """Give the persona that a vehicle's heartbeat shows, or None if it is none that we drive."""
    if heartbeat.autopilot == MavAutopilot.ARDUPILOTMEGA:
        return ARDUPILOT
    return None
