"""Every setting of the server: frozen dataclasses, and the keys that follow from them. Pure.

A field declares all of its setting: default, valid values, meaning, whether it is live, its MAVLink
parameter and its options of ``mav-tasks serve``. Nothing else repeats them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from enum import Enum
from math import pi, radians

from mav_tasks.config.setting_keys.key import Key, Option, keys_of, setting
from mav_tasks.config.setting_keys.shapes import (
    HIGHEST_ID,
    HIGHEST_PRIORITY,
    ByClient,
    Choice,
    Flag,
    Number,
    Text,
    Texts,
)


class Turning(Enum):
    """How a vehicle can turn."""

    #: skid-steered or differential: can turn while it stands
    ON_SPOT = "on-spot"
    #: car-like: turns only while it rolls, on a circle
    STEERED = "steered"


#: m, for a car-like rover of unknown radius. ArduPilot's simulated one (4.6.3) could do 0.9; told
#: to turn at 1.4, its steering reached 2.8, as it is too slow with default gains
DEFAULT_TURNING_RADIUS = 1.5

#: the command that makes a rover stand when its setpoints stop, as refusals name it
SET_FAILSAFE = "mav-tasks probe --set-failsafe"

#: where metrics are served if nobody names another address
METRICS_ADDRESS = "127.0.0.1:8561"

DEGREE = pi / 180  # rad
DAY = 86_400.0  # s
FOREVER = "forever"
URL = "link URLs: udpin:host:port and tcpin: listen, udpout: and tcp: connect, serial:device:baud"


def _seconds(low: float, high: float) -> Number:
    return Number(low, high, "s")


def _count(low: float, high: float, unit: str = "") -> Number:
    return Number(low, high, unit, is_whole=True)


@dataclass(frozen=True, slots=True)
class Driving:
    """How tasks are driven; in m, rad and s."""

    speed: float = setting(
        0.5,
        Number(0.05, 10, "m/s"),
        "default speed of tasks",
        at_most="driving.max_speed",
        parameter=(0, "TSK_SPEED"),
    )
    max_speed: float = setting(
        2.0,
        Number(0.05, 10, "m/s"),
        "speed limit; a task that asks for more is refused",
        parameter=(1, "TSK_SPEED_MAX"),
    )
    turn_rate: float = setting(
        radians(40),
        Number(1, 360, "deg/s", DEGREE),
        "default turn rate of tasks",
        at_most="driving.max_turn_rate_deg",
        parameter=(2, "TSK_TURN"),
    )
    max_turn_rate: float = setting(
        radians(90),
        Number(1, 360, "deg/s", DEGREE),
        "turn rate limit; a task that asks for more is refused",
        parameter=(3, "TSK_TURN_MAX"),
    )
    max_distance: float = setting(
        10_000.0,
        Number(1, 1e6, "m"),
        "maximum length of a move, and maximum distance to a place",
        parameter=(7, "TSK_DIST_MAX"),
    )
    max_turn: float = setting(
        radians(3600), Number(1, 360_000, "deg", DEGREE), "largest rotation that is accepted"
    )
    max_duration: float = setting(
        3600.0, _seconds(1, DAY), "longest drive at constant velocity that is accepted"
    )
    acceleration: float = setting(
        0.5,
        Number(0.05, 5, "m/s2"),
        "acceleration and braking of setpoints; a rover that brakes less overshoots goal and fence",
        parameter=(4, "TSK_ACCEL"),
    )
    turn_acceleration: float = setting(
        radians(90),
        Number(1, 3600, "deg/s2", DEGREE),
        "angular acceleration and deceleration of setpoints",
    )
    arrival_distance: float = setting(
        0.01, Number(0.001, 1, "m"), "a move is complete within this distance of its end"
    )
    arrival_angle: float = setting(
        radians(0.5),
        Number(0.05, 10, "deg", DEGREE),
        "a rotation is complete within this angle of its end",
    )
    settle_distance: float = setting(
        0.1,
        Number(0.001, 2, "m"),
        "a move is complete within this distance if the rover cannot get closer",
    )
    settle_angle: float = setting(
        radians(2),
        Number(0.05, 20, "deg", DEGREE),
        "a rotation is complete within this angle if the rover cannot get closer",
    )
    acceptance_radius: float = setting(
        0.5,
        Number(0.05, 100, "m"),
        "default acceptance radius of mission items",
        parameter=(5, "TSK_ACC_RAD"),
    )
    turning_radius: float = setting(
        DEFAULT_TURNING_RADIUS,
        Number(0.1, 50, "m"),
        "minimum turning radius of a car-like rover, if its profile and parameters have none",
        parameter=(6, "TSK_TURN_RAD"),
    )


@dataclass(frozen=True, slots=True)
class Watch:
    """Time-outs and thresholds of supervision; in s, m/s and rad/s.

    Within these ranges a rover is safe, whatever the other settings are.
    """

    setpoint_period: float = setting(
        0.05,
        _seconds(0.02, 0.2),
        "interval between setpoints",
        is_live=False,
        at_most="watch.late_tick",
    )
    motion_fresh: float = setting(
        0.3,
        _seconds(0.1, 1),  # the rover drives blind for this long
        "maximum age of position data to drive on",
        at_most="watch.position_lost",
    )
    position_lost: float = setting(
        1.0, _seconds(0.2, 10), "a task is paused if the rover's position data is older than this"
    )
    # Only heartbeats show that the rover is armed and in our mode. Three missed ones, and jitter;
    # QGroundControl's value.
    heartbeat_lost: float = setting(
        3.5, _seconds(1.5, 10), "a rover is lost after this time without a heartbeat"
    )
    # PX4 leaves OFFBOARD after 1 s without setpoints, and drives on by itself when they come again
    late_tick: float = setting(
        0.5, _seconds(0.1, 0.9), "a task is held if a setpoint is later than this"
    )
    # PX4 takes four heartbeats
    start_timeout: float = setting(
        8.0,
        _seconds(3, 120),
        "a task fails if the server does not get control of the rover within this time",
        parameter=(12, "TSK_START_TMO"),
    )
    ask_vehicle: float = setting(
        1.0,
        _seconds(0.3, 5),
        "how long to repeat a mode or arming request that the rover refuses",
    )
    ready_timeout: float = setting(
        600.0, _seconds(0, 3600), "how long to wait for a rover that restarts or refuses to arm"
    )
    lost_timeout: float = setting(
        30.0,
        _seconds(3, 3600),
        "a task fails after this time without the rover or its position",
        parameter=(14, "TSK_LOST_TMO"),
    )
    fresh_before_resume: float = setting(
        2.0, _seconds(0, 60), "time with good data before a task resumes by itself after a loss"
    )
    stuck: float = setting(
        10.0,
        _seconds(2, 600),
        "a task fails after this time without progress",
        parameter=(13, "TSK_STUCK_TMO"),
    )
    # ArduPilot's FS_GCS_TIMEOUT
    operator_lost: float = setting(
        5.0,
        _seconds(2, 600),
        "the operator is lost after this time without a ground station's heartbeat",
        parameter=(15, "TSK_OPER_TMO"),
    )
    other_controller: float = setting(
        2.0,
        _seconds(0.5, 30),
        "a task waits this long after the last setpoint of another controller",
    )
    commit: float = setting(
        0.4, _seconds(0.1, 10), "a submission is refused if it is not stored within this time"
    )
    forward_answer: float = setting(
        0.4,
        _seconds(0.1, 10),
        "a forwarded command is refused if the rover does not answer within this time",
    )
    # an ArduPilot rolls on in HOLD
    shutdown: float = setting(3.0, _seconds(0.1, 30), "maximum time to stop the rovers at shutdown")
    disarm_moving: float = setting(
        2.0,
        _seconds(0, 60),
        "a rover that should stand is disarmed if it still moves this long after HOLD; 0: never",
    )
    stop_unconfirmed: float = setting(
        5.0,
        _seconds(1, 60),
        "a cancelled task is held if its rover does not stand still within this time",
    )
    # a rover driven slower than this seems to stand, and its stop would be confirmed too soon
    still_speed: float = setting(
        0.03,
        Number(0.001, 0.1, "m/s"),
        "a rover stands still if its speed stays below this for still_time",
    )
    still_turn_rate: float = setting(
        radians(2),
        Number(0.1, 5, "deg/s", DEGREE),
        "and if its turn rate stays below this for still_time",
    )
    # at least two messages of 10 Hz telemetry: a rover that reverses is slow for a moment
    still_time: float = setting(
        0.3,
        _seconds(0.2, 5),
        "time below still_speed and still_turn_rate_deg after which a rover stands still",
    )


@dataclass(frozen=True, slots=True)
class Queueing:
    """Limits and order of the waiting tasks."""

    capacity: int = setting(
        1000,
        _count(1, 1e5),
        "maximum number of waiting tasks per rover",
        parameter=(8, "TSK_QUEUE_MAX"),
    )
    quota: int = setting(
        500,
        _count(1, 1e5),
        "maximum number of waiting tasks per client",
        parameter=(9, "TSK_QUOTA"),
    )
    aging: float = setting(
        60.0,
        _seconds(0, DAY),
        "waiting time that raises the priority by one; 0: waiting does not raise it",
    )
    preemption_gap: int = setting(
        0,
        _count(0, 10),
        "priority lead with which a task interrupts the running one; 0: only preemptive tasks do",
        parameter=(10, "TSK_PREEMPT"),
    )
    preemption_rest: float = setting(
        2.0,
        _seconds(0, 3600),
        "minimum running time of a task before another one may interrupt it",
        parameter=(11, "TSK_PREEMPT_S"),
    )
    least_battery_percent: int = setting(
        20,
        _count(0, 100, "%"),
        "charge below which the server chooses no rover for a task that any rover may drive",
        parameter=(21, "TSK_MIN_BATT"),
    )


@dataclass(frozen=True, slots=True)
class Clients:
    """Limits and defaults for clients."""

    max_clients: int = setting(
        64,
        _count(1, 1024),
        "maximum number of clients; a new one replaces the one that was silent longest",
    )
    forget_after: float = setting(
        60.0, _seconds(5, DAY), "a client is removed after this time without a packet"
    )
    push_lost: float = setting(
        5.0,
        _seconds(2, 3600),
        "after this time without a packet, a push address gets heartbeats only",
    )
    stream_interval: float = setting(
        0.1, _seconds(0, 60), "default interval between telemetry messages of one type"
    )
    packet_rate: float = setting(
        2_000.0,
        Number(100, 1e6, "1/s"),
        "maximum rate of datagrams per client; the rest is dropped, except STOP",
    )
    # a serial line lowers it to its capacity
    telemetry_budget: float = setting(
        50_000.0,
        Number(1000, 1e7, "bytes/s"),
        "maximum telemetry of all rovers at one endpoint; lower it for a radio behind a UDP link",
    )
    text_rate: float = setting(
        10.0, Number(1, 1000, "1/s"), "maximum rate of STATUSTEXTs per client"
    )
    status_rate: float = setting(
        50.0, Number(1, 1000, "1/s"), "maximum rate of TASK_STATUS per client"
    )
    #: by address, "255/190", or by address and endpoint, "255/190@127.0.0.1:14550"
    priorities: Mapping[str, int] = setting(
        {},
        ByClient(_count(0, HIGHEST_PRIORITY), example=7),
        "priority of standard commands by MAVLink address of the client; default 5",
    )


@dataclass(frozen=True, slots=True)
class Retention:
    """How long the store keeps finished tasks; None: for ever."""

    max_age: float | None = setting(
        30 * DAY,
        Number(0, 36_500, "days", DAY, none=FOREVER),
        "finished tasks are deleted after this time",
        key="store.keep_days",
        is_live=False,
        options=(Option("--keep-days", "DAYS"),),
    )
    max_count: int | None = setting(
        10_000,
        Number(0, 1e9, "tasks", is_whole=True, none=FOREVER),
        "maximum number of finished tasks; the oldest are deleted first",
        key="store.keep_tasks",
        is_live=False,
        options=(Option("--keep-tasks", "COUNT"),),
    )


@dataclass(frozen=True, slots=True)
class Identity:
    """The server's MAVLink addresses."""

    system_id: int = setting(
        250,
        _count(1, HIGHEST_ID),
        "MAVLink system id of the server on links to rovers",
        is_live=False,
    )
    component_id: int = setting(
        191,
        _count(2, 252),  # 1 is the autopilot; the server may use 3 more ids
        "MAVLink component id of the server, also within each rover's system",
        is_live=False,
    )


