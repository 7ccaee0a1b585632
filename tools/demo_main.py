"""Starts the demonstration; an interrupt is no error at any moment, imports included."""

import sys

if __name__ == "__main__":
    try:
        from demo_lib.app import main

        sys.exit(main())
    except KeyboardInterrupt:
        print("\ndemo: interrupted")
        sys.exit(130)  # as a shell reports SIGINT
