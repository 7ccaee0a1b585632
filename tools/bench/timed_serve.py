"""``mav-tasks`` with its arguments, of any revision: at its end it prints when setpoints left.

They are triples as JSON: system id, monotonic time, and the seconds since the moving setpoint
before. The zero that ends a drive leaves at once and is not counted.
"""

import json
import time
from collections.abc import Hashable

from mav_tasks.cli.app import main
from mav_tasks.links.udp import UdpLink

MOVING = 0.1  # s; after a longer interval the stream had ended
SETPOINT = 84  # SET_POSITION_TARGET_LOCAL_NED
FORWARD = slice(10 + 16, 10 + 20)  # offset of vx, and of target_system,
TARGET_SYSTEM = 10 + 50  # in a whole MAVLink 2 packet of it

left: list[tuple[int, float, float]] = []
last: dict[int, float] = {}
send = UdpLink.send


def timed(link: UdpLink, peer: Hashable, data: bytes) -> None:
    """Send, and note when a moving setpoint left."""
    send(link, peer, data)
    if data[7] == SETPOINT and data[8] == 0 and len(data) > TARGET_SYSTEM:
        rover, now = data[TARGET_SYSTEM], time.monotonic()
        interval = now - last.pop(rover, 0.0)
        if any(data[FORWARD]):
            last[rover] = now
            if interval < MOVING:
                left.append((rover, now, interval))


UdpLink.send = timed  # type: ignore[method-assign, assignment]
try:
    main()
finally:
    print(json.dumps(left), flush=True)
