"""The command line with another kind of store and of link: one line each in its registry.

Run it as ``python -m tests.kit.with_third_kinds``.
"""

from mav_tasks.cli.app import main
from mav_tasks.links import url as links
from mav_tasks.store import opening as stores
from tests.kit import third_link

if __name__ == "__main__":
    stores.KINDS["shelf:"] = "tests.kit.third_store"
    links.KINDS |= dict.fromkeys(("unixin", "unix"), third_link.KIND)
    main()
