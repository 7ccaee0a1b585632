"""Starts the demonstration; an interrupt is no error at any moment, imports included."""

import sys
from importlib.util import find_spec

#: of the extra; pybullet is not among them, because there is another body without it
NEEDED = ("matplotlib", "pymavlink", "rich")
NO_DEMO = "demo: %s is not installed: pip install 'mav-tasks[demo]'"
USAGE_ERROR = 2
INTERRUPTED = 130  # as a shell reports SIGINT


def main() -> int:
    """Run it; gives the exit status."""
    missing = next((name for name in NEEDED if find_spec(name) is None), None)
    if missing is not None:
        sys.stderr.write(f"{NO_DEMO % missing}\n")
        return USAGE_ERROR
    from rover_sim.demo.app import main as run  # noqa: PLC0415

    return run()


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.stdout.write("\ndemo: interrupted\n")
        sys.exit(INTERRUPTED)
