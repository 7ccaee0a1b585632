"""Every setting of the server: frozen dataclasses with unit, default and effect. Pure."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from math import radians


class Turning(Enum):
    """How a vehicle can turn."""

    #: skid-steered or differential: can turn while it stands
    ON_SPOT = "on-spot"
    #: car-like: turns only while it rolls, on a circle
    STEERED = "steered"


#: m, for a car-like rover of unknown radius. ArduPilot's simulated one (4.6.3) could do 0.9; told
#: to turn at 1.4, its steering reached 2.8, as it is too slow with default gains
DEFAULT_TURNING_RADIUS = 1.5

#: who may arm a vehicle
ARMING = ("auto", "server", "operator")
#: the command that makes a rover stand when its setpoints stop, as refusals name it
SET_FAILSAFE = "mav-tasks probe --set-failsafe"


@dataclass(frozen=True, slots=True)
class Driving:
    """How tasks are driven."""

    speed: float = 0.5  # m/s, of a move without a speed
    max_speed: float = 2.0  # m/s, a faster request is refused
    turn_rate: float = radians(40)  # rad/s, of a rotation without a rate
    max_turn_rate: float = radians(90)  # rad/s, a faster request is refused
    max_distance: float = 10_000.0  # m, a longer move is refused
    max_turn: float = radians(3600)  # rad, a longer rotation is refused
    max_duration: float = 3600.0  # s, a longer drive at constant velocity is refused
    acceleration: float = 0.5  # m/s², of the setpoints; also the deceleration planned for
    turn_acceleration: float = radians(90)  # rad/s², the same for turning
    arrival_distance: float = 0.01  # m, a move is done within this of its end
    arrival_angle: float = radians(0.5)  # rad, a rotation is done within this of its end
    #: m, a move is done within this of its end if the rover cannot get closer
    settle_distance: float = 0.1
    settle_angle: float = radians(2)  # rad, the same for a rotation
    acceptance_radius: float = 0.5  # m, for a waypoint of a plan without a radius
    #: m, minimum of a car-like vehicle, if neither profile nor vehicle tells it
    turning_radius: float = DEFAULT_TURNING_RADIUS


@dataclass(frozen=True, slots=True)
class Watch:
    """Time-outs and thresholds of supervision; in seconds unless noted otherwise."""

    setpoint_period: float = 0.05  # 20 Hz
    motion_fresh: float = 0.3  # no motion on data older than this
    position_lost: float = 1.0  # older data pauses the task, POSITION_LOST
    heartbeat_lost: float = 3.5  # three missed heartbeats and jitter; QGroundControl's value
    late_tick: float = 0.5  # a setpoint tick later than this holds the task, LATE
    start_timeout: float = 8.0  # from STARTING to in control; PX4 takes four heartbeats
    ask_vehicle: float = 1.0  # a refused mode or arming is requested again for this long
    #: the server waits this long for a vehicle that is not ready, restarts or refuses to arm
    ready_timeout: float = 600.0
    lost_timeout: float = 30.0  # a task paused longer by LINK_LOST or POSITION_LOST fails
    fresh_before_resume: float = 2.0  # of good data, before a lost task resumes by itself
    stuck: float = 10.0  # a task commanded this long without progress fails, STUCK
    operator_lost: float = 5.0  # without a ground station's heartbeat; ArduPilot's FS_GCS_TIMEOUT
    other_controller: float = 2.0  # since another controller's last setpoint
    commit: float = 0.4  # a submission not durable by then is withdrawn
    forward_answer: float = 0.4  # a forwarded command not answered by then is refused
    shutdown: float = 3.0  # for the vehicles to stop at shutdown; an ArduPilot rolls on in HOLD
    #: disarm a vehicle that was told to stand, shows HOLD, and still moves after this; 0: never
    disarm_moving: float = 2.0
    stop_unconfirmed: float = 5.0  # cancelled, but not seen to stand by then: held
    still_speed: float = 0.03  # m/s, measured, below which a vehicle stands
    still_turn_rate: float = radians(2)  # rad/s, the same
    still_time: float = 0.3  # below both for this long: stands still


@dataclass(frozen=True, slots=True)
class Queueing:
    """Limits and order of the waiting tasks."""

    capacity: int = 1000  # waiting tasks for each vehicle
    quota: int = 500  # waiting tasks of each client
    aging: float = 60.0  # s of waiting that raise the priority by one; 0: no aging
    #: a waiting task interrupts the running one if its priority is higher by this; 0: never
    preemption_gap: int = 0
    preemption_rest: float = 2.0  # s, minimum run time of a task before it is interrupted


@dataclass(frozen=True, slots=True)
class Clients:
    """Limits and defaults for clients."""

    max_clients: int = 64  # endpoints on all client links; one more replaces a silent one
    forget_after: float = 60.0  # s, a client silent for longer is forgotten
    push_lost: float = 5.0  # s, a push address silent for longer gets heartbeats only
    stream_interval: float = 0.1  # s between telemetry messages of one id, unless requested
    text_rate: float = 10.0  # STATUSTEXT per second to one client; more are only counted
    packet_rate: float = 2_000.0  # datagrams per second of one client; more are dropped
    #: bytes per second that the vehicles behind one endpoint are asked to stream; a serial line
    #: lowers it to its capacity. Set it lower if a radio is behind a UDP or TCP link
    telemetry_budget: float = 50_000.0
    status_rate: float = 50.0  # pushed TASK_STATUS per second to one client; more are coalesced
    #: priority (0–10) of a client's standard commands, by its MAVLink address, "255/190", or by
    #: address and endpoint, "255/190@127.0.0.1:14550"; 5 for other clients
    priorities: Mapping[str, int] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Retention:
    """How long the store keeps finished tasks; None: for ever."""

    max_age: float | None = 30 * 86_400.0  # s since a task ended
    max_count: int | None = 10_000  # finished tasks; the oldest are deleted first


@dataclass(frozen=True, slots=True)
class Identity:
    """The server's MAVLink addresses."""

    system_id: int = 250  # on vehicle links
    component_id: int = 191  # on vehicle links, and inside each vehicle's system towards clients


