"""The blocking client, mav_tasks/client/sync.py, made from the asyncio one.

Each public call of ``Client`` and ``Task`` becomes one of ``SyncClient`` and ``SyncTask``, with its
signature and docstring, for editors and mypy. ``mav_tasks/client/blocking.py`` has the rest.
"""

import ast
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from textwrap import indent

CLIENT = Path(__file__).resolve().parents[2] / "mav_tasks" / "client"
#: (module, class) -> its calls that stay with the asyncio client, or are in blocking.py
LEFT_OUT = {
    ("handle", "Task"): {"done", "wake", "close"},
    ("aio", "Client"): {"vehicle", "rearm", "streaming", "listening", "some_vehicles"},
}
OF_BLOCKING = ("BlockingClient", "BlockingTask", "Portal", "called")
OPENING = {"open": "_begin", "close": "_end"}  # of the client
HEADER = '''"""The blocking client: the calls of the asyncio client, each waiting for its answer.

Made by tools/generate: change aio.py, handle.py or blocking.py instead.
"""

'''
OF_LOOP = "Use a client only on the event loop on which it was opened."
OF_PORTAL = "It is open within a ``with`` block. ``portal`` runs its asyncio part."

Call = ast.FunctionDef | ast.AsyncFunctionDef


def module() -> str:
    """Return the text of the blocking client."""
    sources = {name: ast.parse((CLIENT / f"{name}.py").read_text("utf-8")) for name, _ in LEFT_OUT}
    classes = [
        _class(kind, LEFT_OUT[name, kind.name])
        for name, source in sources.items()
        for kind in source.body
        if isinstance(kind, ast.ClassDef) and (name, kind.name) in LEFT_OUT
    ]
    return _formatted("\n\n".join([HEADER + _imports(sources), *classes]))


def _class(kind: ast.ClassDef, left_out: set[str]) -> str:
    text = f"class Sync{kind.name}(Blocking{kind.name}):\n{_docstring(kind)}\n"
    for call in kind.body:
        if not isinstance(call, Call):
            continue
        if call.name == "__init__" and kind.name == "Client":
            made = f"super().__init__(lambda: Client({_arguments(call)}), portal)"
            parameters = f"{ast.unparse(call.args)}, portal: Portal | None = None"
            text += f"\n    def __init__({parameters}) -> None:\n        {made}\n"
        elif not call.name.startswith("_") and call.name not in left_out:
            text += _call(call)
    return text


def _call(call: Call) -> str:
    assert call.returns
    returns = ast.unparse(call.returns).replace("AsyncIterator", "Iterator")
    asked = f"self._aio.{call.name}({_arguments(call)})"
    decorator = ""
    if call.name in OPENING:
        body = f"self.{OPENING[call.name]}()"
    elif call.decorator_list:
        decorator, body = "    @property\n", f"return self._aio.{call.name}"
    elif isinstance(call, ast.FunctionDef):
        function = f"lambda: {asked}" if _arguments(call) else f"self._aio.{call.name}"
        body = f"return self._call(called({function}))"
    elif returns.startswith("Iterator"):
        body = f"return self._each({asked})"
    elif returns == "Task":
        returns, body = "SyncTask", f"return self._handle(SyncTask, {asked})"
    else:
        body = f"return self._call({asked})"
    if returns == "None":
        body = body.removeprefix("return ")
    head = f"{decorator}    def {call.name}({ast.unparse(call.args)}) -> {returns}:\n"
    return f"\n{head}{indent(_docstring(call), '    ')}\n        {body}\n"


def _docstring(node: ast.ClassDef | Call) -> str:
    text = ast.get_docstring(node) or ""
    text = text.replace(OF_LOOP, OF_PORTAL).replace("``Client", "``SyncClient")
    end = "\n" if "\n" in text else ""
    return indent(f'"""{text}{end}"""', "    ")


def _arguments(call: Call) -> str:
    arguments = [each.arg for each in call.args.args[1:]]
    arguments += [f"{each.arg}={each.arg}" for each in call.args.kwonlyargs]
    arguments += [f"**{call.args.kwarg.arg}"] if call.args.kwarg else []
    return ", ".join(arguments)


def _imports(sources: Mapping[str, ast.Module]) -> str:
    """Return the imports of the sources, and of their own names; unused ones go when formatted."""
    lines = ["from collections.abc import Iterator", "from mav_tasks.client.aio import Client"]
    lines += [f"from mav_tasks.client.blocking import {name}" for name in OF_BLOCKING]
    for name, source in sources.items():
        for node in source.body:
            if isinstance(node, ast.ImportFrom):
                lines += [f"from {node.module} import {alias.name}" for alias in node.names]
            elif isinstance(node, ast.Assign):
                lines.append(f"from mav_tasks.client.{name} import {ast.unparse(node.targets[0])}")
    return "\n".join(lines)


def _formatted(text: str) -> str:
    for step in ("check --select=F401,F811 --fix -q", "check --select=I --fix -q", "format"):
        command = ["-m", "ruff", *step.split(), "--stdin-filename", str(CLIENT / "sync.py"), "-"]
        text = subprocess.check_output([sys.executable, *command], input=text, text=True)
    return text
