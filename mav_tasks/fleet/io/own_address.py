"""The IP address of this machine, as the other gateways of a fleet can reach it."""

import socket
from contextlib import closing

from mav_tasks.store.postgres.address import Address

LOOPBACK = "127.0.0.1"
PORT = "5432"  # PostgreSQL's


def own_address(database: Address) -> str:
    """Return the address from which this machine reaches the database; nothing is sent there."""
    host = database.parameters.get("host", "").split(",")[0]
    port = database.parameters.get("port", PORT).split(",")[0]
    if not host or host.startswith("/"):  # a socket file
        return LOOPBACK
    try:
        family, kind, _, _, there = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
        with closing(socket.socket(family, kind)) as it:
            it.connect(there)
            return str(it.getsockname()[0])
    except OSError:  # the attempt to connect to the database will say why
        return LOOPBACK
