"""The command line with a third kind of store: one line in the registry.

Run it as ``python -m tests.kit.with_third_kinds``.
"""

from mav_tasks.cli.app import main
from mav_tasks.store import opening as stores

if __name__ == "__main__":
    stores.KINDS["shelf:"] = "tests.kit.third_store"
    main()
