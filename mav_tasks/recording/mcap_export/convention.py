"""The names in an MCAP file.

dialects/recordings.md describes them. A change that a reader of older files would notice needs a
new VERSION.
"""

from mav_tasks.mavlink.address import Address

VERSION = "1"

#: name of the metadata record that says which convention the file follows
CONVENTION = "mav-tasks"

RAW = "/mavlink/raw"
RAW_ENCODING = "tlog"
#: an empty schema: some programs that copy MCAP files stop at a channel without one
RAW_SCHEMA = "mav_tasks.TlogPiece"
TEXTS = "/texts"
TASK_CHANGES = "/tasks/changes"
TASK_LOG = "/tasks/log"


def message_topic(source: Address, name: str) -> str:
    """Return the topic of the messages of one kind from one component."""
    return f"/mavlink/{source.system_id}/{source.component_id}/{name}"


def rover_topic(rover: int, what: str) -> str:
    """Return a topic of a rover: "pose", "location", "gps"."""
    return f"/rover/{rover}/{what}"


def setpoint_topic(rover: int, sender: Address) -> str:
    """Return the topic of the setpoints from one sender to a rover."""
    return f"/rover/{rover}/setpoints/{sender.system_id}/{sender.component_id}"
