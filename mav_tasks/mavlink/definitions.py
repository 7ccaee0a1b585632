"""Where the XML definitions of the dialect are, for generators of other languages (mavgen).

``mav_tasks.xml`` includes ``common.xml``, which pymavlink ships; ``base_additions.xml`` has what an
older ``common.xml`` lacks. An installed package has both beside its code, a checkout in
``dialects``.
"""

from pathlib import Path

DIALECT = "mav_tasks.xml"


def folder_of_definitions() -> Path:
    """Return the folder of the XML files. FileNotFoundError if this installation has none."""
    here = Path(__file__).resolve().parent
    for folder in (here / "xml", here.parents[1] / "dialects"):
        if (folder / DIALECT).is_file():
            return folder
    raise FileNotFoundError(f"{here / 'xml' / DIALECT}: this installation lacks it")
