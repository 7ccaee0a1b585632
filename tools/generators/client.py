"""The blocking client, mav_tasks/client/sync.py, made from the asyncio one.

Each public call of ``Client`` and ``Task`` becomes one of ``SyncClient`` and ``SyncTask``, with its
signature and docstring, for editors and mypy. ``mav_tasks/client/blocking.py`` has the rest.
"""

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

CLIENT = Path(__file__).resolve().parents[2] / "mav_tasks" / "client"
#: (module, class) -> its calls that stay with the asyncio client, or are in blocking.py
LEFT_OUT = {
    ("handle", "Task"): {"done", "wake", "close"},
    ("aio", "Client"): {"vehicle", "rearm", "streaming", "listening", "some_vehicles"},
}
OPENING = {"open": "self._begin()", "close": "self._end()"}  # of the client
HEADER = '''"""The blocking client: the calls of the asyncio client, each waiting for its answer.

Made by tools/generate: change aio.py, handle.py or blocking.py instead.
"""

from collections.abc import Iterator
from mav_tasks.client.aio import Client
from mav_tasks.client.blocking import BlockingClient, BlockingTask, Portal, called
'''
WORDS = {
    "Use a client only on the event loop on which it was opened.": (
        "It is open within a ``with`` block. ``portal`` runs its asyncio part."
    ),
    "``Client": "``SyncClient",
}

Call = ast.FunctionDef | ast.AsyncFunctionDef


def module() -> str:
    """Return the text of the blocking client."""
    sources = {name: ast.parse((CLIENT / f"{name}.py").read_text("utf-8")) for name, _ in LEFT_OUT}
    imports, classes = [HEADER], []
    for name, source in sources.items():
        for node in source.body:
            if isinstance(node, ast.ImportFrom):
                imports.append(ast.unparse(node))
            elif isinstance(node, ast.Assign):
                imports.append(
                    f"from mav_tasks.client.{name} import {ast.unparse(node.targets[0])}"
                )
            elif isinstance(node, ast.ClassDef) and (name, node.name) in LEFT_OUT:
                calls = _calls(node, LEFT_OUT[name, node.name])
                node.body = [node.body[0], *calls]
                node.bases = [ast.Name(f"Blocking{node.name}")]
                node.name = f"Sync{node.name}"
                classes.append(ast.unparse(node))
    text = "\n".join([*imports, *classes])
    for old, new in WORDS.items():
        text = text.replace(old, new)
    for step in ("check --select=F401,F811 --fix -q", "check --select=I --fix -q", "format"):
        command = ["-m", "ruff", *step.split(), "--stdin-filename", str(CLIENT / "sync.py"), "-"]
        text = subprocess.check_output([sys.executable, *command], input=text, text=True)
    return text


def _calls(kind: ast.ClassDef, left_out: set[str]) -> Iterator[ast.FunctionDef]:
    for call in kind.body:
        if not isinstance(call, Call) or call.name in left_out:
            continue
        parameters, kept = ast.unparse(call.args), call.body[: ast.get_docstring(call) is not None]
        if call.name == "__init__" and kind.name == "Client":
            parameters, kept = f"{parameters}, portal: Portal | None = None", []
            returns, body = "None", f"super().__init__(lambda: Client({_arguments(call)}), portal)"
        elif call.name.startswith("_"):
            continue
        else:
            returns, body = _body(call)
        (new,) = ast.parse(f"def {call.name}({parameters}) -> {returns}: {body}").body
        assert isinstance(new, ast.FunctionDef)
        new.body[:0] = kept
        new.decorator_list = call.decorator_list
        yield new


def _body(call: Call) -> tuple[str, str]:
    """Return what the blocking call returns, and its only statement."""
    assert call.returns
    returns = ast.unparse(call.returns).replace("AsyncIterator", "Iterator")
    asked = f"self._aio.{call.name}({_arguments(call)})"
    if call.name in OPENING:
        return returns, OPENING[call.name]
    if call.decorator_list:
        return returns, f"return self._aio.{call.name}"
    if isinstance(call, ast.FunctionDef):
        function = f"lambda: {asked}" if _arguments(call) else f"self._aio.{call.name}"
        asked = f"called({function})"
    elif returns.startswith("Iterator"):
        return returns, f"return self._each({asked})"
    elif returns == "Task":
        return "SyncTask", f"return self._handle(SyncTask, {asked})"
    return returns, f"{'return ' * (returns != 'None')}self._call({asked})"


def _arguments(call: Call) -> str:
    arguments = [each.arg for each in call.args.args[1:]]
    arguments += [f"{each.arg}={each.arg}" for each in call.args.kwonlyargs]
    arguments += [f"**{call.args.kwarg.arg}"] if call.args.kwarg else []
    return ", ".join(arguments)
