"""``python -m mav_tasks.cli`` runs ``mav-tasks``."""

from mav_tasks.cli.app import main

main()
