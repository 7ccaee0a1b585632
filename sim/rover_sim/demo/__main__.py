"""Start the demonstration; handle an interrupt at any moment, even during imports."""

import sys

INTERRUPTED = 130  # the shell's status for SIGINT


def main() -> int:
    """Run the demonstration; return the exit status."""
    from rover_sim.demo.app import main as run  # noqa: PLC0415

    return run()


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.stdout.write("\ndemo: interrupted\n")
        sys.exit(INTERRUPTED)
