"""Compile the pure packages with mypyc: extension modules that do the same in less time.

`tools/hatch_build.py` runs this while a wheel is built, if MAV_TASKS_COMPILE is set. The sources
stay in the wheel, and without the extension modules Python runs them.

    python tools/compile_core.py OUTPUT     the extension modules, with their folders
"""

import os
import shutil
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from contextlib import redirect_stdout
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
#: what takes part in each packet, each step of a task and each set-point
COMPILED = ("mavlink", "services", "kinds/guidance.py", "kinds/path.py", "tasks", "engine")
#: the store and the records read the annotations of these classes, which mypyc does not keep
STORED = tuple(f"tasks/{name}.py" for name in ("task", "timing", "goal", "events"))
#: generated, and built when they are first needed: nothing to gain
LEFT_OUT = (*STORED, "mavlink/_dialect.py", "mavlink/layout.py")
#: of the extension module that has all the code; each module has a small one beside its source
GROUP = "mav_tasks_core"
OPTIMISATION, DEBUG_SYMBOLS = "2", "0"


def sources(package: Path) -> list[Path]:
    """Return the modules to compile, below the package's folder."""
    left_out = {package / name for name in LEFT_OUT}
    return sorted(
        path
        for name in COMPILED
        for path in (
            (package / name).rglob("*.py") if (package / name).is_dir() else [package / name]
        )
        if path not in left_out and path.name != "__init__.py"
    )


def compile_core(output: Path) -> list[Path]:
    """Compile into the output folder; return the paths of the extension modules within it."""
    with tempfile.TemporaryDirectory() as folder:
        # The project's own settings are not for this build, and its tree stays clean.
        shutil.copytree(ROOT / "mav_tasks", Path(folder, "mav_tasks"))
        before = Path.cwd()
        os.chdir(folder)
        try:
            _build(sources(Path("mav_tasks")))
        finally:
            os.chdir(before)
        made = [
            path.relative_to(folder)
            for path in Path(folder).rglob(f"*{EXTENSION_SUFFIXES[0]}")
            if "build" not in path.relative_to(folder).parts
        ]
        for path in made:
            (output / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.move(Path(folder, path), output / path)
    return sorted(made)


def _build(paths: list[Path]) -> None:
    import setuptools._distutils.ccompiler as compilers  # noqa: PLC0415
    from mypyc.build import mypycify  # noqa: PLC0415
    from setuptools import setup  # noqa: PLC0415

    options = ["--ignore-missing-imports", "--explicit-package-bases", "--follow-imports=silent"]
    modules = mypycify(
        ["--config-file=", "--python-version", f"3.{sys.version_info.minor}", *options]
        + [str(path) for path in paths],
        opt_level=OPTIMISATION,
        debug_level=DEBUG_SYMBOLS,
        multi_file=True,
        group_name=GROUP,
    )
    compilers.CCompiler.compile = _compile_side_by_side
    setup(name="core", ext_modules=modules, packages=[], script_args=["-q", "build_ext", "-i"])


def _compile_side_by_side(compiler: Any, files: list[str], *options: Any, **more: Any) -> list[str]:
    """Compile C files on all processors; setuptools takes one after the other."""
    flags = dict(zip(("output_dir", "macros", "include_dirs", "debug"), options, strict=False))
    flags |= more
    _, objects, after, definitions, made = compiler._setup_compile(
        flags.get("output_dir"),
        flags.get("macros"),
        flags.get("include_dirs"),
        files,
        flags.get("depends"),
        flags.get("extra_postargs"),
    )
    arguments = compiler._get_cc_args(definitions, flags.get("debug"), flags.get("extra_preargs"))

    def compile_one(name: str) -> None:
        if name in made:
            source, suffix = made[name]
            compiler._compile(name, source, suffix, arguments, after, definitions)

    with ThreadPoolExecutor(os.cpu_count()) as pool:
        list(pool.map(compile_one, objects))
    return list(objects)


if __name__ == "__main__":
    with redirect_stdout(sys.stderr):  # the compilers write there, too
        made = compile_core(Path(sys.argv[1]).resolve())
    print(*made, sep="\n")
