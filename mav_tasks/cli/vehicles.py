"""``mav-tasks vehicles``: show the rovers of the server."""

from mav_tasks.cli.command import command
from mav_tasks.cli.options import Common

LOOK = 0.01  # s between two checks
LOOKS = 150  # checks, 1.5 s: telemetry arrives once a second


@command
async def vehicles(common: Common) -> None:
    """Show the rovers of the server."""
    import asyncio  # noqa: PLC0415

    from mav_tasks.cli import output, words  # noqa: PLC0415
    from mav_tasks.cli.session import opened  # noqa: PLC0415

    async with opened(common) as client:
        if not common.json:  # the slow import of Rich, while the first telemetry is on its way
            from mav_tasks.cli.tables import vehicle_table  # noqa: PLC0415
        for _ in range(LOOKS):
            heard = [each for each in client.vehicles() if each.is_heard]
            if all(each.north is not None and each.yaw is not None for each in heard):
                break
            await asyncio.sleep(LOOK)
        found = [each for each in client.vehicles() if common.vehicle in (None, each.id)]
    if common.json:
        for each in found:
            output.say_json(words.vehicle_json(each))
        return
    output.show(vehicle_table(found, width=output.console().width))
