"""All keys of the configuration, in the order of the sample file. Only this file has ranges."""

from collections.abc import Mapping
from math import pi

from mav_tasks.errors import SettingError
from mav_tasks.setting_keys.key import Key
from mav_tasks.setting_keys.literals import in_digits
from mav_tasks.setting_keys.shapes import (
    HIGHEST_ID,
    HIGHEST_PRIORITY,
    ByClient,
    Choice,
    Flag,
    Number,
    Shape,
    Text,
    Texts,
)
from mav_tasks.settings import ARMING, ROLES, TASK_KINDS, ServerSettings

DEGREE = pi / 180  # rad
DAY = 86_400.0  # s
FOREVER = "forever"
URL = "link URLs: udpin:, udpout:, tcpin: or tcp:host:port, or serial:device:baud"

#: table of the file -> path prefix in ServerSettings
PLACES: Mapping[str, str] = {
    "links": "links.",
    "store": "",
    "signing": "",
    "roles": "engine.roles.",
    "vehicles": "",
    "driving": "engine.driving.",
    "rules": "engine.",
    "queueing": "engine.queueing.",
    "clients": "engine.clients.",
    "watch": "engine.watch.",
    "identity": "engine.identity.",
    "recording": "recording.",
    "log": "log.",
}


def _key(
    name: str, shape: Shape, meaning: str, *, field: str = "", live: bool = True, at_most: str = ""
) -> Key:
    table, _, last = name.partition(".")
    return Key(name, PLACES[table] + (field or last), shape, meaning, live, at_most)


def _seconds(low: float, high: float) -> Number:
    return Number(low, high, "s")


