"""What a server sends to its rover, with the time of each packet: a proxy that only looks."""

from collections.abc import Iterator
from contextlib import closing, contextmanager
from struct import iter_unpack
from time import monotonic

from mav_tasks.links.memory import Conditions
from tests.kit.lossy_udp import LossyUdp, _Way

SETPOINT = 84  # SET_POSITION_TARGET_LOCAL_NED
SPEEDS = slice(10 + 16, 10 + 28)  # vx, vy, vz of it


def moves(speeds: bytes) -> bool:
    """Whether velocities, as they are on the wire, move a rover; a PX4 stands on 1 mm/s."""
    return any(not abs(speed) < 0.002 for (speed,) in iter_unpack("<f", speeds.ljust(12, b"\0")))


class Capture(LossyUdp):
    """Stands between the server and one rover, and passes everything on at once."""

    def __init__(self, rover_port: int) -> None:
        super().__init__(rover_port, Conditions(), seed=0)
        #: when each setpoint came, monotonic seconds, and whether it was to move the rover
        self.setpoints: list[tuple[float, bool]] = []

    @property
    def url(self) -> str:
        """Where the server finds the rover."""
        return f"udpout:127.0.0.1:{self.port}"

    @property
    def moving(self) -> list[float]:
        """Return when setpoints came, from the first that moved the rover to the last."""
        moved = [number for number, (_, moves) in enumerate(self.setpoints) if moves]
        return [at for at, _ in self.setpoints[moved[0] : moved[-1] + 1]]

    def _put_under_way(self, way: _Way, data: bytes) -> None:
        if way.traffic is self.to_server and data[7] == SETPOINT:
            self.setpoints.append((monotonic(), moves(data[SPEEDS])))
        super()._put_under_way(way, data)


@contextmanager
def captured(rover_port: int) -> Iterator[Capture]:
    """Run one while the block runs."""
    with closing(Capture(rover_port)) as capture:
        yield capture
