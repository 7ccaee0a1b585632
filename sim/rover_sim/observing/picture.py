"""Pictures of tracks, north up, by matplotlib."""

from collections.abc import Mapping, Sequence
from math import ceil, sqrt
from pathlib import Path

from rover_sim.observing.track import Place

SIDE = 4.0  # inches, of one panel


def draw(tracks: Mapping[str, Sequence[Place]], path: Path) -> None:
    """Write a PNG with a panel for each track, by its name. Raise ImportError."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: PLC0415  # takes a second
    from matplotlib.figure import Figure  # noqa: PLC0415

    columns = ceil(sqrt(len(tracks)))
    rows = ceil(len(tracks) / columns)
    size = max(SIDE * columns, 6.0), max(SIDE * rows, 6.0)
    figure = Figure(figsize=size, layout="constrained")
    for number, (name, places) in enumerate(tracks.items(), start=1):
        axes = figure.add_subplot(rows, columns, number, title=name)
        axes.plot([p.east for p in places], [p.north for p in places])
        for label, place, marker in (("start", places[0], "o"), ("end", places[-1], "s")):
            axes.plot(place.east, place.north, marker, label=label)
        axes.set(xlabel="east, m", ylabel="north, m")
        axes.set_aspect("equal", adjustable="datalim")
        axes.grid(visible=True, alpha=0.3)
        axes.legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    FigureCanvasAgg(figure).print_figure(path, dpi=100)
