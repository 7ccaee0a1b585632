"""STATUSTEXT for people at ground stations. MAVLink common: STATUSTEXT, chunked by id."""

from mav_tasks.mavlink.enums import MavSeverity
from mav_tasks.mavlink.messages import Statustext

CHUNK = 50  # bytes of text a message
BURST = 10  # texts, before the rate counts


def chunks(severity: MavSeverity, text: str, *, text_id: int) -> list[Statustext]:
    """Return the messages that carry a text of any length.

    ``text_id`` 1–65535 ties the chunks of a long text together; a short one is sent with id 0. A
    tab at the end is cut: QGroundControl drops such texts of a PX4 vehicle.
    """
    data = text.rstrip().encode("ascii", errors="replace")
    if len(data) <= CHUNK:
        return [Statustext(severity, data)]
    ends = len(data) // CHUNK + 1  # a text ends with a chunk that is not full, if need be an empty
    return [
        Statustext(severity, data[number * CHUNK : (number + 1) * CHUNK], text_id, number)
        for number in range(ends)
    ]
