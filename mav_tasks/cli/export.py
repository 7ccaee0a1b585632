"""``mav-tasks export``: recordings as an MCAP file, and telemetry logs back from one."""

import os
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated, BinaryIO

import typer

from mav_tasks.cli import output
from mav_tasks.cli.options import Json
from mav_tasks.errors import RecordError, UsageError, missing
from mav_tasks.mcap_export.convention import RAW
from mav_tasks.whole_file import replacing

PRIVATE = 0o600  # as the recordings are


def export(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE...", help="With --mcap: telemetry logs and records; with --tlog: an MCAP."
        ),
    ],
    mcap: Annotated[
        Path | None,
        typer.Option(metavar="OUT", help="MCAP file to make of telemetry logs and records."),
    ] = None,
    tlog: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT",
            help="Telemetry log to make again of an MCAP file; a folder if it has several.",
        ),
    ] = None,
    json: Json = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite an existing file.")] = False,
) -> None:
    """Convert recordings to MCAP, for Foxglove and Lichtblick, or back.

    Reads what serve --tlog and serve --record write. Needs the extra mcap.
    """
    if mcap is not None and tlog is None:
        _to_mcap(files, mcap, as_json=json, force=force)
    elif tlog is not None and mcap is None:
        _to_tlog(files, tlog, as_json=json, force=force)
    else:
        raise UsageError("choose one of --mcap OUT and --tlog OUT")


def _to_mcap(files: Sequence[Path], out: Path, *, as_json: bool, force: bool) -> None:
    try:
        from mav_tasks.mcap_export.exporting import export as export_recordings  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise _without(error) from error
    with _new_file(out, files, force=force) as file:
        counts = export_recordings(files, file)
    words = f"{out}: {counts.packets} packets and {counts.events} events"
    if counts.raw_only:
        words += f"; {counts.raw_only} packets could not be decoded and are in {RAW} only"
    if counts.other_bytes:
        words += f"; {counts.other_bytes} bytes belong to no packet"
    output.say_done(
        as_json,
        "export",
        words,
        file=str(out),
        packets=counts.packets,
        events=counts.events,
        raw_only=counts.raw_only,
        other_bytes=counts.other_bytes,
    )


def _to_tlog(files: Sequence[Path], out: Path, *, as_json: bool, force: bool) -> None:
    try:
        from mav_tasks.mcap_export.restoring import restore  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise _without(error) from error
    if len(files) != 1:
        raise UsageError(f"--tlog takes one MCAP file, not {len(files)}")
    paths: dict[str, Path] = {}
    with ExitStack() as stack:

        def opened(name: str) -> BinaryIO:
            if out.is_dir():
                paths[name] = out / _checked(name, files[0])
            elif paths:
                words = f"{files[0]}: has several telemetry logs"
                raise UsageError(f"{words}; name a folder for them: --tlog FOLDER")
            else:
                paths[name] = out
            return stack.enter_context(_new_file(paths[name], files, force=force))

        logs = restore(files[0], opened)
    for log in logs:
        path = str(paths[log.name])
        output.say_done(as_json, "export", f"{path}: {log.size} bytes", file=path, bytes=log.size)


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


def _checked(name: str, source: Path) -> str:
    """Return a name from a file as a file's name; raise RecordError if it is none."""
    if Path(name).name != name or not name.isprintable():
        raise RecordError(f"{source}: has a telemetry log with the name {name!r}")
    return name


def _without(error: ModuleNotFoundError) -> UsageError:
    if error.name is None or error.name.partition(".")[0] != "mcap":
        raise error
    return UsageError(f"export {missing('mcap', 'mcap')}")