@dataclass(frozen=True, slots=True)
class Signing:
    """Rules for MAVLink 2 signatures; the keys are in the key ring, not in the settings."""

    #: also the time by which any sender's timestamp may be ahead of the clock
    window: float = setting(
        60.0,
        _seconds(1, DAY),
        "maximum clock difference of a new sender, and maximum delay of a known sender's packet",
    )
    #: whatever the reaction, the client's rights do not change
    setup: str = setting(
        "known",
        Choice(("known", "refuse")),
        "reaction to a client's SETUP_SIGNING; known: sign to it if the key is in the key ring",
    )


#: roles of clients, from the least rights to the most
ROLES = ("observer", "submitter", "operator", "safety")
#: kinds of tasks, as limits name them
TASK_KINDS = ("move", "rotate", "drive", "goto", "return", "wait", "act", "plan")


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits of a role, or of one key; they apply to each client separately."""

    tasks: tuple[str, ...] = setting(
        TASK_KINDS,
        Texts(f"a list of {', '.join(TASK_KINDS)}", words=TASK_KINDS),
        "kinds of tasks that this role may submit",
    )
    max_priority: int = setting(10, _count(0, 10), "highest priority of this role's tasks")
    max_speed: float = setting(10.0, Number(0.05, 100, "m/s"), "speed limit of this role's tasks")
    max_distance: float = setting(
        1e6,
        Number(0.1, 1e7, "m"),
        "maximum way of one of this role's tasks; one of unknown length is refused",
    )
    quota: int = setting(
        100_000,
        _count(0, 1e6),
        "maximum number of waiting tasks per client; queueing.quota limits it, too",
    )
    #: on average; bursts of up to 5 s worth are allowed
    rate: float = setting(
        200.0,
        Number(1, 1e5, "1/s"),
        "maximum rate of requests per client; STOP is never limited",
    )

    def within(self, other: "Limits") -> "Limits":
        """Return limits that keep within both these and others."""
        least = {
            each.name: min(getattr(self, each.name), getattr(other, each.name))
            for each in fields(self)
        }
        return Limits(
            **least | {"tasks": tuple(kind for kind in self.tasks if kind in other.tasks)}
        )


@dataclass(frozen=True, slots=True)
class Roles:
    """Roles and their limits. A signing client has the role of its key, whatever its address."""

    unsigned: str = setting(
        "safety", Choice(ROLES), "role of clients that do not sign, on links that allow it"
    )
    #: by address, or by address and endpoint, as in ``Clients.priorities``
    addresses: Mapping[str, str] = setting(
        {},
        ByClient(Choice(ROLES), example="observer"),
        "role of unsigned clients by MAVLink address; the others have roles.unsigned",
    )
    observer: Limits = field(default_factory=Limits)
    submitter: Limits = field(default_factory=Limits)
    operator: Limits = field(default_factory=Limits)
    safety: Limits = field(default_factory=Limits)


@dataclass(frozen=True, slots=True)
class VehicleProfile:
    """A probe's measurements of one vehicle; unknown values are "" or None.

    The fields are the keys of a profile's file, each with its meaning unless the name says it.
    """

    system_id: int = setting(0, _count(1, HIGHEST_ID), "")
    uid: str = setting(
        "", Text("the rover's unique id, in hex"), "the profile is used only for this rover"
    )
    autopilot: str = setting("", Text("name of the autopilot"), "")  # of the persona
    #: version and hash, as AUTOPILOT_VERSION has them
    firmware: str = setting("", Text("version of the firmware"), "and only with this firmware")
    probed: str = setting("", Text("a time, UTC"), "")
    yaw_rate: str = setting(
        "", Choice(("honoured", "ignored")), "whether it follows yaw rates, also on the spot"
    )
    reverse: str = setting("", Choice(("yes", "no")), "whether it drives backwards")
    turning: str = setting(
        "",
        Choice(tuple([each.value for each in Turning])),
        "whether it turns on the spot, or steers like a car",
    )
    turning_radius: float | None = setting(
        None, Number(0.1, 50, "m"), "minimum, if it steers like a car"
    )
    #: such as "BODY_NED 0x05C7"
    setpoints: tuple[str, ...] = setting(
        (), Texts("a list of setpoints"), "velocity setpoints that it followed: frame and mask"
    )
    loss_stop: str = setting(
        "", Choice(("yes", "no")), "whether it stopped by itself when setpoints stopped"
    )
    setpoint_timeout: float | None = setting(
        None, _seconds(0, 60), "from the last setpoint until it slowed down"
    )
    speed: float | None = setting(None, Number(0.01, 10, "m/s"), "at which the stop was measured")
    stopping_distance: float | None = setting(
        None, Number(0, 100, "m"), "from the first zero until it stood"
    )
    stopping_time: float | None = setting(
        None, _seconds(0, 60), "from the first zero until it stood"
    )


@dataclass(frozen=True, slots=True)
class Settings:
    """The settings of the engine."""

    identity: Identity = field(default_factory=Identity)
    signing: Signing = field(default_factory=Signing)
    roles: Roles = field(default_factory=Roles)
    driving: Driving = field(default_factory=Driving)
    watch: Watch = field(default_factory=Watch)
    queueing: Queueing = field(default_factory=Queueing)
    clients: Clients = field(default_factory=Clients)
    retention: Retention = field(default_factory=Retention)
    arming: str = setting(
        "auto",
        Choice(("auto", "server", "operator")),
        "who arms the rovers; auto: the server on loopback links, else the operator",
        key="rules.arming",
        is_live=False,
        options=(Option("--arming", "WHO"),),
    )
    #: if ignored, they are steered by course, and neither turn on the spot nor reverse
    yaw_rate: str = setting(
        "ignored",
        Choice(("honoured", "ignored")),
        "whether PX4 and generic rovers follow yaw rates",
        key="rules.yaw_rate",
        is_live=False,
    )
    loss_failsafe: str = setting(
        "must_stand",
        Choice(("must_stand", "accept")),
        "a rover that would keep moving when setpoints stop: make its tasks wait, or drive it",
        key="rules.loss_failsafe",
    )
    claim: bool = setting(
        True,
        Flag(),
        "whether standard commands and modes sent to the autopilot also become tasks",
        key="rules.claim",
    )
    guided: str = setting(
        "queue",
        Choice(("queue", "now")),
        'a "go to" that changes the mode (DO_REPOSITION, guided item): queue it, or run it at once',
        key="rules.guided",
        parameter=(19, "TSK_GUIDED"),
    )
    operator_lost: str = setting(
        "continue",
        Choice(("continue", "pause")),
        "what tasks do if no ground station is heard any more",
        key="rules.operator_lost",
        parameter=(16, "TSK_ON_OPLOST"),
    )
    on_failure: str = setting(
        "pause",
        Choice(("pause", "continue")),
        "what the queue does after a task moved the rover and failed",
        key="rules.on_failure",
        parameter=(17, "TSK_ON_FAIL"),
    )
    on_restart: str = setting(
        "pause",
        Choice(("pause", "continue")),
        "what queues do after a crash, or after a break of more than ten minutes",
        key="rules.on_restart",
        parameter=(18, "TSK_ON_RESTART"),
    )
    on_takeover: str = setting(
        "hold",
        Choice(("hold", "resume")),
        "what a rover's interrupted task does after another gateway of the fleet has failed: wait"
        " for a release, or resume once the rover stands on the task's line",
        key="rules.on_takeover",
        parameter=(20, "TSK_ON_TAKEOVER"),
    )
    #: measurements of vehicles; each is used only for the vehicle that it was measured on
    profiles: tuple[VehicleProfile, ...] = ()


@dataclass(frozen=True, slots=True)
class Links:
    """Links to clients and vehicles; for the URLs see ``links/url.py``."""

    clients: tuple[str, ...] = setting(
        ("udpin:127.0.0.1:14560",),
        Texts(f"a list of {URL}", least=1),
        "links for clients",
        is_live=False,
        options=(Option("--client", "URL"),),
    )
    push: tuple[str, ...] = setting(
        ("127.0.0.1:14550", "127.0.0.1:14540"),
        Texts("a list of host:port"),
        "UDP addresses where clients listen; the server sends there first",
        is_live=False,
        options=(
            Option("--push", "HOST:PORT"),
            Option("--no-push", sets=[], help="Use no push addresses."),
        ),
    )
    vehicles: tuple[str, ...] = setting(
        ("udpout:127.0.0.1:14580",),
        Texts(f"a list of {URL}", least=1),
        "links to rovers",
        is_live=False,
        options=(Option("--vehicle", "URL"),),
    )
    insecure: bool = setting(
        False,
        Flag(),
        "allow unsigned links that other machines can reach",
        is_live=False,
        options=(Option("--insecure", sets=True),),
    )
    keys: str = setting(
        "",
        Text('a path, "" for the one in your configuration folder'),
        "key ring file",
        key="signing.keys",
        is_live=False,
        options=(Option("--keys", "FILE"),),
    )
    unsigned: str = setting(
        "loopback",
        Choice(("loopback", "nowhere")),
        "links that accept unsigned packets, unless the URL of a link says otherwise",
        key="signing.unsigned",
        is_live=False,
    )


@dataclass(frozen=True, slots=True)
class Recording:
    """Recordings of a run, beside the store."""

    tlog: str = setting(
        "",
        Text('a folder, "" for none'),
        "folder for telemetry logs",
        is_live=False,
        options=(Option("--tlog", "FOLDER"),),
    )
    tlog_size: int = setting(
        50_000_000,
        _count(1e5, 1e10, "bytes"),
        "maximum size of a telemetry log; then a new one begins",
        is_live=False,
    )
    tlog_files: int = setting(
        10,
        _count(1, 1e4),
        "maximum number of telemetry logs; the oldest is deleted first",
        is_live=False,
    )
    decisions: str = setting(
        "",
        Text('a folder, "" for none'),
        "folder for records for mav-tasks replay, one per run",
        is_live=False,
        options=(Option("--record", "FOLDER"),),
    )
    decisions_size: int = setting(
        200_000_000,
        _count(1e5, 1e11, "bytes"),
        "maximum size of a record; it ends there",
        is_live=False,
    )


@dataclass(frozen=True, slots=True)
class Metrics:
    """Figures of the running server for Prometheus, over HTTP."""

    listen: str = setting(
        "",
        Text('host:port, "" for none'),
        "address at which the server offers its metrics over HTTP; other machines can read "
        "them unless it is a loopback address",
        is_live=False,
        options=(
            Option(
                "--metrics",
                "[HOST:PORT]",
                bare=METRICS_ADDRESS,
                help="Offer metrics for Prometheus over HTTP, at "
                f"{METRICS_ADDRESS} unless you name another address.",
            ),
        ),
    )


@dataclass(frozen=True, slots=True)
class Log:
    """The server's log on standard error."""

    format: str = setting(
        "text",
        Choice(("text", "json")),
        "format of the log",
        is_live=False,
        options=(Option("--log-json", sets="json", help="Log JSON, one object per line."),),
    )
    level: str = setting(
        "info",
        Choice(("debug", "info", "warning", "error")),
        "lowest level that is logged; start with debug to log new addresses on links, too",
        options=(Option("--verbose", sets="debug", help="Log more details.", short="-v"),),
    )


