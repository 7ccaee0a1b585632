"""What the client library says before anybody has answered it, and how it ends."""

import threading

import pytest

from mav_tasks import Client, Key, MavTasksError, SyncClient

NOBODY = "udpout:127.0.0.1:9"
SOON = 5.0  # s on a very busy machine


@pytest.mark.parametrize("key", [b"", b"x" * 31, b"x" * 33, Key("revoked", b"")])
def test_what_is_no_key_is_refused(key: Key | bytes) -> None:
    for make in (lambda: Client(key=key), lambda: SyncClient(key=key).open()):
        with pytest.raises(ValueError, match="a key has 32 bytes"):
            make()
    secret = bytes(range(32))
    assert secret.hex() not in repr(Client(key=secret)) + repr(Key("anna", secret))


def test_links_of_servers_and_strange_link_ids_are_refused() -> None:
    with pytest.raises(MavTasksError, match="are for servers"):
        SyncClient(f"{NOBODY}?key=anna").open()
    for link_id in (-1, 256):
        with pytest.raises(ValueError, match=r"link_id .* not in 0\.\.255"):
            Client(NOBODY, key=bytes(range(32)), link_id=link_id)


def test_a_thread_that_waits_is_told_when_another_one_closes_and_no_thread_is_left() -> None:
    before = threading.active_count()
    client = SyncClient(NOBODY, timeout=60.0)
    client.open()
    with pytest.raises(MavTasksError, match="open already"):
        client.open()
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
    client.close()
    client.close()
    thread.join(SOON)
    assert [isinstance(error, MavTasksError) for error in told] == [True]
    assert threading.active_count() == before
    with pytest.raises(MavTasksError, match="open it first"):
        client.stop()
