"""Reading again: what can change is handed over, the rest is told; a fault changes nothing."""

import asyncio
import logging
import threading
from collections.abc import Mapping
from pathlib import Path

import pytest

from mav_tasks.config.configuration import Configuration, Sources
from mav_tasks.config.reload import Put, Reload, changes_of, taken
from mav_tasks.errors import ConfigError
from mav_tasks.settings import KEYS, ServerSettings, Settings


class Watched(Reload):
    """One of which it can be awaited that it has read."""

    def __init__(self, sources: Sources, configuration: Configuration) -> None:
        super().__init__(sources, configuration)
        self.outcomes = asyncio.Queue[ServerSettings | ConfigError]()

    def _has_read(self, outcome: ServerSettings | ConfigError, put: Put) -> None:
        super()._has_read(outcome, put)
        self.outcomes.put_nowait(outcome)

    async def outcome(self) -> ServerSettings | ConfigError:
        return await asyncio.wait_for(self.outcomes.get(), 10)


class Server:
    """Takes settings as the runner does."""

    def __init__(self, parameters: Mapping[str, float] | None = None) -> None:
        self.put: list[Settings] = []
        self._parameters = parameters or {}

    def take(self, settings: Settings) -> Mapping[str, float]:
        self.put.append(settings)
        return self._parameters


def with_plain(values: Mapping[str, object]) -> ServerSettings:
    settings = ServerSettings()
    for name, plain in values.items():
        settings = KEYS[name].put(settings, KEYS[name].shape.kept(plain))
    return settings


def write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def read_again(
    path: Path, texts: list[str], caplog: pytest.LogCaptureFixture, server: Server
) -> list[str]:
    """Start with the first text, read each of the others in turn; gives what was said."""

    async def run() -> None:
        for text in texts[1:]:
            write(path, text)
            reload.begin(server.take)
            await reload.outcome()

    write(path, texts[0])
    sources = Sources(str(path), {})
    reload = Watched(sources, sources.load())
    try:
        with caplog.at_level(logging.DEBUG, "mav_tasks"):
            asyncio.run(run())
    finally:
        logging.getLogger("mav_tasks").setLevel(logging.NOTSET)
    return [f"{record.levelname} {record.getMessage()}" for record in caplog.records]


