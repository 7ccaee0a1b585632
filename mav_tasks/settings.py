"""Every setting of the server, as frozen values with unit, default and effect. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from math import radians


class Turning(Enum):
    """How a vehicle can turn."""

    #: skid-steered or differential: also while it stands
    ON_SPOT = "on-spot"
    #: as a car: only while it rolls, on a circle
    STEERED = "steered"


#: m, of a car whose own is not known. ArduPilot's simulated one (4.6.3) could do 0.9; asked for 1.4
#: its steering, too slow with default gains, reached 2.8
DEFAULT_TURNING_RADIUS = 1.5

#: who may arm a vehicle
ARMING = ("auto", "server", "operator")
#: the command that makes a rover stand when its setpoints stop, as refusals name it
SET_FAILSAFE = "mav-tasks probe --set-failsafe"


@dataclass(frozen=True, slots=True)
class Driving:
    """How tasks are driven."""

    speed: float = 0.5  # m/s, of a move that names none
    max_speed: float = 2.0  # m/s, a faster wish is refused
    turn_rate: float = radians(40)  # rad/s, of a rotation that names none
    max_turn_rate: float = radians(90)  # rad/s, a faster wish is refused
    max_distance: float = 10_000.0  # m, a longer move is refused
    max_turn: float = radians(3600)  # rad, a longer rotation is refused
    max_duration: float = 3600.0  # s, a longer drive at constant velocity is refused
    acceleration: float = 0.5  # m/s², of the setpoints; also the deceleration planned for
    turn_acceleration: float = radians(90)  # rad/s², the same for turning
    arrival_distance: float = 0.01  # m, a move is done within this of its end
    arrival_angle: float = radians(0.5)  # rad, a rotation is done within this of its end
    #: m, within which a move is done that its rover cannot bring nearer to its end
    settle_distance: float = 0.1
    settle_angle: float = radians(2)  # rad, the same for a rotation
    acceptance_radius: float = 0.5  # m, a plan's place that names none is passed within this
    #: m, the least of a vehicle that steers as a car, where neither profile nor vehicle says it
    turning_radius: float = DEFAULT_TURNING_RADIUS


@dataclass(frozen=True, slots=True)
class Watch:
    """How long the server waits, and when it stops trusting; seconds unless said otherwise."""

    setpoint_period: float = 0.05  # 20 Hz
    motion_fresh: float = 0.3  # no motion on data older than this
    position_lost: float = 1.0  # older data than this pauses the task, POSITION_LOST
    heartbeat_lost: float = 3.5  # silent after three missed beats and some jitter; QGroundControl's
    late_tick: float = 0.5  # a setpoint tick later than this holds the task, LATE
    start_timeout: float = 8.0  # from STARTING to in control; PX4 takes four heartbeats
    ask_vehicle: float = 1.0  # a refused mode or arming is asked for again for this long
    #: a vehicle that is not ready, restarting or refusing to arm, is waited for so long
    ready_timeout: float = 600.0
    lost_timeout: float = 30.0  # paused LINK_LOST or POSITION_LOST for longer than this fails
    fresh_before_resume: float = 2.0  # of good data, before a lost task resumes by itself
    stuck: float = 10.0  # commanded without progress for this long fails, STUCK
    operator_lost: float = 5.0  # without a ground station's heartbeat; ArduPilot's FS_GCS_TIMEOUT
    other_controller: float = 2.0  # since the last setpoint of somebody else
    commit: float = 0.4  # a submission not durable by then is withdrawn
    forward_answer: float = 0.4  # a forwarded command not answered by then is refused
    shutdown: float = 3.0  # until the vehicles stand in an orderly end; an ArduPilot rolls in HOLD
    #: disarm a vehicle that was told to stand, shows HOLD, and still moves after this; 0: never
    disarm_moving: float = 2.0
    stop_unconfirmed: float = 5.0  # cancelled, but not seen to stand by then: held
    still_speed: float = 0.03  # m/s, measured, below which a vehicle stands
    still_turn_rate: float = radians(2)  # rad/s, the same
    still_time: float = 0.3  # below both for this long: stands still


@dataclass(frozen=True, slots=True)
class Queueing:
    """What may wait, and in which order."""

    capacity: int = 1000  # waiting tasks for each vehicle
    quota: int = 500  # waiting tasks of each client
    aging: float = 60.0  # s of waiting that count as one priority; 0: none
    #: priorities by which a waiting task must be more urgent to interrupt the running one; 0: none
    preemption_gap: int = 0
    preemption_rest: float = 2.0  # s that a task runs at the least before it is interrupted


@dataclass(frozen=True, slots=True)
class Clients:
    """What clients are served."""

    max_clients: int = 64  # endpoints remembered on all client links; beyond: the longest silent
    forget_after: float = 60.0  # s, a client silent for longer is forgotten
    push_lost: float = 5.0  # s, an address pushed to that is silent for longer gets heartbeats only
    stream_interval: float = 0.1  # s, between telemetry messages of one id, unless asked otherwise
    text_rate: float = 10.0  # STATUSTEXT per second to one client; beyond they are only counted
    packet_rate: float = 2_000.0  # datagrams per second of one client; beyond: not looked at
    #: bytes per second that vehicles behind one endpoint are asked to stream; of a serial line no
    #: more than it carries. Less where a radio is behind a UDP or TCP link
    telemetry_budget: float = 50_000.0
    status_rate: float = 50.0  # pushed TASK_STATUS per second to one client; beyond: coalesced
    #: priority of the standard commands of a client, 0–10, by its MAVLink address, "255/190", or by
    #: address and endpoint, "255/190@127.0.0.1:14550"; of others 5
    priorities: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Retention:
    """How long what is over is kept in the store; None: for ever."""

    max_age: float | None = 30 * 86_400.0  # s since a task ended
    max_count: int | None = 10_000  # finished tasks; the oldest are forgotten first


@dataclass(frozen=True, slots=True)
class Identity:
    """MAVLink addresses of the server."""

    system_id: int = 250  # on vehicle links
    component_id: int = 191  # on vehicle links, and inside each vehicle's system towards clients


@dataclass(frozen=True, slots=True)
class Signing:
    """What is asked of MAVLink 2 signatures; the keys are no settings."""

    #: s, that a sender heard for the first time may be behind the clock, anybody ahead of it, and a
    #: packet of a known one late
    window: float = 60.0
    #: SETUP_SIGNING of a client: "refuse", or "known": what goes to it is signed with that key
    #: from then on, if it is one of ours; nobody's rights change by it
    setup: str = "known"


#: who somebody is to the server, from the least rights to the most
ROLES = ("observer", "submitter", "operator", "safety")
#: kinds of tasks, as limits name them
TASK_KINDS = ("move", "rotate", "drive", "goto", "return", "wait", "plan")


@dataclass(frozen=True, slots=True)
class Limits:
    """What a role may do at the most; each client for itself."""

    tasks: tuple[str, ...] = TASK_KINDS  # kinds that it may submit
    max_priority: int = 10
    max_speed: float = 10.0  # m/s, of its tasks
    quota: int = 100_000  # waiting tasks; no more than ``queueing.quota`` says for everybody
    rate: float = 200.0  # requests per second in the long run, of which 5 s may come at once


@dataclass(frozen=True, slots=True)
class Roles:
    """Who may do what. Who signs has the role of his key, whatever his address."""

    #: of who does not sign, where that is allowed, and is not named in ``addresses``
    unsigned: str = "safety"
    #: of unsigned clients by MAVLink address, "255/190", or by address and endpoint,
    #: "255/190@127.0.0.1:14550"
    addresses: Mapping[str, str] = field(default_factory=dict)
    observer: Limits = field(default_factory=Limits)
    submitter: Limits = field(default_factory=Limits)
    operator: Limits = field(default_factory=Limits)
    safety: Limits = field(default_factory=Limits)


@dataclass(frozen=True, slots=True)
class VehicleProfile:
    """What a probe has measured of one vehicle; what it does not know is "" or None."""

    system_id: int = 0
    uid: str = ""  # of AUTOPILOT_VERSION, in hex; "": the vehicle does not say
    autopilot: str = ""  # name of the persona
    firmware: str = ""  # version and hash, as AUTOPILOT_VERSION has them
    probed: str = ""  # when, UTC
    yaw_rate: str = ""  # "honoured", also on the spot, or "ignored"
    reverse: str = ""  # "yes" or "no"
    turning: str = ""  # value of a Turning
    turning_radius: float | None = None  # m, the least, of one that steers as a car
    #: velocity setpoints that it has followed: "BODY_NED 0x05C7"
    setpoints: tuple[str, ...] = ()
    loss_stop: str = ""  # whether it stops by itself when setpoints stop: "yes" or "no"
    setpoint_timeout: float | None = None  # s, from the last setpoint until it slows down
    speed: float | None = None  # m/s, at which the stop was measured
    stopping_distance: float | None = None  # m, from the first zero until it stood
    stopping_time: float | None = None  # s, the same


@dataclass(frozen=True, slots=True)
class Settings:
    """All settings of one server."""

    identity: Identity = field(default_factory=Identity)
    signing: Signing = field(default_factory=Signing)
    roles: Roles = field(default_factory=Roles)
    driving: Driving = field(default_factory=Driving)
    watch: Watch = field(default_factory=Watch)
    queueing: Queueing = field(default_factory=Queueing)
    clients: Clients = field(default_factory=Clients)
    retention: Retention = field(default_factory=Retention)
    #: who arms: "server", "operator", or "auto" = server where the vehicle link is loopback
    arming: str = "auto"
    #: whether PX4 and generic rovers turn at a yaw rate: "honoured", or "ignored"; then they are
    #: steered by course, and neither turn on the spot nor reverse
    yaw_rate: str = "ignored"
    #: a rover that is known not to stand when setpoints stop: it "must_stand" first, and its tasks
    #: wait, or they are driven all the same, "accept"
    loss_failsafe: str = "must_stand"
    #: whether standard commands and modes addressed to the autopilot become tasks, too
    claim: bool = True
    #: what a "go to" that changes the mode does: "queue", or run at once, "now"
    guided: str = "queue"
    #: when no ground station is heard any more: "continue", or "pause" every vehicle's tasks
    operator_lost: str = "continue"
    #: after a failed task that had moved: "pause" the queue or "continue"
    on_failure: str = "pause"
    #: after an unclean end, or a long one: "pause" the queues or "continue"
    on_restart: str = "pause"
    #: what is known of vehicles; each is used for the one that it was measured of, and no other
    profiles: tuple[VehicleProfile, ...] = ()


@dataclass(frozen=True, slots=True)
class Links:
    """Where clients and vehicles are; link URLs as ``links/url.py`` reads them."""

    clients: tuple[str, ...] = ("udpin:127.0.0.1:14560",)
    #: host:port, where clients listen on UDP and are spoken to unasked
    push: tuple[str, ...] = ("127.0.0.1:14550", "127.0.0.1:14540")
    vehicles: tuple[str, ...] = ("udpout:127.0.0.1:14580",)
    insecure: bool = False  # whether other machines may reach a link unsigned
    #: where unsigned packets are taken: on "loopback" links, or "nowhere"; a link's URL may say
    #: otherwise
    unsigned: str = "loopback"
    keys: str = ""  # path of the key ring, "" for the one in the user's configuration folder


@dataclass(frozen=True, slots=True)
class Recording:
    """What is written down of a run, beside the store; "" is nothing."""

    tlog: str = ""  # folder of the telemetry logs
    tlog_size: int = 50_000_000  # bytes, of one file; the next is begun then
    tlog_files: int = 10  # kept at the most; the oldest goes first
    decisions: str = ""  # folder of the records that can be replayed, one for each run
    decisions_size: int = 200_000_000  # bytes, of one record; it ends there


@dataclass(frozen=True, slots=True)
class Log:
    """What is said on standard error while the server runs."""

    format: str = "text"  # or "json", one object a line
    level: str = "info"  # the least that is said: "debug", "info", "warning" or "error"


@dataclass(frozen=True, slots=True)
class ServerSettings:
    """All that one server process is told: what it serves, and its surroundings."""

    engine: Settings = field(default_factory=Settings)
    links: Links = field(default_factory=Links)
    #: path of the store, ":memory:" for none, "" for the one in the user's data folder
    store: str = ""
    #: file or folder of the profiles that ``mav-tasks probe`` writes, "none" for none, "" for the
    #: folder in the user's configuration
    profiles: str = ""
    recording: Recording = field(default_factory=Recording)
    log: Log = field(default_factory=Log)
