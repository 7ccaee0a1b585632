"""``mav-tasks export``: recordings as an MCAP file."""

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, BinaryIO

import typer

from mav_tasks.basics.errors import UsageError, missing
from mav_tasks.basics.whole_file import replacing
from mav_tasks.cli import output
from mav_tasks.cli.options import Json
from mav_tasks.recording.mcap_export.convention import RAW

PRIVATE = 0o600  # as the recordings are


def export(
    files: Annotated[
        list[Path], typer.Argument(metavar="FILE...", help="Telemetry logs and records.")
    ],
    mcap: Annotated[Path, typer.Option(metavar="OUT", help="MCAP file to make of them.")],
    json: Json = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
) -> None:
    """Convert recordings to MCAP, for Foxglove and Lichtblick.

    Reads what serve --tlog and serve --record write. Needs the extra mcap.
    """
    try:
        from mav_tasks.recording.mcap_export.exporting import export as export_recordings  # noqa: PLC0415
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != "mcap":
            raise
        raise UsageError(f"export {missing('mcap', 'mcap')}") from error
    with _new_file(mcap, files, force=force) as file:
        counts = export_recordings(files, file)
    words = f"{mcap}: {counts.packets} packets and {counts.events} events"
    if counts.raw_only:
        words += f"; {counts.raw_only} packets could not be decoded and are in {RAW} only"
    if counts.other_bytes:
        words += f"; {counts.other_bytes} bytes belong to no packet"
    output.say_done(
        json,
        "export",
        words,
        file=str(mcap),
        packets=counts.packets,
        events=counts.events,
        raw_only=counts.raw_only,
        other_bytes=counts.other_bytes,
    )


@contextmanager
def _new_file(path: Path, inputs: Sequence[Path], *, force: bool) -> Iterator[BinaryIO]:
    """Open a new file, which takes its place when the block ends, or is removed after an exception.

    Raise UsageError if it may not take that place, or cannot be written.
    """
    try:
        if path.exists():
            if not path.is_file():
                raise UsageError(f"{path}: not a file")
            if any(each.exists() and each.samefile(path) for each in inputs):
                raise UsageError(f"{path} is also read: name another file")
            if not force:
                raise UsageError(f"{path} exists; use --force to overwrite it")
        with replacing(Path(os.path.realpath(path)), mode=PRIVATE) as file:
            yield file
    except OSError as error:
        raise UsageError(f"{path}: {error.strerror}") from error
