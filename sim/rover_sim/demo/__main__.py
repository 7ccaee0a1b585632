"""Starts the demonstration; an interrupt is no error at any moment, imports included."""

import sys

INTERRUPTED = 130  # as a shell reports SIGINT


def main() -> int:
    """Run it; gives the exit status."""
    from rover_sim.demo.app import main as run  # noqa: PLC0415

    return run()


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.stdout.write("\ndemo: interrupted\n")
        sys.exit(INTERRUPTED)
