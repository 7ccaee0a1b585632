"""A scripted vehicle and client, with just enough behaviour for the server to serve them."""

import socket
from time import monotonic

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.address import Address
from mav_tasks.mavlink.codec import Decoder, Encoder
from mav_tasks.mavlink.enums import MavAutopilot, MavResult, MavState, MavType
from mav_tasks.mavlink.packet import split_datagram

from .child import HOST

VEHICLE = Address(1, 1)
CLIENT = Address(245, 190)
HOLD = 4  # ArduPilot Rover's mode number
MEET_WITHIN = 5.0  # s
QUIET = 0.3  # s without a request: the server has completed its requests


class ScriptedVehicle:
    """A disarmed ArduPilot rover in HOLD that accepts every command and executes none."""

    def __init__(self, sock: socket.socket) -> None:
        self._socket = sock
        self._encoder = Encoder(VEHICLE)
        self._decoder = Decoder()
        self.server: tuple[str, int] | None = None

    def answer(self, *, wait: float) -> bool:
        """Receive one datagram and answer it; return whether one came in time."""
        self._socket.settimeout(wait)
        try:
            data, self.server = self._socket.recvfrom(2048)
        except TimeoutError:
            return False
        for packet in split_datagram(data):
            message = self._decoder.decode(packet)
            if isinstance(message, m.CommandLong):
                self.acknowledge(message)
            elif isinstance(message, m.Heartbeat):
                self.beat()
        return True

    def acknowledge(self, command: m.CommandLong) -> None:
        """Accept a command."""
        self.send(m.CommandAck(command.command, MavResult.ACCEPTED))

    def beat(self) -> None:
        """Send a heartbeat."""
        self.send(
            m.Heartbeat(
                MavType.GROUND_ROVER, MavAutopilot.ARDUPILOTMEGA, 1, HOLD, MavState.STANDBY, 3
            )
        )

    def send(self, message: m.Message) -> None:
        """Send a message to the server."""
        assert self.server is not None, "the server is heard first"
        self._socket.sendto(self._encoder.encode(message), self.server)


def meet(vehicle: ScriptedVehicle, client: socket.socket, server: tuple[str, int]) -> None:
    """Make vehicle and client known to the server, and wait until its requests end."""
    end = monotonic() + MEET_WITHIN
    while vehicle.answer(wait=QUIET) or vehicle.server is None:
        if monotonic() > end:
            break
    client.sendto(Encoder(CLIENT).encode(ground_station()), server)
    client.recv(2048)  # the vehicle's heartbeat, with which the server introduces it


def loopback(port: int) -> tuple[str, int]:
    """Return the loopback address with a port."""
    return (HOST, port)


def ground_station() -> m.Heartbeat:
    """Return the heartbeat of a ground station."""
    return m.Heartbeat(MavType.GCS, MavAutopilot.INVALID, 0, 0, MavState.ACTIVE, 3)
