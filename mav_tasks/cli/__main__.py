"""``python -m mav_tasks.cli`` runs ``mav-tasks``."""

from mav_tasks.cli.app import main

if __name__ == "__main__":
    main()