@dataclass(frozen=True, slots=True)
class Signing:
    """Rules for MAVLink 2 signatures; the keys are in the key ring, not in the settings."""

    #: s, by which a new sender's timestamp may be behind the clock, any sender's ahead of it, and a
    #: known sender's packet late
    window: float = 60.0
    #: SETUP_SIGNING of a client: "refuse", or "known": if the key ring has the key, packets to the
    #: client are signed with it from then on; the client's rights do not change
    setup: str = "known"


#: roles of clients, from the least rights to the most
ROLES = ("observer", "submitter", "operator", "safety")
#: kinds of tasks, as limits name them
TASK_KINDS = ("move", "rotate", "drive", "goto", "return", "wait", "plan")


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of a role; they apply to each client separately."""

    tasks: tuple[str, ...] = TASK_KINDS  # kinds that a client may submit
    max_priority: int = 10
    max_speed: float = 10.0  # m/s, of its tasks
    quota: int = 100_000  # waiting tasks; ``queueing.quota`` is the upper limit for all roles
    rate: float = 200.0  # requests per second on average, with bursts of up to 5 s worth


@dataclass(frozen=True, slots=True)
class Roles:
    """Roles and their limits. A signing client has the role of its key, whatever its address."""

    #: role of unsigned clients that ``addresses`` does not name, where unsigned is allowed
    unsigned: str = "safety"
    #: roles of unsigned clients by MAVLink address, "255/190", or by address and endpoint,
    #: "255/190@127.0.0.1:14550"
    addresses: Mapping[str, str] = field(default_factory=dict)
    observer: Limits = field(default_factory=Limits)
    submitter: Limits = field(default_factory=Limits)
    operator: Limits = field(default_factory=Limits)
    safety: Limits = field(default_factory=Limits)


@dataclass(frozen=True, slots=True)
class VehicleProfile:
    """A probe's measurements of one vehicle; unknown values are "" or None."""

    system_id: int = 0
    uid: str = ""  # of AUTOPILOT_VERSION, in hex; "": the vehicle does not send it
    autopilot: str = ""  # name of the persona
    firmware: str = ""  # version and hash, as AUTOPILOT_VERSION has them
    probed: str = ""  # when, UTC
    yaw_rate: str = ""  # "honoured", also on the spot, or "ignored"
    reverse: str = ""  # "yes" or "no"
    turning: str = ""  # value of a Turning
    turning_radius: float | None = None  # m, minimum of a car-like rover
    #: velocity setpoints that the rover followed: "BODY_NED 0x05C7"
    setpoints: tuple[str, ...] = ()
    loss_stop: str = ""  # whether it stops by itself when setpoints stop: "yes" or "no"
    setpoint_timeout: float | None = None  # s, from the last setpoint until it slows down
    speed: float | None = None  # m/s, at which the stop was measured
    stopping_distance: float | None = None  # m, from the first zero setpoint to standstill
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
    #: who arms: "server", "operator", or "auto": the server if the vehicle link is loopback
    arming: str = "auto"
    #: whether PX4 and generic rovers follow a yaw rate: "honoured", or "ignored". If ignored, they
    #: are steered by course, and neither turn on the spot nor reverse
    yaw_rate: str = "ignored"
    #: a rover known not to stop when its setpoints stop: "must_stand": its tasks wait until that is
    #: fixed; "accept": they are driven anyway
    loss_failsafe: str = "must_stand"
    #: whether standard commands and modes addressed to the autopilot also become tasks
    claim: bool = True
    #: what a "go to" that changes the mode does: "queue", or "now" (run at once)
    guided: str = "queue"
    #: when no ground station is heard any longer: "continue", or "pause" every vehicle's tasks
    operator_lost: str = "continue"
    #: after a failed task that had moved: "pause" the queue or "continue"
    on_failure: str = "pause"
    #: after an unclean end, or a long downtime: "pause" the queues or "continue"
    on_restart: str = "pause"
    #: measurements of vehicles; each is used only for the vehicle that it was measured on
    profiles: tuple[VehicleProfile, ...] = ()


