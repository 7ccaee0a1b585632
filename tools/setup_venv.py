"""Create or update `.venv`; the next run repairs an interrupted one.

`tools/setup` calls it with the interpreter for a new environment. Standard library only: nothing is
installed yet. Concurrent runs wait for each other. An environment that was not made here is used
unchanged and never removed.
"""

import argparse
import fcntl
import hashlib
import os
import platform
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
VENV_PYTHON = VENV / "bin" / "python"
LOCKS = ROOT / "tools" / "lock"
#: Installable sets, and their locks. DEVELOPMENT includes DEMO, at the same versions.
DEMO, DEVELOPMENT = "demo", "development"
LOCK_OF = {DEMO: LOCKS / "demo.txt", DEVELOPMENT: LOCKS / "requirements.txt"}
LOCK_WITHOUT_DEPENDENCIES = ROOT / "tools" / "lock" / "without_dependencies.txt"
DIALECT = ROOT / "mav_tasks" / "mavlink" / "_dialect.py"
#: Inputs of the environment. Written last; "unfinished" while a new one is being made.
STAMP = VENV / ".mav-tasks-setup"
UNFINISHED = "unfinished\n"
#: the first has no windows and no menus: it opens a page with a quarter of the processor time
BROWSERS = ("chromium-headless-shell", "chromium", "chromium-browser", "google-chrome")
#: A change of any of these requires an update.
INPUTS = (
    "pyproject.toml",
    "tools/lock/demo.txt",
    "tools/lock/requirements.txt",
    "tools/lock/without_dependencies.txt",
    "tools/setup_venv.py",
    "tools/hatch_build.py",
    "tools/hatch_readme.py",
    "tools/build_dialect.py",
    "dialects/mav_tasks.xml",
    "dialects/base_additions.xml",
)


class SetupError(Exception):
    """The environment could not be made; the message has the reason."""


def is_current(wanted: str) -> bool:
    """Return whether the environment is current. Run with the environment's own interpreter."""
    return DIALECT.is_file() and _serves(wanted, platform.python_version())


def set_up(wanted: str) -> None:
    with _one_at_a_time():
        version = _usable_version()
        if version and _serves(wanted, version) and DIALECT.is_file():
            return  # a concurrent run has done it
        if wanted == DEMO and version and _was_for(DEVELOPMENT):
            wanted = DEVELOPMENT  # keep the larger set
        if version is None:
            _create()
        elif _read_stamp():
            STAMP.write_text(UNFINISHED, encoding="utf-8")
        _run(
            "2/4 installing the pinned packages (minutes, the first time)",
            _pip_install("--require-hashes", "-r", str(LOCK_OF[wanted])),
        )
        if wanted == DEVELOPMENT:
            _run(
                "3/4 installing what is pinned without its dependencies",
                _pip_install("--require-hashes", "--no-deps", "-r", str(LOCK_WITHOUT_DEPENDENCIES)),
            )
        _run(
            "4/4 installing mav-tasks itself, editable, with its MAVLink dialect",
            _pip_install("--no-deps", "--no-build-isolation", "--editable", str(ROOT)),
        )
        # pip does not compile editable packages; the dialect is large enough to notice.
        _call([str(VENV_PYTHON), "-m", "compileall", "-q", str(DIALECT)])
        version = _version_of(VENV_PYTHON) or ""
        STAMP.write_text(_stamp(version, wanted), encoding="utf-8")
        _say(f"ready: {VENV.name} has Python {version}{_note_on_pybullet()}")


def lacks_browser() -> bool:
    """Return whether there is no Chromium."""
    return not any(shutil.which(name) for name in BROWSERS)


def install_browser() -> None:
    """Install Chromium where that is possible; else say that its tests will be skipped."""
    if not lacks_browser():
        return
    if os.geteuid() != 0 or shutil.which("apt-get") is None:
        _say("no browser: it takes root and apt-get; the tests of the web page are skipped")
        return
    _say("installing Chromium with apt-get (a minute)")
    try:
        environment = os.environ | {"DEBIAN_FRONTEND": "noninteractive"}
        for command in (["apt-get", "-q", "update"], ["apt-get", "-qy", "install", BROWSERS[0]]):
            subprocess.run(command, check=True, capture_output=True, text=True, env=environment)
    except subprocess.CalledProcessError as error:
        last = (error.stderr or error.stdout).strip().splitlines()[-1:]
        _say(f"no browser: {' '.join(error.cmd)} failed: {' '.join(last)}")


def _usable_version() -> str | None:
    """Return the Python version of a usable or updatable environment; None: make a new one."""
    stamp = _read_stamp()
    if stamp == UNFINISHED or not VENV.exists() or not any(VENV.iterdir()):
        return None
    version = _version_of(VENV_PYTHON)
    if stamp is None:
        if version is None or tuple(map(int, version.split(".")[:2])) < (3, 11):
            raise SetupError(
                f"{VENV} was not made by tools/setup, and has no Python 3.11 or later with pip: "
                "remove it and run this again"
            )
        return version
    # The folder was moved or copied, or Python replaced: scripts and links point elsewhere.
    return version if version and stamp.splitlines()[0] == _origin(version) else None


