"""Child process: event streams of the web page that are read and thrown away, as browsers read."""

import selectors
import signal
import socket
import sys

from .child import HOST, READY

BLOCK = 1 << 16


def main() -> None:
    """Open so many streams of the web process on a port, and read them until SIGTERM."""
    port, count = int(sys.argv[1]), int(sys.argv[2])
    signal.signal(signal.SIGTERM, lambda *_: sys.exit())
    selector = selectors.DefaultSelector()
    request = f"GET /api/v1/events HTTP/1.1\r\nHost: {HOST}:{port}\r\n\r\n".encode()
    for _ in range(count):
        stream = socket.create_connection((HOST, port), 5)
        stream.sendall(request)
        assert stream.recv(12).endswith(b"200")
        selector.register(stream, selectors.EVENT_READ)
    sys.stdout.write(f"{READY}\n")
    sys.stdout.flush()
    while True:
        for key, _ in selector.select():
            key.fileobj.recv(BLOCK)  # type: ignore[union-attr]


if __name__ == "__main__":
    main()