@dataclass(frozen=True, slots=True)
class Links:
    """Links to clients and vehicles; for the URLs see ``links/url.py``."""

    clients: tuple[str, ...] = ("udpin:127.0.0.1:14560",)
    #: host:port of UDP clients to which the server sends before it has heard from them (push)
    push: tuple[str, ...] = ("127.0.0.1:14550", "127.0.0.1:14540")
    vehicles: tuple[str, ...] = ("udpout:127.0.0.1:14580",)
    insecure: bool = False  # whether other machines may reach a link without signing
    #: where unsigned packets are accepted: on "loopback" links, or "nowhere"; a link's URL may
    #: override it
    unsigned: str = "loopback"
    keys: str = ""  # path of the key ring, "" for the one in the user's configuration folder


@dataclass(frozen=True, slots=True)
class Recording:
    """Recordings of a run, beside the store; a folder "" records nothing."""

    tlog: str = ""  # folder of the telemetry logs
    tlog_size: int = 50_000_000  # bytes, after which the next file begins
    tlog_files: int = 10  # maximum number of files; the oldest is deleted first
    decisions: str = ""  # folder of the decision records for replay, one for each run
    decisions_size: int = 200_000_000  # bytes, after which a record ends


@dataclass(frozen=True, slots=True)
class Log:
    """The server's log on standard error."""

    format: str = "text"  # or "json", one object a line
    level: str = "info"  # the lowest level logged: "debug", "info", "warning" or "error"


@dataclass(frozen=True, slots=True)
class ServerSettings:
    """All settings of one server process: engine, links, store, recordings and log."""

    engine: Settings = field(default_factory=Settings)
    links: Links = field(default_factory=Links)
    #: path of the store, ":memory:" for none, "" for the one in the user's data folder
    store: str = ""
    #: file or folder of the profiles that ``mav-tasks probe`` writes; "none" for none, "" for the
    #: folder in the user's configuration folder
    profiles: str = ""
    recording: Recording = field(default_factory=Recording)
    log: Log = field(default_factory=Log)
