"""``mav-tasks export``: recordings as an MCAP file, and telemetry logs back from one."""

import os
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, BinaryIO

import typer

from mav_tasks.cli import output
from mav_tasks.cli.options import Json
from mav_tasks.errors import RecordError, UsageError
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

    Reads what serve --tlog and serve --record write. Needs pip install 'mav-tasks[mcap]'.
    """
    if (mcap is None) == (tlog is None):
        raise UsageError("choose one of --mcap OUT and --tlog OUT")
    if mcap is not None:
        _to_mcap(files, mcap, as_json=json, force=force)
    elif tlog is not None:
        _to_tlog(files, tlog, as_json=json, force=force)


def _to_mcap(files: Sequence[Path], out: Path, *, as_json: bool, force: bool) -> None:
    try:
        from mav_tasks.mcap_export.exporting import export as export_recordings  # noqa: PLC0415
    except ModuleNotFoundError as error:
        raise _without(error) from error
    with _Outputs(files, force=force) as outputs:
        counts = export_recordings(files, outputs.opened(out))
    words = f"{out}: {counts.packets} packets and {counts.events} events"
    if counts.raw_only:
        words += f"; {counts.raw_only} packets that the dialect does not know are only raw"
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
    with _Outputs(files, force=force) as outputs:

        def opened(name: str) -> BinaryIO:
            if out.is_dir():
                paths[name] = out / _checked(name, files[0])
            elif paths:
                words = f"{files[0]}: has several telemetry logs"
                raise UsageError(f"{words}; name a folder for them: --tlog FOLDER")
            else:
                paths[name] = out
            return outputs.opened(paths[name])

        logs = restore(files[0], opened)
    for log in logs:
        path = str(paths[log.name])
        output.say_done(as_json, "export", f"{path}: {log.size} bytes", file=path, bytes=log.size)


class _Outputs:
    """New files, which take their places at the end, or are removed after an exception."""

    def __init__(self, inputs: Sequence[Path], *, force: bool) -> None:
        self._inputs = inputs
        self._force = force
        self._stack = ExitStack()
        self._last = Path()

    def __enter__(self) -> "_Outputs":
        self._stack.__enter__()
        return self

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        try:
            if error is None:
                self._stack.close()
            else:
                self._stack.__exit__(type(error), error, error.__traceback__)
        except OSError as failure:
            raise self._unwritable(failure) from failure
        if isinstance(error, OSError):
            raise self._unwritable(error) from error

    def opened(self, path: Path) -> BinaryIO:
        """Open a new file for ``path``; raise UsageError if it may not take its place."""
        self._last = path
        if path.exists():
            if not path.is_file():
                raise UsageError(f"{path}: not a file")
            if any(each.exists() and each.samefile(path) for each in self._inputs):
                raise UsageError(f"{path} is also read: name another file")
            if not self._force:
                raise UsageError(f"{path} exists; use --force to overwrite it")
        try:
            return self._stack.enter_context(replacing(Path(os.path.realpath(path)), mode=PRIVATE))
        except OSError as error:
            raise self._unwritable(error) from error

    def _unwritable(self, error: OSError) -> UsageError:
        return UsageError(f"{self._last}: {error.strerror}")


def _checked(name: str, source: Path) -> str:
    """Return a name from a file as a file's name; raise RecordError if it is none."""
    if Path(name).name != name or not name.isprintable():
        raise RecordError(f"{source}: has a telemetry log with the name {name!r}")
    return name


def _without(error: ModuleNotFoundError) -> UsageError:
    if error.name is None or error.name.partition(".")[0] != "mcap":
        raise error
    return UsageError("needs the package mcap: pip install 'mav-tasks[mcap]'")
