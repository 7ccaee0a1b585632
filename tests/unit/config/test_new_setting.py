"""Adding a setting touches one place: a field of ``settings.py``, in a copy. All forms follow."""

import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]

BEFORE = "    max_distance: float = setting(\n        10_000.0,"
ADDED = """\
    creep: float = setting(
        radians(2),
        Number(1, 9, "deg/s", DEGREE),
        "rate of a slow turn",
        at_most="driving.turn_rate_deg",
        parameter=(22, "TSK_CREEP"),
        options=(Option("--creep", "RATE"), Option("--fast", sets=9, help="Creep fast.")),
    )
"""

SCRIPT = """
import sys
from dataclasses import asdict
from math import radians
from generators.documents import parameters
from mav_tasks import __file__ as where
from mav_tasks.cli.app import app
from mav_tasks.config.configuration import Sources
from mav_tasks.config.reload import taken
from mav_tasks.config.sample import sample
from mav_tasks.config.words import flag_of_set
from mav_tasks.basics.errors import ConfigError
from mav_tasks.recording.surroundings import settings_of
from mav_tasks.config.parameter_table import PARAMETERS, changed
from mav_tasks.config.settings import KEYS, Driving, ServerSettings, Settings

def creep(file="", environment=(), *flags):
    return Sources(file, dict(environment), flags).load().settings.engine.driving.creep

assert where.startswith({copy!r}), where
assert creep() == Settings().driving.creep == radians(2)
line = "#: * rate of a slow turn (1..9 deg/s; at most driving.turn_rate_deg)\\n# creep_deg = 2\\n"
assert line in sample()
with open("c.toml", "w") as file:
    file.write("[driving]\\ncreep_deg = 3\\n")
assert creep("c.toml") == radians(3)
variable = {{"MAV_TASKS_DRIVING_CREEP_DEG": "4"}}
assert creep("c.toml", variable) == radians(4)
assert creep("c.toml", variable, flag_of_set("driving.creep_deg=5")) == radians(5)
try:
    creep("", (), flag_of_set("driving.turn_rate_deg=1"))
except ConfigError as error:
    assert str(error) == "--set driving.turn_rate_deg: driving.creep_deg: 2 is more than " + (
        "driving.turn_rate_deg, 1 deg/s"
    ), error
else:
    raise AssertionError
wanted = KEYS["driving.creep_deg"].put(ServerSettings(), radians(6))
assert taken(ServerSettings(), wanted) == wanted
assert list(PARAMETERS)[-1] == "TSK_CREEP"
assert changed(Settings(), "TSK_CREEP", 7.0).driving == Driving(creep=radians(7))
row = "TSK_CREEP | 1..9 deg/s | rate of a slow turn; at most TSK_TURN"
assert f"| {{row}} |\\n" in parameters()
record = asdict(Settings(driving=Driving(creep=radians(8))))
assert settings_of(record).driving.creep == radians(8)
del record["driving"]["creep"]  # an older record
assert settings_of(record) == Settings()
slow = "--set driving.turn_rate_deg=8 --fast --creep 3"  # --fast is declared last
for arguments in (["--help"], ["--creep", "10"], slow.split()):
    try:
        app(["serve", "--config", "", *arguments], prog_name="mav-tasks")
    except SystemExit:
        pass
    except ConfigError as error:
        print(error)
"""


def test_a_new_setting_is_one_field(tmp_path: Path) -> None:
    copy = tmp_path / "mav_tasks"
    shutil.copytree(ROOT / "mav_tasks", copy, ignore=shutil.ignore_patterns("__pycache__"))
    path = copy / "config" / "settings.py"
    text = path.read_text(encoding="utf-8")
    assert text.count(BEFORE) == 1
    path.write_text(text.replace(BEFORE, ADDED + BEFORE), encoding="utf-8")
    ran = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(copy=str(copy))],
        cwd=tmp_path,
        env={"PYTHONPATH": f"{tmp_path}:{ROOT / 'tools'}", "XDG_CONFIG_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    told = " ".join(ran.stdout.split())
    assert "--creep RATE Rate of a slow turn (1..9 deg/s). Default: 2. --fast Creep fast." in told
    assert "--creep=10: not in 1..9 deg/s" in told
    assert told.endswith("--fast: 9 is more than driving.turn_rate_deg, 8 deg/s")
