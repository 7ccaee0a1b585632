"""Reading again: what can change is handed over, the rest is told; a fault changes nothing."""

import asyncio
import logging
from collections.abc import Mapping
from pathlib import Path

import pytest

from mav_tasks.config.configuration import Sources
from mav_tasks.config.reload import Reload
from mav_tasks.config.settings import KEYS, Settings

SPEED = "driving.speed: 0.5 -> 0.8 m/s"
NO_SPED = "driving.sped: no such key; did you mean driving.speed?"
NOT_APPLIED = "ERROR configuration: not applied, the old one stays in force"
STILL = 'WARNING rules.arming: "auto" -> "server" needs a restart: still "auto"'


@pytest.mark.parametrize(
    ("texts", "parameters", "said", "speeds"),
    [
        (
            ["", "driving.speed = 0.8\nrules.arming = 'server'\n", "rules.arming = 'server'\n"],
            {},
            [
                *(f"INFO {SPEED}, in force", STILL),
                *("INFO driving.speed: 0.8 -> 0.5 m/s, in force", STILL),
            ],
            [0.8, 0.5],
        ),
        (
            ["", "driving.speed = 0.8\ndriving.sped = 1\nx = 2\n", None, ""],
            {},
            [
                f"ERROR configuration: FILE:2: {NO_SPED}",
                "ERROR configuration: FILE:3: x: no such key",
                NOT_APPLIED,
                "ERROR configuration: FILE: No such file or directory",
                NOT_APPLIED,
                "WARNING configuration: still reloading; it will be read once more",
                *["INFO configuration: reloaded, no changes"] * 2,
            ],
            [],
        ),
        (
            ["", "driving.speed = 0.8"],
            {"TSK_SPEED": 0.7},
            [f"WARNING {SPEED}, but parameter TSK_SPEED, set by a client, overrides it: 0.7"],
            [0.8],
        ),
        (
            ["", "log.level = 'debug'", "log.level = 'warning'\nlog.format = 'json'"],
            {},
            [
                'INFO log.level: "info" -> "debug", in force',
                'WARNING log.format: "text" -> "json" needs a restart: still "text"',
            ],  # the last change of the level is no warning itself
            [],
        ),
        (  # a period of setpoints above the time after which one is late would hold every task
            [
                "[watch]\nsetpoint_period = 0.2\nlate_tick = 0.5",
                "[watch]\nsetpoint_period = 0.05\nlate_tick = 0.1\n[driving]\nspeed = 0.8",
            ],
            {},
            [
                f"INFO {SPEED}, in force",
                "WARNING watch.setpoint_period: 0.2 -> 0.05 s needs a restart: still 0.2",
                "WARNING watch.late_tick: 0.5 -> 0.1 s needs a restart: still 0.5",
            ],
            [0.8],
        ),
    ],
    ids=["live", "faults", "parameter", "log", "bound"],
)
def test_what_can_change_is_in_force_and_the_rest_says_that_it_is_not(
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    texts: list[str | None],
    parameters: Mapping[str, float],
    said: list[str],
    speeds: list[float],
) -> None:
    path, put = tmp_path / "c.toml", list[Settings]()

    def take(settings: Settings) -> Mapping[str, float]:
        put.append(settings)
        return parameters

    async def run() -> None:
        for text in texts[1:]:
            path.unlink()
            if text is not None:
                path.write_text(text, encoding="utf-8")
            before, turns = len(caplog.records), 0
            is_twice = text == ""
            for _ in range(1 + is_twice):
                reload.begin(take)
            while len(caplog.records) <= before + 2 * is_twice and turns < 40:
                await asyncio.sleep(0.05)
                turns += 1
            path.touch()

    path.write_text(texts[0] or "", encoding="utf-8")
    sources = Sources(str(path), {})
    reload = Reload(sources, sources.load())
    try:
        with caplog.at_level(logging.DEBUG, "mav_tasks"):
            asyncio.run(run())
    finally:
        logging.getLogger("mav_tasks").setLevel(logging.NOTSET)
    told = [f"{record.levelname} {record.getMessage()}" for record in caplog.records]
    assert [line.replace(str(path), "FILE") for line in told if "asyncio" not in line] == said
    assert [each.driving.speed for each in put] == speeds
    assert all(each.arming == "auto" for each in put)


def test_links_store_identity_recordings_and_metrics_are_as_they_were_at_the_start() -> None:
    tables = ("links.", "store.", "identity.", "recording.", "metrics.", "fleet.")
    assert {name for name, key in KEYS.items() if not key.is_live} == {
        *(name for name in KEYS if name.startswith(tables)),
        *("rules.arming", "rules.yaw_rate", "watch.setpoint_period", "log.format"),
        *("signing.keys", "signing.unsigned"),
    }