_LINKS = (
    _key("links.clients", Texts(f"a list of {URL}", least=1), "links for clients", live=False),
    _key(
        "links.push",
        Texts("a list of host:port"),
        "UDP addresses where clients listen; the server sends there first",
        live=False,
    ),
    _key("links.vehicles", Texts(f"a list of {URL}", least=1), "links to rovers", live=False),
    _key(
        "links.insecure",
        Flag(),
        "whether to allow unsigned links that other machines can reach",
        live=False,
    ),
)
_SIGNING = (
    _key(
        "signing.keys",
        Text('a path, "" for the one in your configuration folder'),
        "key ring file",
        field="links.keys",
        live=False,
    ),
    _key(
        "signing.unsigned",
        Choice(("loopback", "nowhere")),
        "links that accept unsigned packets, unless the URL of a link says otherwise",
        field="links.unsigned",
        live=False,
    ),
    _key(
        "signing.window",
        _seconds(1, DAY),
        "maximum clock difference of a new sender, and maximum delay of a known sender's packet",
        field="engine.signing.window",
    ),
    _key(
        "signing.setup",
        Choice(("known", "refuse")),
        "reaction to a client's SETUP_SIGNING; known: sign to it if the key is in the key ring",
        field="engine.signing.setup",
    ),
)
_ROLES = (
    _key(
        "roles.unsigned", Choice(ROLES), "role of clients that do not sign, on links that allow it"
    ),
    _key(
        "roles.addresses",
        ByClient(Choice(ROLES), example="observer"),
        "role of unsigned clients by MAVLink address; the others have roles.unsigned",
    ),
    *(
        key
        for role in ROLES
        for key in (
            _key(
                f"roles.{role}.tasks",
                Texts(f"a list of {', '.join(TASK_KINDS)}", words=TASK_KINDS),
                "kinds of tasks that this role may submit",
            ),
            _key(
                f"roles.{role}.max_priority",
                Number(0, 10, is_whole=True),
                "highest priority of this role's tasks",
            ),
            _key(
                f"roles.{role}.max_speed",
                Number(0.05, 100, "m/s"),
                "speed limit of this role's tasks",
            ),
            _key(
                f"roles.{role}.quota",
                Number(0, 1e6, is_whole=True),
                "maximum number of waiting tasks per client; queueing.quota limits it, too",
            ),
            _key(
                f"roles.{role}.rate",
                Number(1, 1e5, "1/s"),
                "maximum rate of requests per client; STOP is never limited",
            ),
        )
    ),
)
_STORE = (
    _key(
        "store.path",
        Text('a path, ":memory:" for no file, "" for mav-tasks.sqlite3 in your data folder'),
        "SQLite file of the tasks",
        field="store",
        live=False,
    ),
    _key(
        "store.keep_days",
        Number(0, 36_500, "days", DAY, none=FOREVER),
        "finished tasks are deleted after this time",
        field="engine.retention.max_age",
        live=False,
    ),
    _key(
        "store.keep_tasks",
        Number(0, 1e9, "tasks", is_whole=True, none=FOREVER),
        "maximum number of finished tasks; the oldest are deleted first",
        field="engine.retention.max_count",
        live=False,
    ),
)
_VEHICLES = (
    _key(
        "vehicles.profiles",
        Text('a file or folder, "none", "" for the folder vehicles in your configuration folder'),
        "profiles of rovers, written by mav-tasks probe",
    ),
)
_DRIVING = (
    _key(
        "driving.speed",
        Number(0.05, 10, "m/s"),
        "default speed of tasks",
        at_most="driving.max_speed",
    ),
    _key(
        "driving.max_speed",
        Number(0.05, 10, "m/s"),
        "speed limit; a task that asks for more is refused",
    ),
    _key(
        "driving.turn_rate_deg",
        Number(1, 360, "deg/s", DEGREE),
        "default turn rate of tasks",
        field="turn_rate",
        at_most="driving.max_turn_rate_deg",
    ),
    _key(
        "driving.max_turn_rate_deg",
        Number(1, 360, "deg/s", DEGREE),
        "turn rate limit; a task that asks for more is refused",
        field="max_turn_rate",
    ),
    _key(
        "driving.max_distance",
        Number(1, 1e6, "m"),
        "maximum length of a move, and maximum distance to a place",
    ),
    _key(
        "driving.max_turn_deg",
        Number(1, 360_000, "deg", DEGREE),
        "largest rotation that is accepted",
        field="max_turn",
    ),
    _key(
        "driving.max_duration",
        _seconds(1, DAY),
        "longest drive at constant velocity that is accepted",
    ),
    _key(
        "driving.acceleration",
        Number(0.05, 5, "m/s2"),
        "acceleration and deceleration of setpoints; a rover that brakes less hard overshoots",
    ),
    _key(
        "driving.turn_acceleration_deg",
        Number(1, 3600, "deg/s2", DEGREE),
        "angular acceleration and deceleration of setpoints",
        field="turn_acceleration",
    ),
    _key(
        "driving.arrival_distance",
        Number(0.001, 1, "m"),
        "a move is complete within this distance of its end",
    ),
    _key(
        "driving.arrival_angle_deg",
        Number(0.05, 10, "deg", DEGREE),
        "a rotation is complete within this angle of its end",
        field="arrival_angle",
    ),
    _key(
        "driving.settle_distance",
        Number(0.001, 2, "m"),
        "a move is complete within this distance if the rover cannot get closer",
    ),
    _key(
        "driving.settle_angle_deg",
        Number(0.05, 20, "deg", DEGREE),
        "a rotation is complete within this angle if the rover cannot get closer",
        field="settle_angle",
    ),
    _key(
        "driving.acceptance_radius",
        Number(0.05, 100, "m"),
        "default acceptance radius of mission items",
    ),
    _key(
        "driving.turning_radius",
        Number(0.1, 50, "m"),
        "minimum turning radius of a car-like rover, if its profile and parameters have none",
    ),
)
_RULES = (
    _key(
        "rules.arming",
        Choice(ARMING),
        "who arms the rovers; auto: the server on loopback links, else the operator",
        live=False,
    ),
    _key(
        "rules.yaw_rate",
        Choice(("honoured", "ignored")),
        "whether PX4 and generic rovers follow yaw rates",
        live=False,
    ),
    _key(
        "rules.loss_failsafe",
        Choice(("must_stand", "accept")),
        "a rover that would keep moving when setpoints stop: make its tasks wait, or drive it",
    ),
    _key(
        "rules.claim",
        Flag(),
        "whether standard commands and modes sent to the autopilot also become tasks",
    ),
    _key(
        "rules.guided",
        Choice(("queue", "now")),
        'a "go to" that changes the mode (DO_REPOSITION, guided item): queue it, or run it at once',
    ),
    _key(
        "rules.operator_lost",
        Choice(("continue", "pause")),
        "what tasks do if no ground station is heard any more",
    ),
    _key(
        "rules.on_failure",
        Choice(("pause", "continue")),
        "what the queue does after a task moved the rover and failed",
    ),
    _key(
        "rules.on_restart",
        Choice(("pause", "continue")),
        "what queues do after a crash, or after a break of more than ten minutes",
    ),
)
_QUEUEING = (
    _key(
        "queueing.capacity",
        Number(1, 1e5, is_whole=True),
        "maximum number of waiting tasks per rover",
    ),
    _key(
        "queueing.quota",
        Number(1, 1e5, is_whole=True),
        "maximum number of waiting tasks per client",
    ),
    _key(
        "queueing.aging",
        _seconds(0, DAY),
        "waiting time that raises the priority by one; 0: waiting does not raise it",
    ),
    _key(
        "queueing.preemption_gap",
        Number(0, 10, is_whole=True),
        "priority lead with which a task interrupts the running one; 0: only preemptive tasks do",
    ),
    _key(
        "queueing.preemption_rest",
        _seconds(0, 3600),
        "minimum running time of a task before another one may interrupt it",
    ),
)
_CLIENTS = (
    _key(
        "clients.max_clients",
        Number(1, 1024, is_whole=True),
        "maximum number of clients; a new one replaces the one that was silent longest",
    ),
    _key(
        "clients.forget_after",
        _seconds(5, DAY),
        "a client is removed after this time without a packet",
    ),
    _key(
        "clients.push_lost",
        _seconds(2, 3600),
        "after this time without a packet, a push address gets heartbeats only",
    ),
    _key(
        "clients.stream_interval",
        _seconds(0, 60),
        "default interval between telemetry messages of one type",
    ),
    _key(
        "clients.packet_rate",
        Number(100, 1e6, "1/s"),
        "maximum rate of datagrams per client; the rest is dropped, except STOP",
    ),
    _key(
        "clients.telemetry_budget",
        Number(1000, 1e7, "bytes/s"),
        "maximum telemetry of all rovers at one endpoint; lower it for a radio behind a UDP link",
    ),
    _key("clients.text_rate", Number(1, 1000, "1/s"), "maximum rate of STATUSTEXTs per client"),
    _key("clients.status_rate", Number(1, 1000, "1/s"), "maximum rate of TASK_STATUS per client"),
    _key(
        "clients.priorities",
        ByClient(Number(0, HIGHEST_PRIORITY, is_whole=True), example=7),
        "priority of standard commands by MAVLink address of the client; default 5",
    ),
)
# Within these ranges a rover is safe, whatever the other settings are.
_WATCH = (
    _key(
        "watch.setpoint_period",
        _seconds(0.02, 0.2),
        "interval between setpoints",
        live=False,
        at_most="watch.late_tick",
    ),
    _key(
        "watch.motion_fresh",
        _seconds(0.1, 1),  # the rover drives blind for this long
        "maximum age of position data to drive on",
        at_most="watch.position_lost",
    ),
    _key(
        "watch.position_lost",
        _seconds(0.2, 10),
        "a task is paused if the rover's position data is older than this",
    ),
    # only heartbeats show that the rover is armed and in our mode
    _key(
        "watch.heartbeat_lost",
        _seconds(1.5, 10),
        "a rover is lost after this time without a heartbeat",
    ),
    # PX4 leaves OFFBOARD after 1 s without setpoints, and drives on by itself when they come again
    _key("watch.late_tick", _seconds(0.1, 0.9), "a task is held if a setpoint is later than this"),
    _key(
        "watch.start_timeout",
        _seconds(3, 120),
        "a task fails if the server does not get control of the rover within this time",
    ),
    _key(
        "watch.ask_vehicle",
        _seconds(0.3, 5),
        "how long to repeat a mode or arming request that the rover refuses",
    ),
    _key(
        "watch.ready_timeout",
        _seconds(0, 3600),
        "how long to wait for a rover that restarts or refuses to arm",
    ),
    _key(
        "watch.lost_timeout",
        _seconds(3, 3600),
        "a task fails after this time without the rover or its position",
    ),
    _key(
        "watch.fresh_before_resume",
        _seconds(0, 60),
        "time with good data before a task resumes by itself after a loss",
    ),
    _key("watch.stuck", _seconds(2, 600), "a task fails after this time without progress"),
    _key(
        "watch.operator_lost",
        _seconds(2, 600),
        "the operator is lost after this time without a ground station's heartbeat",
    ),
    _key(
        "watch.other_controller",
        _seconds(0.5, 30),
        "a task waits this long after the last setpoint of another controller",
    ),
    _key(
        "watch.commit",
        _seconds(0.1, 10),
        "a submission is refused if it is not stored within this time",
    ),
    _key(
        "watch.forward_answer",
        _seconds(0.1, 10),
        "a forwarded command is refused if the rover does not answer within this time",
    ),
    _key("watch.shutdown", _seconds(0.1, 30), "maximum time to stop the rovers at shutdown"),
    _key(
        "watch.disarm_moving",
        Number(0, 60, "s"),
        "a rover that should stand is disarmed if it still moves this long after HOLD; 0: never",
    ),
    _key(
        "watch.stop_unconfirmed",
        _seconds(1, 60),
        "a cancelled task is held if its rover does not stand still within this time",
    ),
    # a rover driven slower than this seems to stand, and its stop would be confirmed too soon
    _key(
        "watch.still_speed",
        Number(0.001, 0.1, "m/s"),
        "a rover stands still if its speed stays below this for still_time",
    ),
    _key(
        "watch.still_turn_rate_deg",
        Number(0.1, 5, "deg/s", DEGREE),
        "and if its turn rate stays below this for still_time",
        field="still_turn_rate",
    ),
    # at least two messages of 10 Hz telemetry: a rover that reverses is slow for a moment
    _key(
        "watch.still_time",
        _seconds(0.2, 5),
        "time below still_speed and still_turn_rate_deg after which a rover stands still",
    ),
)
_IDENTITY = (
    _key(
        "identity.system_id",
        Number(1, HIGHEST_ID, is_whole=True),
        "MAVLink system id of the server on links to rovers",
        live=False,
    ),
    _key(
        "identity.component_id",
        Number(2, 252, is_whole=True),  # 1 is the autopilot; the server may use 3 more ids
        "MAVLink component id of the server, also within each rover's system",
        live=False,
    ),
)
_RECORDING = (
    _key(
        "recording.tlog",
        Text('a folder, "" for none'),
        "folder for telemetry logs",
        live=False,
    ),
    _key(
        "recording.tlog_size",
        Number(1e5, 1e10, "bytes", is_whole=True),
        "maximum size of a telemetry log; then a new one begins",
        live=False,
    ),
    _key(
        "recording.tlog_files",
        Number(1, 1e4, is_whole=True),
        "maximum number of telemetry logs; the oldest is deleted first",
        live=False,
    ),
    _key(
        "recording.decisions",
        Text('a folder, "" for none'),
        "folder for records for mav-tasks replay, one per run",
        live=False,
    ),
    _key(
        "recording.decisions_size",
        Number(1e5, 1e11, "bytes", is_whole=True),
        "maximum size of a record; it ends there",
        live=False,
    ),
)
_LOG = (
    _key("log.format", Choice(("text", "json")), "format of the log", live=False),
    _key(
        "log.level",
        Choice(("debug", "info", "warning", "error")),
        "lowest level that is logged; start with debug to log new addresses on links, too",
    ),
)

KEYS: Mapping[str, Key] = {
    key.name: key
    for group in (
        *(_LINKS, _SIGNING, _ROLES, _STORE, _VEHICLES, _DRIVING, _RULES, _QUEUEING),
        *(_CLIENTS, _WATCH, _IDENTITY, _RECORDING, _LOG),
    )
    for key in group
}
#: pairs of a key and the key that bounds it
BOUNDED = tuple((key, KEYS[key.at_most]) for key in KEYS.values() if key.at_most)


def check_bounds(settings: ServerSettings, key: Key, bound: Key) -> None:
    """Raise SettingError if a key's value exceeds the value of its bound."""
    if key.of(settings) > bound.of(settings):
        value, most = (in_digits(float(str(k.plain_of(settings)))) for k in (key, bound))
        raise SettingError(f"{value} is more than {bound.name}, {most} {bound.shape.unit}")
