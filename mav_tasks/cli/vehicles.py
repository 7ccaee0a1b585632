"""``mav-tasks vehicles``: show the rovers of the server."""

from mav_tasks.cli import output
from mav_tasks.cli.command import command
from mav_tasks.cli.options import Common
from mav_tasks.cli.session import opened
from mav_tasks.client.json_form import vehicle_json
from mav_tasks.client.telemetry import all_show


@command
async def vehicles(common: Common) -> None:
    """Show the rovers of the server."""
    async with opened(common) as client:
        if not common.json:  # the slow import of Rich, while the first telemetry is on its way
            from mav_tasks.cli.tables import vehicle_table  # noqa: PLC0415
        await all_show(client, lambda each: each.north is not None and each.yaw is not None)
        found = [each for each in client.vehicles() if common.vehicle in (None, each.id)]
    if common.json:
        for each in found:
            output.say_json(vehicle_json(each))
        return
    output.show(vehicle_table(found, width=output.console().width))
