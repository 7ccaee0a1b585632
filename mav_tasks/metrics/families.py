"""The metrics of the task server: every name, kind, meaning and label, declared once."""

from mav_tasks.metrics import process
from mav_tasks.metrics.exposition import PREFIX, Family, Kind


def _family(kind: Kind, name: str, meaning: str, *labels: str) -> Family:
    return Family(f"{PREFIX}{name}", kind, meaning, labels)


BUILD = _family("gauge", "build_info", "Always 1; the labels tell what runs.", "version", "python")
INPUTS = _family(
    "counter", "engine_inputs_total", "Inputs handled: packets, timers, and outcomes of the store."
)

TASKS = _family("gauge", "tasks", "Tasks that have not ended.", "vehicle", "state", "reason")
SUBMITTED = _family(
    "counter",
    "tasks_submitted_total",
    "Tasks that got an id; also those withdrawn as not stored in time.",
    "vehicle",
)
ENDED = _family("counter", "tasks_total", "Tasks that ended.", "vehicle", "outcome", "reason")
INTERRUPTED = _family(
    "counter",
    "task_interruptions_total",
    "Tasks that were paused or held, each time.",
    "vehicle",
    "state",
    "reason",
)
REFUSED = _family(
    "counter", "requests_refused_total", "Refused submissions and requests.", "reason"
)
WAIT = _family("histogram", "task_wait_seconds", "Time from a task's submission to its start.")

QUEUE_LENGTH = _family("gauge", "queue_length", "Tasks that have not started.", "vehicle")
QUEUE_CAPACITY = _family("gauge", "queue_capacity", "Limit of queue_length.", "vehicle")
QUEUE_PAUSED = _family(
    "gauge", "queue_paused", "1 if the queue is paused, and why; 0 if it runs.", "vehicle", "reason"
)
HALTS = _family(
    "counter", "halts_total", "Events that stopped a rover, or would have.", "vehicle", "reason"
)
HALTS_NOT_STORED = _family(
    "counter", "halts_not_stored_total", "Warnings that a restart would lose a halt.", "vehicle"
)

INTERVAL = _family(
    "histogram",
    "setpoint_interval_seconds",
    "Time between two setpoints of a running task.",
    "vehicle",
)
PERIOD = _family(
    "gauge", "setpoint_period_seconds", "Time that should be between two setpoints.", "vehicle"
)
STOP_LATENCY = _family(
    "histogram",
    "stop_latency_seconds",
    "Time from reading a STOP until the rover's zero setpoint was handed to the link.",
)
STOP_STANDSTILL = _family(
    "histogram",
    "stop_standstill_seconds",
    "Time from reading a STOP until the moving rover was measured to stand.",
)

HEARTBEAT_AGE = _family(
    "gauge",
    "vehicle_heartbeat_age_seconds",
    "Age of the rover's last heartbeat; +Inf: none since the server started.",
    "vehicle",
)
POSITION_AGE = _family(
    "gauge",
    "position_age_seconds",
    "Age of the rover's last position; +Inf: none since the server started.",
    "vehicle",
)
CLIENTS = _family("gauge", "clients", "Clients that were heard a short time ago.")

LINK_UP = _family("gauge", "link_up", "1 if the link is open.", "link", "side")
LINK_PACKETS = _family(
    "counter",
    "link_packets_total",
    "Packets sent, and datagrams received (not counted on streams).",
    "link",
    "direction",
)
LINK_BYTES = _family("counter", "link_bytes_total", "Bytes sent and received.", "link", "direction")
LINK_LOST = _family(
    "counter",
    "link_lost_total",
    "Packets that the link could not send: refused by the system, too old, or without a peer.",
    "link",
)
LINK_REFUSED = _family(
    "counter", "link_refused_connections_total", "Connections that the link refused.", "link"
)
CORRUPT = _family("counter", "packets_corrupt_total", "Packets with a wrong checksum.", "side")
FLOODED = _family(
    "counter", "datagrams_dropped_total", "Datagrams of clients above their limit of rate."
)

COMMIT = _family(
    "histogram", "store_commit_seconds", "Time until events were durable, for each write."
)
PENDING = _family("gauge", "store_pending_events", "Events that are not durable yet.")
WRITABLE = _family("gauge", "store_writable", "1 if the last write to the store worked.")
RECORDING_LOST = _family(
    "counter", "recording_lost_packets_total", "Packets that a telemetry log lost."
)

REQUESTS = _family("counter", "metrics_requests_total", "Answers of this HTTP server.", "code")

#: in the order of the text
FAMILIES = (
    *(BUILD, INPUTS),
    *(TASKS, SUBMITTED, ENDED, INTERRUPTED, REFUSED, WAIT),
    *(QUEUE_LENGTH, QUEUE_CAPACITY, QUEUE_PAUSED, HALTS, HALTS_NOT_STORED),
    *(INTERVAL, PERIOD, STOP_LATENCY, STOP_STANDSTILL),
    *(HEARTBEAT_AGE, POSITION_AGE, CLIENTS),
    *(LINK_UP, LINK_PACKETS, LINK_BYTES, LINK_LOST, LINK_REFUSED, CORRUPT, FLOODED),
    *(COMMIT, PENDING, WRITABLE, RECORDING_LOST),
    REQUESTS,
    *process.FAMILIES,
)
