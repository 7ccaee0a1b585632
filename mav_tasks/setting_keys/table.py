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
URL = "link URLs: udpin:host:port, udpout:, tcpin: and tcp: alike, serial:device:baud"

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
    _key("links.clients", Texts(f"a list of {URL}", least=1), "where clients come in", live=False),
    _key(
        "links.push",
        Texts("a list of host:port"),
        "where clients listen on UDP and are spoken to unasked",
        live=False,
    ),
    _key("links.vehicles", Texts(f"a list of {URL}", least=1), "where rovers are", live=False),
    _key("links.insecure", Flag(), "whether other machines may reach a link unsigned", live=False),
)
_SIGNING = (
    _key(
        "signing.keys",
        Text('a path, "" for the one in your configuration folder'),
        "where the key ring is",
        field="links.keys",
        live=False,
    ),
    _key(
        "signing.unsigned",
        Choice(("loopback", "nowhere")),
        "where unsigned packets are taken, unless a link's URL says otherwise",
        field="links.unsigned",
        live=False,
    ),
    _key(
        "signing.window",
        _seconds(1, DAY),
        "so far a sender's clock may be off, and a packet of a known one be late",
        field="engine.signing.window",
    ),
    _key(
        "signing.setup",
        Choice(("known", "refuse")),
        "what SETUP_SIGNING of a client does: sign to it, if the key is one of ours, or nothing",
        field="engine.signing.setup",
    ),
)
_ROLES = (
    _key("roles.unsigned", Choice(ROLES), "of who does not sign, where that is allowed"),
    _key(
        "roles.addresses",
        ByClient(Choice(ROLES), example="observer"),
        "of unsigned clients by their address; of others roles.unsigned",
    ),
    *(
        key
        for role in ROLES
        for key in (
            _key(
                f"roles.{role}.tasks",
                Texts(f"a list of {', '.join(TASK_KINDS)}", words=TASK_KINDS),
                "kinds of tasks that it may submit",
            ),
            _key(
                f"roles.{role}.max_priority",
                Number(0, 10, is_whole=True),
                "highest priority of its tasks",
            ),
            _key(f"roles.{role}.max_speed", Number(0.05, 100, "m/s"), "its tasks drive no faster"),
            _key(
                f"roles.{role}.quota",
                Number(0, 1e6, is_whole=True),
                "tasks of each client that may wait, within queueing.quota",
            ),
            _key(
                f"roles.{role}.rate",
                Number(1, 1e5, "1/s"),
                "requests of each client that are taken in; STOP is never too many",
            ),
        )
    ),
)
_STORE = (
    _key(
        "store.path",
        Text('a path, ":memory:" for none, "" for the one in your data folder'),
        "where tasks are kept",
        field="store",
        live=False,
    ),
    _key(
        "store.keep_days",
        Number(0, 36_500, "days", DAY, none=FOREVER),
        "finished tasks are forgotten after so long",
        field="engine.retention.max_age",
        live=False,
    ),
    _key(
        "store.keep_tasks",
        Number(0, 1e9, "tasks", is_whole=True, none=FOREVER),
        "finished tasks kept at the most; the oldest go first",
        field="engine.retention.max_count",
        live=False,
    ),
)
_VEHICLES = (
    _key(
        "vehicles.profiles",
        Text('a file or folder, "none" for none, "" for the folder in your configuration'),
        "what mav-tasks probe has measured of each rover",
    ),
)
_DRIVING = (
    _key(
        "driving.speed",
        Number(0.05, 10, "m/s"),
        "speed of a task that names none",
        at_most="driving.max_speed",
    ),
    _key(
        "driving.max_speed",
        Number(0.05, 10, "m/s"),
        "a faster wish is refused, and nothing is driven faster",
    ),
    _key(
        "driving.turn_rate_deg",
        Number(1, 360, "deg/s", DEGREE),
        "turn rate of a task that names none",
        field="turn_rate",
        at_most="driving.max_turn_rate_deg",
    ),
    _key(
        "driving.max_turn_rate_deg",
        Number(1, 360, "deg/s", DEGREE),
        "a faster wish is refused, and nothing is turned faster",
        field="max_turn_rate",
    ),
    _key("driving.max_distance", Number(1, 1e6, "m"), "a longer move is refused"),
    _key(
        "driving.max_turn_deg",
        Number(1, 360_000, "deg", DEGREE),
        "a longer rotation is refused",
        field="max_turn",
    ),
    _key(
        "driving.max_duration",
        _seconds(1, DAY),
        "a longer drive at constant velocity is refused",
    ),
    _key(
        "driving.acceleration",
        Number(0.05, 5, "m/s2"),
        "acceleration of setpoints, and the deceleration that is planned for",
    ),
    _key(
        "driving.turn_acceleration_deg",
        Number(1, 3600, "deg/s2", DEGREE),
        "the same for turning",
        field="turn_acceleration",
    ),
    _key("driving.arrival_distance", Number(0.001, 1, "m"), "a move is done this near to its end"),
    _key(
        "driving.arrival_angle_deg",
        Number(0.05, 10, "deg", DEGREE),
        "a rotation is done this near to its end",
        field="arrival_angle",
    ),
    _key(
        "driving.settle_distance",
        Number(0.001, 2, "m"),
        "a move is done this near to its end where the rover can come no nearer",
    ),
    _key(
        "driving.settle_angle_deg",
        Number(0.05, 20, "deg", DEGREE),
        "the same for a rotation",
        field="settle_angle",
    ),
    _key(
        "driving.acceptance_radius",
        Number(0.05, 100, "m"),
        "a plan's place that names no radius is passed within this",
    ),
    _key(
        "driving.turning_radius",
        Number(0.1, 50, "m"),
        "the least of a rover that steers as a car, where nothing else is known of it",
    ),
)
_RULES = (
    _key(
        "rules.arming",
        Choice(ARMING),
        "who arms; auto: the server where the vehicle link is loopback, else the operator",
        live=False,
    ),
    _key(
        "rules.yaw_rate",
        Choice(("honoured", "ignored")),
        "whether PX4 and generic rovers turn at a yaw rate",
        live=False,
    ),
    _key(
        "rules.loss_failsafe",
        Choice(("must_stand", "accept")),
        "whether a rover is driven that would move by itself when setpoints stop",
    ),
    _key(
        "rules.claim",
        Flag(),
        "whether standard commands and modes to the autopilot become tasks, too",
    ),
    _key("rules.guided", Choice(("queue", "now")), 'what a "go to" that changes the mode does'),
    _key(
        "rules.operator_lost",
        Choice(("continue", "pause")),
        "what tasks do when no ground station is heard any more",
    ),
    _key(
        "rules.on_failure",
        Choice(("pause", "continue")),
        "what the queue does after a failed task that had moved",
    ),
    _key(
        "rules.on_restart",
        Choice(("pause", "continue")),
        "what queues do after an unclean end, or a long one",
    ),
)
_QUEUEING = (
    _key("queueing.capacity", Number(1, 1e5, is_whole=True), "tasks that may wait for each rover"),
    _key("queueing.quota", Number(1, 1e5, is_whole=True), "tasks of each client that may wait"),
    _key("queueing.aging", _seconds(0, DAY), "waiting that counts as one priority; 0: none"),
    _key(
        "queueing.preemption_gap",
        Number(0, 10, is_whole=True),
        "priorities by which a task must be more urgent to interrupt another; 0: never",
    ),
    _key(
        "queueing.preemption_rest",
        _seconds(0, 3600),
        "a task runs at least so long before it is interrupted",
    ),
)
_CLIENTS = (
    _key(
        "clients.max_clients",
        Number(1, 1024, is_whole=True),
        "endpoints remembered; beyond, the longest silent is forgotten",
    ),
    _key("clients.forget_after", _seconds(5, DAY), "a client silent for longer is forgotten"),
    _key(
        "clients.push_lost",
        _seconds(2, 3600),
        "an address pushed to that is silent for longer gets heartbeats only",
    ),
    _key(
        "clients.stream_interval",
        _seconds(0, 60),
        "between telemetry messages of one kind, unless asked otherwise",
    ),
    _key(
        "clients.packet_rate",
        Number(100, 1e6, "1/s"),
        "datagrams of one client; beyond, they are not looked at, but for STOP",
    ),
    _key(
        "clients.telemetry_budget",
        Number(1000, 1e7, "bytes/s"),
        "streamed by the rovers behind one endpoint, as clients wish; less for a radio behind UDP",
    ),
    _key("clients.text_rate", Number(1, 1000, "1/s"), "texts to one client at the most"),
    _key("clients.status_rate", Number(1, 1000, "1/s"), "task states to one client at the most"),
    _key(
        "clients.priorities",
        ByClient(Number(0, HIGHEST_PRIORITY, is_whole=True), example=7),
        "priority of a client's standard commands, by its address; of others 5",
    ),
)
# Within these ranges a rover is safe, whatever the other settings are.
_WATCH = (
    _key(
        "watch.setpoint_period",
        _seconds(0.02, 0.2),
        "between setpoints",
        live=False,
        at_most="watch.late_tick",
    ),
    _key(
        "watch.motion_fresh",
        _seconds(0.1, 1),  # the rover drives blind for this long
        "no motion on data older than this",
        at_most="watch.position_lost",
    ),
    _key("watch.position_lost", _seconds(0.2, 10), "position data older than this pauses a task"),
    # only heartbeats show that the rover is armed and in our mode
    _key("watch.heartbeat_lost", _seconds(1.5, 10), "a rover silent for longer is lost"),
    # PX4 leaves OFFBOARD after 1 s without setpoints, and drives on by itself when they come again
    _key("watch.late_tick", _seconds(0.1, 0.9), "a setpoint later than this holds the task"),
    _key(
        "watch.start_timeout",
        _seconds(3, 120),
        "a task that has not begun to drive by then fails",
    ),
    _key(
        "watch.ask_vehicle",
        _seconds(0.3, 5),
        "a mode, or arming, that the rover refuses is asked for again for so long",
    ),
    _key(
        "watch.ready_timeout",
        _seconds(0, 3600),
        "a rover that restarts, or refuses to arm, is waited for so long",
    ),
    _key(
        "watch.lost_timeout",
        _seconds(3, 3600),
        "without the rover, or its position, for so long a task fails",
    ),
    _key(
        "watch.fresh_before_resume",
        _seconds(0, 60),
        "good data for so long before a task that lost the rover goes on by itself",
    ),
    _key("watch.stuck", _seconds(2, 600), "without progress for so long a task fails"),
    _key(
        "watch.operator_lost",
        _seconds(2, 600),
        "without a ground station's heartbeat for so long the operator is lost",
    ),
    _key(
        "watch.other_controller",
        _seconds(0.5, 30),
        "since the last setpoint of somebody else, before a task may drive",
    ),
    _key("watch.commit", _seconds(0.1, 10), "a submission not stored by then is withdrawn"),
    _key(
        "watch.forward_answer",
        _seconds(0.1, 10),
        "a forwarded command that the rover has not answered by then is refused",
    ),
    _key("watch.shutdown", _seconds(0.1, 30), "to stop the rovers in an orderly end"),
    _key(
        "watch.disarm_moving",
        Number(0, 60, "s"),
        "disarm a rover that still moves so long after HOLD was seen; 0: never",
    ),
    _key(
        "watch.stop_unconfirmed",
        _seconds(1, 60),
        "a cancelled task whose rover is not seen to stand by then is held",
    ),
    # a rover driven slower than this seems to stand, and its stop would be confirmed too soon
    _key("watch.still_speed", Number(0.001, 0.1, "m/s"), "a rover slower than this stands"),
    _key(
        "watch.still_turn_rate_deg",
        Number(0.1, 5, "deg/s", DEGREE),
        "the same for turning",
        field="still_turn_rate",
    ),
    # at least two messages of 10 Hz telemetry: a rover that reverses is slow for a moment
    _key("watch.still_time", _seconds(0.2, 5), "below both for so long: it stands still"),
)
_IDENTITY = (
    _key(
        "identity.system_id",
        Number(1, HIGHEST_ID, is_whole=True),
        "MAVLink system of the server on vehicle links",
        live=False,
    ),
    _key(
        "identity.component_id",
        Number(2, 252, is_whole=True),  # 1 is the autopilot; the server may use 3 more ids
        "MAVLink component of the server, also inside each rover's system",
        live=False,
    ),
)
_RECORDING = (
    _key(
        "recording.tlog",
        Text('a folder, "" for none'),
        "where telemetry logs are written",
        live=False,
    ),
    _key(
        "recording.tlog_size",
        Number(1e5, 1e10, "bytes", is_whole=True),
        "of one telemetry log; the next is begun then",
        live=False,
    ),
    _key(
        "recording.tlog_files",
        Number(1, 1e4, is_whole=True),
        "telemetry logs kept at the most; the oldest goes first",
        live=False,
    ),
    _key(
        "recording.decisions",
        Text('a folder, "" for none'),
        "where records that can be replayed are written, one for each run",
        live=False,
    ),
    _key(
        "recording.decisions_size",
        Number(1e5, 1e11, "bytes", is_whole=True),
        "of one such record; it ends there",
        live=False,
    ),
)
_LOG = (
    _key("log.format", Choice(("text", "json")), "how a line of the log looks", live=False),
    _key(
        "log.level",
        Choice(("debug", "info", "warning", "error")),
        "the least that is said; who is heard on links is told only if it is debug from the start",
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
