"""An operation is declared once, in ``client/operations.py``: all surfaces have it, or a reason."""

import shutil
import subprocess
import sys
from pathlib import Path
from unittest.mock import MagicMock

from mav_tasks.agents.driving import driving
from mav_tasks.cli.commands import COMMANDS
from mav_tasks.cli.lazy import LazyCommand
from mav_tasks.client.asking import parts_of
from mav_tasks.client.operations import OPERATIONS
from mav_tasks.client.terms import OF_CHANGES
from mav_tasks.kinds.plugged import TAKEN
from mav_tasks.web.application import operations_of
from mav_tasks.web.openapi import document_of

ROOT = Path(__file__).resolve().parents[3]
ROUTES = {"rover": "/vehicles/{vehicle}/", "task": "/tasks/{task}/", "all": "/"}
WITHOUT = {"modify"}  # a path of its own: it is the PATCH of a task

ROW = """OPERATIONS = (
    Operation("honk", "rover", "Sound the horn", "priority kill", "Ask first.", done="honked"),
"""
METHOD = """    async def honk(
        self, *, priority: int = 5, kill: bool = False, vehicle: int | None = None
    ) -> None:
        await self._control(vehicle, MavCmd.DO_SET_RELAY, float(priority), float(kill))

    async def pause("""
TERM = """    urgency: Annotated[int | None, Number(0, 9), "how urgent", TaskProperty.PRIORITY]
    every: Annotated["""
SCRIPT = """
from unittest.mock import MagicMock
from mav_tasks import __file__ as where
from mav_tasks.agents.driving import driving
from mav_tasks.cli.app import app
from mav_tasks.client.sync import SyncClient
from mav_tasks.web.application import operations_of
from mav_tasks.web.openapi import document_of

assert where.startswith({copy!r}), where
body = document_of(operations_of(MagicMock()))["paths"]["/vehicles/{{vehicle}}/honk"]["post"]
schema = body["requestBody"]["content"]["application/json"]["schema"]
assert schema["properties"]["priority"]["maximum"] == 10, schema
(tool,) = (each for each in driving("") if each.name == "honk")
assert (tool.title, tool.about) == ("Sound the horn", "Sound the horn. Ask first.")
assert SyncClient.honk
changed = [["modify", "3", "--urgency", "11"], ["submit", "wait", "1", "--urgency", "x"]]
for path, verb in (("/tasks/{{task}}", "patch"), ("/vehicles/any/tasks", "post")):
    body = document_of(operations_of(MagicMock()))["paths"][path][verb]["requestBody"]
    assert "urgency" in body["content"]["application/json"]["schema"]["properties"]
for arguments in (["--help"], ["honk", "--help"], ["honk", "--priority", "11"], *changed):
    try:
        app(arguments, prog_name="mav-tasks")
    except SystemExit:
        pass
    except Exception as error:
        print(error)
"""


def test_each_surface_has_each_operation_or_a_reason() -> None:
    paths = document_of(operations_of(MagicMock()))["paths"]
    tools = {tool.name: tool for tool in driving("")}
    assert OF_CHANGES.keys() < {*TAKEN}
    commands = {each.name: each for each in COMMANDS if isinstance(each, LazyCommand)}
    for command in commands.values():
        assert command.load().help.partition("\n")[0] == command.help
    for each in OPERATIONS:
        route = ROUTES[each.about] + each.name
        verbs = paths[route.removesuffix("/modify") if each.name in WITHOUT else route]
        body = verbs["patch" if each.name in WITHOUT else "post"]["requestBody"]
        properties = body["content"]["application/json"]["schema"]["properties"]
        parts = parts_of(each)
        assert properties.keys() - {"vehicle"} == {part.name for part in parts}, each.name
        assert commands[each.name].help == f"{each.summary}."
        if each.no_tool:
            assert each.name not in tools
            continue
        required = {part.name for part in parts if part.is_required}
        arguments = {part.name: part.schema for part in tools[each.name].arguments}
        assert arguments.keys() - {"vehicle", "id"} == required
        assert {name: arguments[name] for name in required} == {
            name: properties[name] for name in required
        }


def test_a_new_operation_is_one_row_and_its_method_and_a_new_term_one_line(tmp_path: Path) -> None:
    copy = tmp_path / "mav_tasks"
    for name in ("mav_tasks", "tools"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    for name, before, after in (
        ("operations.py", "OPERATIONS = (\n", ROW),
        ("aio.py", "    async def pause(", METHOD),
        ("terms.py", "    every: Annotated[", TERM),
    ):
        path = copy / "client" / name
        text = path.read_text(encoding="utf-8")
        assert text.count(before) == 1
        path.write_text(text.replace(before, after), encoding="utf-8")
    environment = {"PYTHONPATH": str(tmp_path), "PATH": str(Path(sys.executable).parent)}
    said = ""
    for arguments in (("tools/generate", "blocking client"), ("-c", SCRIPT.format(copy=str(copy)))):
        ran = subprocess.run(
            [sys.executable, *arguments],
            cwd=tmp_path,
            env=environment,
            capture_output=True,
            text=True,
            timeout=60,
            check=False,
        )
        assert ran.returncode == 0, ran.stderr
        said = " ".join(ran.stdout.split())
    assert "honk Sound the horn." in said
    assert "--priority PRIORITY 10 runs first; a new task has 5. --kill" in said
    for words in ("priority 11: not in 0..10", "--urgency 11: not in 0..9", "--urgency 'x': not a"):
        assert words in said
