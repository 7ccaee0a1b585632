"""What is known of a rover, as far as the probe has come. None, "" and () mean: not known."""

from dataclasses import dataclass, field


@dataclass(slots=True)
class Rate:
    """How often a message comes: Hz before it was asked for, and after."""

    name: str
    wanted: float
    unasked: float = 0.0
    answer: str = ""  # to SET_MESSAGE_INTERVAL
    granted: float | None = None


@dataclass(slots=True)
class Drive:
    """What came of driving. Metres, seconds, m/s."""

    ended: str = ""  # why before its time; "": it was carried through
    arming: str = ""  # "accepted", or why not
    hold: str = ""  # whether HOLD was accepted: "yes" or "no"
    left: str = ""  # how the rover was left
    accepted: list[str] = field(default_factory=list)  # setpoints
    refused: list[str] = field(default_factory=list)
    yaw_rate: str = ""  # "honoured" or "ignored"
    turned_of_wanted: float | None = None  # on the spot, a share
    turned_standing_deg: float | None = None  # in 2 s of zeros
    reverse: str = ""  # "yes" or "no"
    speed: float | None = None  # at which the stop was measured
    stopping_distance: float | None = None
    stopping_time: float | None = None
    loss_stop: str = ""  # "yes" or "no"
    setpoint_timeout: float | None = None  # until it slowed down
    loss_distance: float | None = None  # from the last setpoint until it stood
    loss_speed: float | None = None
    loss_note: str = ""  # why that was not tried
    farthest: float = 0.0  # from where it began


@dataclass(slots=True)
class Findings:
    system_id: int = 0
    autopilot: str = ""  # name of the persona
    vehicle_type: int = 0  # MAV_TYPE
    is_rover: bool = False
    uid: str = ""
    firmware: str = ""
    capabilities: int | None = None
    mode: str = ""
    armed: bool = False
    heartbeat_rate: float = 0.0  # Hz
    rates: list[Rate] = field(default_factory=list)
    rates_given_back: str = ""
    parameters: dict[str, float] = field(default_factory=dict)
    missing_parameters: list[str] = field(default_factory=list)
    #: what it does by its parameters, or by its make, when setpoints stop
    loss_by_parameters: str = ""
    failsafe_set: str = ""  # what was set for good so that it stands; "": nobody asked for that
    turning: str = ""  # value of a Turning, by its parameters
    turning_radius: float | None = None  # m, the same; None: no more than is taken for granted
    mission_items: int | None = None  # on board, home not counted
    prearm: str = ""  # "ok", "not ok", or "" where it does not say
    prearm_texts: list[str] = field(default_factory=list)
    others: list[str] = field(default_factory=list)  # who else is there
    drive: Drive | None = None
