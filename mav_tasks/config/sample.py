"""The sample configuration file: each key with its meaning, and its default commented out."""

from textwrap import wrap

from mav_tasks.config.words import variable_of
from mav_tasks.setting_keys.key import Key
from mav_tasks.setting_keys.literals import literal
from mav_tasks.setting_keys.table import KEYS, PLACES
from mav_tasks.settings import ServerSettings

WIDTH = 100
OPENING = f"""\
#: Configuration of mav-tasks. Each key stands here with its default: take away the "# " before one
#: to change it. An environment variable comes before this file ({variable_of("driving.speed")} for
#: driving.speed), a flag before both. `mav-tasks config check FILE` looks through a file, and
#: `mav-tasks config show` tells what is in force, and who says so.
#: Keys marked * can change while the server runs, by SIGHUP; the others when it starts.
"""


def sample() -> str:
    """Return the text of the sample file."""
    parts = [OPENING]
    for table in PLACES:
        parts.append(f"\n[{table}]\n")
        parts += [_entry(key) for name, key in KEYS.items() if name.startswith(f"{table}.")]
    return "".join(parts)


def _entry(key: Key) -> str:
    valid = f"{key.shape.valid}; at most {key.at_most}" if key.at_most else key.shape.valid
    words = f"{'* ' if key.is_live else ''}{key.meaning} ({valid})"
    told = "".join(f"#: {line}\n" for line in wrap(words, WIDTH - 3, break_long_words=False))
    _, _, last = key.name.partition(".")
    return f"{told}# {last} = {literal(key.plain_of(ServerSettings()))}\n"
