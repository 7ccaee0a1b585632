"""What is compiled keeps what the store and the records read."""

from pathlib import Path
from runpy import run_path

from mav_tasks.recording.record_lines import ROWS
from mav_tasks.tasks import events, goal, server_events, task, timing

ROOT = Path(__file__).resolve().parents[3]
tool = run_path(str(ROOT / "tools" / "compile_core.py"))
STORED, sources = tool["STORED"], tool["sources"]
MODULES = (events, goal, server_events, task, timing)


def test_no_class_that_is_stored_is_compiled() -> None:
    """mypyc keeps no annotations, by which the store and the records know their fields."""
    homes = {f"{module.__name__.replace('.', '/')}.py" for module in MODULES}
    assert homes == {f"mav_tasks/{name}" for name in STORED}
    stored = {name for module in MODULES for name in vars(module)}
    assert set(ROWS) <= stored
    compiled = {str(path.relative_to(ROOT)) for path in sources(ROOT / "mav_tasks")}
    assert not homes & compiled


def test_every_other_module_of_the_pure_packages_is_compiled() -> None:
    compiled = sources(ROOT / "mav_tasks")
    assert len(compiled) > 150
    assert all(path.is_file() for path in compiled)
    assert ROOT / "mav_tasks" / "engine" / "engine.py" in compiled
    assert ROOT / "mav_tasks" / "errors.py" not in compiled
