"""``python -m rover_sim`` is ``mav-tasks sim``."""

import typer

from rover_sim.app import sim

app = typer.Typer(add_completion=False, rich_markup_mode=None, pretty_exceptions_enable=False)
app.command()(sim)

if __name__ == "__main__":
    app(prog_name="mav-tasks sim")
