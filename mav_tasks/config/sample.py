"""The sample configuration file: each key with its meaning, and its default commented out."""

from itertools import groupby
from textwrap import wrap

from mav_tasks.config.setting_keys.key import Key
from mav_tasks.config.setting_keys.literals import literal
from mav_tasks.config.settings import KEYS, ServerSettings
from mav_tasks.config.words import variable_of

WIDTH = 100
OPENING = f"""\
#: Configuration of mav-tasks. Each key is listed with its default; remove the "# " before a key to
#: change it. Environment variables override this file ({variable_of("driving.speed")} is
#: driving.speed), options of the command line override both, and parameters set by clients override
#: all. `mav-tasks config check FILE` checks a file; `mav-tasks config show` prints the values in
#: force and their sources.
#: On SIGHUP the server applies changes of the keys marked *; the others need a restart.
"""


def sample() -> str:
    parts = [OPENING]
    for table, keys in groupby(KEYS.values(), key=lambda key: key.table):
        parts += [f"\n[{table}]\n", *map(_entry, keys)]
    return "".join(parts)


def _entry(key: Key) -> str:
    valid = f"{key.shape.valid}; at most {key.at_most}" if key.at_most else key.shape.valid
    words = f"{'* ' if key.is_live else ''}{key.meaning} ({valid})"
    told = "".join(f"#: {line}\n" for line in wrap(words, WIDTH - 3, break_long_words=False))
    _, _, last = key.name.partition(".")
    return f"{told}# {last} = {literal(key.plain_of(ServerSettings()))}\n"