def test_what_can_change_is_in_force_and_the_rest_says_that_it_is_not(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    server = Server()
    old = "[driving]\nspeed = 0.5\n[rules]\narming = 'auto'\n"
    new = "[driving]\nspeed = 0.8\nturn_rate_deg = 30\n[rules]\narming = 'server'\n"
    said = read_again(tmp_path / "c.toml", [old, new, new, old], caplog, server)
    still = 'WARNING rules.arming: "auto" -> "server" needs a restart: still "auto"'
    assert said == [
        "INFO driving.speed: 0.5 -> 0.8 m/s, in force",
        "INFO driving.turn_rate_deg: 40 -> 30 deg/s, in force",
        still,
        still,
        "INFO driving.speed: 0.8 -> 0.5 m/s, in force",
        "INFO driving.turn_rate_deg: 30 -> 40 deg/s, in force",
    ]
    assert [put.driving.speed for put in server.put] == [0.8, 0.5]
    assert all(put.arming == "auto" for put in server.put)


def test_a_file_with_faults_changes_nothing(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    server, path = Server(), tmp_path / "c.toml"
    said = read_again(
        path, ["", "driving.speed = 0.8\ndriving.sped = 1\nx = 2\n", ""], caplog, server
    )
    assert said == [
        f"ERROR configuration: {path}:2: driving.sped: no such key; did you mean driving.speed?",
        f"ERROR configuration: {path}:3: x: no such key",
        "ERROR configuration: not applied, the old one stays in force",
        "INFO configuration: reloaded, no changes",
    ]
    assert server.put == []


def test_what_a_client_has_set_stays_and_is_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    server = Server({"TSK_SPEED": 0.7})
    assert read_again(tmp_path / "c.toml", ["", "driving.speed = 0.8"], caplog, server) == [
        (
            "WARNING driving.speed: 0.5 -> 0.8 m/s, "
            "but parameter TSK_SPEED, set by a client, overrides it: 0.7"
        )
    ]


def test_a_file_that_is_gone_is_a_fault_and_not_the_defaults(tmp_path: Path) -> None:
    path = tmp_path / "c.toml"
    path.write_text("driving.speed = 0.8", encoding="utf-8")
    sources = Sources(None, {"MAV_TASKS_CONFIG": str(path)})
    reload = Watched(sources, sources.load())
    path.unlink()

    async def run() -> str:
        reload.begin(Server().take)
        return str(await reload.outcome())

    assert asyncio.run(run()) == f"{path}: No such file or directory"


def test_the_level_of_the_log_changes(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    server = Server()
    said = read_again(
        tmp_path / "c.toml",
        ["", "log.level = 'debug'", "log.level = 'warning'\nlog.format = 'json'"],
        caplog,
        server,
    )
    assert said == [
        'INFO log.level: "info" -> "debug", in force',
        'WARNING log.format: "text" -> "json" needs a restart: still "text"',
    ]  # the last change of the level is no warning itself
    assert server.put == []


def test_a_slow_disk_keeps_nobody_and_what_is_asked_meanwhile_is_done_after_it(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """Also not the end: the loop is over while a read still hangs."""
    disk, reads = threading.Event(), threading.Semaphore(0)

    class Slow(Sources):
        def load(self) -> Configuration:
            reads.release()
            disk.wait(10)
            return super().load()

    async def run() -> None:
        reload = Watched(Slow("", {}), Sources("", {}).load())
        for _ in range(3):
            reload.begin(Server().take)
        assert await asyncio.to_thread(reads.acquire, timeout=10)
        assert not reads.acquire(blocking=False)  # one at a time
        disk.set()
        await reload.outcome()
        await reload.outcome()
        disk.clear()
        reload.begin(Server().take)

    with caplog.at_level(logging.INFO, "mav_tasks"):
        asyncio.run(run())
    disk.set()
    assert [record.getMessage() for record in caplog.records].count(
        "configuration: still reloading; it will be read once more"
    ) == 2


def test_an_own_mistake_is_told_and_does_not_leave_it_reading(
    caplog: pytest.LogCaptureFixture,
) -> None:
    class Broken(Sources):
        def load(self) -> Configuration:
            raise ZeroDivisionError

    async def run() -> None:
        reload = Watched(Broken("", {}), Sources("", {}).load())
        reload.begin(Server().take)
        await reload.outcome()

    with caplog.at_level(logging.INFO, "mav_tasks"):
        asyncio.run(run())
    assert "configuration: not applied, the old one stays in force" in [
        each.getMessage() for each in caplog.records
    ]


def test_of_a_bound_between_what_changes_and_what_does_not_both_stay() -> None:
    """A period of setpoints above the time after which one is late would hold every task."""
    before = with_plain({"watch.setpoint_period": 0.2, "watch.late_tick": 0.5})
    wanted = with_plain({"watch.setpoint_period": 0.05, "watch.late_tick": 0.1, "driving.speed": 1})
    got = taken(before, wanted)
    assert got == with_plain(
        {"watch.setpoint_period": 0.2, "watch.late_tick": 0.5, "driving.speed": 1}
    )
    told = list(map(str, changes_of(before, wanted, in_force=got)))
    assert told == [
        "driving.speed: 0.5 -> 1 m/s",
        "watch.setpoint_period: 0.2 -> 0.05 s needs a restart: still 0.2",
        "watch.late_tick: 0.5 -> 0.1 s needs a restart: still 0.5",
    ]


def test_links_store_identity_recordings_and_metrics_are_as_they_were_at_the_start() -> None:
    assert {name for name, key in KEYS.items() if not key.is_live} == {
        *(
            name
            for name in KEYS
            if name.startswith(
                ("links.", "store.", "identity.", "recording.", "metrics.", "fleet.")
            )
        ),
        *("rules.arming", "rules.yaw_rate", "watch.setpoint_period", "log.format"),
        *("signing.keys", "signing.unsigned"),
    }
