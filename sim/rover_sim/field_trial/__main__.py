"""``python -m rover_sim.field_trial``, which ``tools/field_trial`` runs."""

import sys

from rover_sim.field_trial.app import main

if __name__ == "__main__":
    sys.exit(main())
