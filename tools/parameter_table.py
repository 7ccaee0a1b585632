"""Write the table of parameters into the wire contract; `--check` reports if it is outdated."""

import sys

from generated import keep_current
from mav_tasks.config.parameter_table import NAMES, PARAMETERS, Parameter

CONTRACT = "dialects/parameters.md"
HEAD = "| parameter | range | what it sets |\n|---|---|---|\n"


def table() -> str:
    """Return the table, in the order of the indices."""
    return HEAD + "".join(map(_row, PARAMETERS.values()))


def _row(parameter: Parameter) -> str:
    key = parameter.key
    about = f"{key.meaning}; at most {NAMES[key.at_most]}" if key.at_most else key.meaning
    if parameter.choices:
        numbered = enumerate(parameter.choices)
        about += f": {', '.join(f'{number} {word}' for number, word in numbered)}"
    unit = key.shape.unit.replace("s2", "s²")
    limits = f"{parameter.low:.7g}..{parameter.high:.7g} {unit}".strip()
    return f"| {parameter.name} | {limits} | {about} |\n"


if __name__ == "__main__":
    sys.exit(keep_current(CONTRACT, "parameter table", "parameter_table.py", table()))
