"""Records soak lives: ``FOLDER MINUTES SEED ...``; a line on standard output for each life."""

import logging
import sys
from pathlib import Path

from taking_down import Recorders  # type: ignore[import-not-found] # it lies beside this file

from tests.kit.soak.life import live


def main(folder: str, minutes: str, *seeds: str) -> None:
    """Live each life, whatever comes of it."""
    logging.disable(logging.CRITICAL)
    recorders = Recorders(Path(folder))
    recorders.install()
    for seed in seeds:
        try:
            live(int(seed), seconds=float(minutes) * 60)
            told = "lived"
        except Exception as error:  # noqa: BLE001 - its record is good all the same
            told = f"failed: {error}".splitlines()[0]
        recorders.close(f"soak life {seed}")
        print(f"life {seed} {told}", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
