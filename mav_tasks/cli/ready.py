"""``mav-tasks ready``: the health check of a server, for a service manager or a container."""

from dataclasses import replace
from typing import Annotated

import typer

from mav_tasks.basics.errors import Refused
from mav_tasks.cli import output, words
from mav_tasks.cli.command import command
from mav_tasks.cli.options import Common
from mav_tasks.cli.session import opened
from mav_tasks.client.json_form import vehicle_json
from mav_tasks.client.telemetry import all_show
from mav_tasks.client.values import VehicleStatus

WITHIN = 2.0  # s to wait for an answer


@command
async def ready(
    common: Common,
    wait_for: Annotated[
        float,
        typer.Option(
            "--within",
            min=0.1,
            metavar="SECONDS",
            help="How long to look for the server; --timeout has no effect here.",
        ),
    ] = WITHIN,
) -> None:
    """Check that the server answers and that it hears its rovers.

    Exit status 0: ready; 1: a rover is silent; 3: no server answered, or it has heard no rover.
    """
    async with opened(replace(common, timeout=wait_for)) as client:
        await all_show(client, lambda each: each.is_heard)
        rovers = [each for each in client.vehicles() if common.vehicle in (None, each.id)]
    silent = [_silence(each) for each in rovers if not each.is_heard]
    if common.json:
        shown = [vehicle_json(each) for each in rovers]
        output.say_json({"ready": not silent, "rovers": shown})
    if silent:
        raise Refused(
            f"the server answers, but does not hear {', '.join(silent)}", result=0, reason=0
        )
    if not common.json:
        ids = ", ".join(str(each.id) for each in rovers)
        output.say(f"ready: the server hears rover{'s' if len(rovers) > 1 else ''} {ids}")


def _silence(rover: VehicleStatus) -> str:
    return f"rover {rover.id} ({words.silence_of(rover.heartbeat_age) or 'silent'})"
