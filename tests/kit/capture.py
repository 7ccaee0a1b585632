"""Records a server's packets to its rover with their times: a proxy that changes nothing."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from struct import iter_unpack

from mav_tasks.links.memory import Conditions
from tests.kit.lossy_udp import LossyUdp, _Way

SETPOINT = 84  # SET_POSITION_TARGET_LOCAL_NED
SPEEDS = slice(10 + 16, 10 + 28)  # its vx, vy, vz


def moves(speeds: bytes) -> bool:
    """Return whether velocities, as on the wire, move a rover; a PX4 stands on 1 mm/s."""
    return any(not abs(speed) < 0.002 for (speed,) in iter_unpack("<f", speeds.ljust(12, b"\0")))


class Capture(LossyUdp):
    """A proxy between the server and one rover that forwards everything at once."""

    def __init__(self, rover_port: int) -> None:
        super().__init__(rover_port, Conditions(), seed=0)
        #: per setpoint: UTC seconds, and whether it moves the rover
        self.setpoints: list[tuple[float, bool]] = []

    @property
    def url(self) -> str:
        """The server's URL for the rover."""
        return f"udpout:127.0.0.1:{self.port}"

    @property
    def moving(self) -> list[float]:
        """Return the times of setpoints, from the first moving one to the last."""
        moved = [number for number, (_, moves) in enumerate(self.setpoints) if moves]
        return [at for at, _ in self.setpoints[moved[0] : moved[-1] + 1]]

    def _put_under_way(self, way: _Way, data: bytes) -> None:
        if way.traffic is self.to_server and data[7] == SETPOINT:
            self.setpoints.append((self.arrived_at, moves(data[SPEEDS])))
        super()._put_under_way(way, data)


@contextmanager
def captured(rover_port: int) -> Iterator[Capture]:
    """Run a capture for a ``with`` block."""
    with closing(Capture(rover_port)) as capture:
        yield capture
