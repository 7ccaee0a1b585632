"""A TCP proxy on loopback that can fall silent, as a net that was cut does, or refuse."""

import selectors
import socket
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from threading import Event, Thread

from tests.kit.processes import free_tcp_ports

LOOK = 0.02  # s between two looks at what the test wants


class TcpProxy:
    """Forwards each connection to a port, until ``silent`` or ``refusing``."""

    def __init__(self, to_port: int) -> None:
        self._to = ("127.0.0.1", to_port)
        (self.port,) = free_tcp_ports(1)
        self._is_silent = Event()
        self._is_refusing = Event()
        self._over = Event()
        self._pairs: dict[socket.socket, socket.socket] = {}
        self._stuck: list[socket.socket] = []  # of a net that was cut: open at both ends
        self._selector = selectors.DefaultSelector()
        self._listener = socket.create_server(("127.0.0.1", self.port))
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._thread = Thread(target=self._run, daemon=True)
        self._thread.start()

    def fall_silent(self) -> None:
        """Forward nothing of the connections that exist, for good, and close none of them."""
        self._is_silent.set()
        while self._is_silent.is_set():
            self._over.wait(LOOK)

    @contextmanager
    def refusing(self) -> Iterator[None]:
        """Close every connection, also new ones, during a block."""
        self._is_refusing.set()
        try:
            yield
        finally:
            self._is_refusing.clear()

    def close(self) -> None:
        """End the proxy."""
        self._over.set()
        self._thread.join()
        for each in (self._listener, *self._pairs, *self._stuck):
            each.close()
        self._selector.close()

    def _run(self) -> None:
        while not self._over.is_set():
            if self._is_silent.is_set():
                for each in tuple(self._pairs):
                    self._selector.unregister(each)
                    self._stuck.append(each)
                self._pairs.clear()
                self._is_silent.clear()
            if self._is_refusing.is_set():
                for each in tuple(self._pairs):
                    self._end(each)
            for key, _ in self._selector.select(LOOK):
                found = key.fileobj
                assert isinstance(found, socket.socket)
                if found is self._listener:
                    self._accept()
                elif found in self._pairs:
                    self._forward(found)

    def _accept(self) -> None:
        one, _ = self._listener.accept()
        if self._is_refusing.is_set():
            one.close()
            return
        try:
            other = socket.create_connection(self._to)
        except OSError:
            one.close()
            return
        self._pairs |= {one: other, other: one}
        for each in (one, other):
            self._selector.register(each, selectors.EVENT_READ)

    def _forward(self, source: socket.socket) -> None:
        try:
            data = source.recv(65_536)
            if data:
                self._pairs[source].sendall(data)
                return
        except OSError:
            pass
        self._end(source)

    def _end(self, one: socket.socket) -> None:
        other = self._pairs.get(one)
        if other is None:
            return
        for each in (one, other):
            del self._pairs[each]
            self._selector.unregister(each)
            with suppress(OSError):
                each.close()