def _create() -> None:
    _say(f"1/4 creating {VENV.name} with Python {platform.python_version()}")
    _remove_old()
    VENV.mkdir()
    STAMP.write_text(UNFINISHED, encoding="utf-8")
    _call([sys.executable, "-m", "venv", str(VENV)])


def _remove_old() -> None:
    # Rename first: an interrupted removal must not leave a partial environment under this name.
    if VENV.exists():
        VENV.rename(ROOT / f".venv.old-{os.getpid()}")
    for old in ROOT.glob(".venv.old-*"):
        shutil.rmtree(old)


def _serves(wanted: str, version: str) -> bool:
    """Return whether the wanted set is installed, in exactly these versions."""
    return _read_stamp() in (_stamp(version, wanted), _stamp(version, DEVELOPMENT))


def _was_for(wanted: str) -> bool:
    return (_read_stamp() or "").splitlines()[-1:] == [wanted]


def _stamp(version: str, wanted: str) -> str:
    digest = hashlib.sha256()
    for name in INPUTS:
        digest.update((ROOT / name).read_bytes())
    return f"{_origin(version)}\n{digest.hexdigest()}\n{wanted}\n"


def _origin(version: str) -> str:
    return f"Python {version} in {ROOT}"


def _read_stamp() -> str | None:
    try:
        return STAMP.read_text(encoding="utf-8")
    except OSError:
        return None


def _version_of(python: Path) -> str | None:
    command = [str(python), "-c", "import platform, pip; print(platform.python_version())"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return done.stdout.strip()


def _pip_install(*arguments: str) -> list[str]:
    quiet = ("--no-input", "--disable-pip-version-check", "--progress-bar=off")
    # Compiling every module took half of the set-up; Python compiles each one at its first import.
    return [str(VENV_PYTHON), "-m", "pip", "install", *quiet, "--no-compile", *arguments]


def _run(step: str, command: list[str]) -> None:
    """Run pip; show a counter of packages on a terminal, and its output only if it fails."""
    begin = time.monotonic()
    _say(step)
    said: list[str] = []
    packages = 0
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, cwd=ROOT
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            said.append(line)
            packages += line.startswith(("Collecting", "Requirement already"))
            if sys.stdout.isatty():
                doing = "installing them" if line.startswith("Installing") else "found"
                print(f"\r\033[K    {packages} packages {doing}", end="", flush=True)
    if sys.stdout.isatty():
        print("\r\033[K", end="")
    if process.returncode:
        raise SetupError(f"{' '.join(command)} failed:\n{''.join(said[-30:])}")
    _say(f"    done in {time.monotonic() - begin:.0f} s")


def _call(command: list[str]) -> None:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SetupError(f"{' '.join(command)} failed:\n{done.stdout}{done.stderr}")


def _note_on_pybullet() -> str:
    done = subprocess.run(
        [str(VENV_PYTHON), "-c", "import pybullet"], capture_output=True, check=False
    )
    if done.returncode == 0:
        return " and pybullet"
    return (
        ", without pybullet: the simulated rover has its kinematic body. pybullet has wheels for "
        "Python 3.11 on Linux x86-64; to get it there, install python3.11 or uv, remove .venv and "
        "run this again"
    )


@contextmanager
def _one_at_a_time() -> Iterator[None]:
    # A lock on an existing file leaves nothing behind, and ends with the process.
    with LOCK_OF[DEVELOPMENT].open(encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            _say("another set-up is running; waiting for it")
            fcntl.flock(file, fcntl.LOCK_EX)
        yield


def _say(text: str) -> None:
    print(f"setup: {text}", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description="Create or update .venv (see tools/setup).")
    parser.add_argument(
        "--is-current", action="store_true", help="do nothing; 0 if there is nothing to do"
    )
    parser.add_argument(
        "--browser",
        action="store_true",
        help="also install Chromium for the tests of the web page, with apt as root",
    )
    parser.add_argument(
        "wanted", nargs="?", choices=LOCK_OF, default=DEVELOPMENT, help="default: %(default)s"
    )
    arguments = parser.parse_args()
    if arguments.is_current:
        is_done = is_current(arguments.wanted) and not (arguments.browser and lacks_browser())
        return 0 if is_done else 1
    try:
        with ThreadPoolExecutor(1) as beside:
            browser = beside.submit(install_browser) if arguments.browser else None
            set_up(arguments.wanted)
            if browser is not None:
                browser.result()
    except SetupError as error:
        print(f"setup: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nsetup: interrupted; the next run goes on from here", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
