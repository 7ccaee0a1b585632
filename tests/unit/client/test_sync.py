"""SyncClient's own thread: two threads, Ctrl-C and the end, on a link where nobody answers."""

import asyncio
import threading
import time
from collections.abc import Iterator

import pytest

from mav_tasks import SyncClient
from mav_tasks.client import blocking
from mav_tasks.client.blocking import ThreadPortal
from mav_tasks.errors import ClientError, MavTasksError

SOON = 5.0  # s on a very busy machine


@pytest.fixture
def client() -> Iterator[SyncClient]:
    """Return an open client that nobody answers."""
    client = SyncClient("udpout:127.0.0.1:9", timeout=60.0)
    client.open()
    yield client
    client.close()


def test_a_thread_that_waits_is_told_when_another_one_closes(client: SyncClient) -> None:
    told: list[BaseException] = []
    begun = threading.Event()

    def wait() -> None:
        begun.set()
        try:
            client.found()
        except BaseException as error:  # noqa: BLE001 (whatever it is)
            told.append(error)

    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    begun.wait()
    while not client._client or not client._client._served._waiters:  # it waits on the loop
        time.sleep(0.001)
    client.close()
    thread.join(SOON)
    assert not thread.is_alive()
    assert [type(error) for error in told] == [MavTasksError]


def test_the_end_leaves_no_task_and_no_thread(client: SyncClient) -> None:
    before = threading.active_count()
    client.close()
    client.close()
    assert threading.active_count() == before - 1
    with pytest.raises(MavTasksError, match="open it first"):
        client.stop()


def test_what_is_asked_after_the_end_is_said_so() -> None:
    portal = ThreadPortal()

    async def nothing() -> None: ...

    portal.call(nothing())
    portal.close()
    with pytest.raises(ClientError, match="closed"):
        portal.call(nothing())


def test_what_never_ends_by_itself_is_ended(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blocking, "ENDS_BY_ITSELF", 0.0)
    portal = ThreadPortal()
    told: list[str] = []

    async def for_ever() -> None:
        started.set()
        await asyncio.Event().wait()

    def wait() -> None:
        try:
            portal.call(for_ever())
        except BaseException as error:  # noqa: BLE001 (whatever it is)
            told.append(type(error).__name__)

    started = threading.Event()
    thread = threading.Thread(target=wait, daemon=True)
    thread.start()
    started.wait()
    portal.close()
    thread.join(SOON)
    assert told == ["CancelledError"]


def test_a_client_that_is_open_cannot_be_opened_again(client: SyncClient) -> None:
    with pytest.raises(MavTasksError, match="open already"):
        client.open()