@dataclass(frozen=True, slots=True)
class Gateway:
    """A server that shares rovers and store with others."""

    name: str = setting(
        "",
        Text('a name of this server in its fleet, "" for a server that shares nothing'),
        "name of this gateway of a fleet; the fleet's store is a PostgreSQL database",
        key="fleet.gateway",
        is_live=False,
        options=(Option("--gateway", "NAME"),),
    )
    address: str = setting(
        "",
        Text('an IP address, "" for the one from which the database is reached'),
        "IP address at which the other gateways of the fleet reach this machine",
        key="fleet.address",
        is_live=False,
    )


@dataclass(frozen=True, slots=True)
class ServerSettings:
    """All settings of one server process: links, store, engine, recordings, metrics and log."""

    links: Links = field(default_factory=Links)
    store: str = setting(
        "",
        Text(
            "a path, postgresql://USER@HOST/DATABASE,"
            ' ":memory:" for no store, "" for mav-tasks.sqlite3 in your data folder'
        ),
        "SQLite file or PostgreSQL database of the tasks",
        key="store.path",
        is_live=False,
        variable="MAV_TASKS_STORE",  # older than the rule for names of variables
        options=(Option("--store", "PATH|URL|:memory:"),),
    )
    gateway: Gateway = field(default_factory=Gateway)
    engine: Settings = field(default_factory=Settings)
    profiles: str = setting(
        "",
        Text('a file or folder, "none", "" for the folder vehicles in your configuration folder'),
        "profiles of rovers, written by mav-tasks probe",
        key="vehicles.profiles",
    )
    recording: Recording = field(default_factory=Recording)
    metrics: Metrics = field(default_factory=Metrics)
    log: Log = field(default_factory=Log)


#: tables of the file, in the order of the sample
TABLES = (
    "links",
    "store",
    "fleet",
    "signing",
    "roles",
    "vehicles",
    "driving",
    "rules",
    "queueing",
    "clients",
    "watch",
    "identity",
    "recording",
    "metrics",
    "log",
)
#: all keys by name: by table, then as the fields come
KEYS: Mapping[str, Key] = {
    key.name: key
    for key in sorted(keys_of(ServerSettings), key=lambda key: TABLES.index(key.table))
}
#: pairs of a key and the key that bounds it
BOUNDED = tuple((key, KEYS[key.at_most]) for key in KEYS.values() if key.at_most)
