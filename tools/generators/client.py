"""The blocking client, mav_tasks/client/sync.py, made from the asyncio one.

Each public call of ``Client`` and ``Task`` becomes one of ``SyncClient`` and ``SyncTask``, with its
signature and docstring, for editors and mypy. ``mav_tasks/client/blocking.py`` has the rest.
"""

import ast
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from textwrap import indent

ROOT = Path(__file__).resolve().parents[2]
SYNC = "mav_tasks/client/sync.py"
#: (module, class) -> its calls that stay with the asyncio client, or are in blocking.py
LEFT_OUT: Mapping[tuple[str, str], frozenset[str]] = {
    ("handle", "Task"): frozenset({"done", "wake", "close"}),
    ("aio", "Client"): frozenset({"vehicle", "rearm", "streaming", "listening", "some_vehicles"}),
}
OF_BLOCKING = ("BlockingClient", "BlockingTask", "Portal", "called")
OPENING = {"open": "_begin", "close": "_end"}
HEADER = '''"""The blocking client: the calls of the asyncio client, each waiting for its answer.

Made by tools/generate: change aio.py, handle.py or blocking.py instead.
"""

'''
OF_LOOP = "Use a client only on the event loop on which it was opened."
OF_PORTAL = "It is open within a ``with`` block. ``portal`` runs its asyncio part."


def module() -> str:
    """Return the text of the blocking client."""
    sources = {name: _parsed(name) for name, _ in LEFT_OUT}
    classes = "\n\n".join(
        _class(next(_classes(sources[module], name)), left_out)
        for (module, name), left_out in LEFT_OUT.items()
    )
    return _formatted(f"{HEADER}{_imports(sources)}\n\n{classes}")


def _parsed(module: str) -> ast.Module:
    path = ROOT / "mav_tasks" / "client" / f"{module}.py"
    return ast.parse(path.read_text(encoding="utf-8"))


def _classes(module: ast.Module, name: str) -> Iterator[ast.ClassDef]:
    return (each for each in module.body if isinstance(each, ast.ClassDef) and each.name == name)


def _class(kind: ast.ClassDef, left_out: frozenset[str]) -> str:
    text = f"class Sync{kind.name}(Blocking{kind.name}):\n{_docstring(kind)}\n"
    for call in kind.body:
        if not isinstance(call, ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        if call.name == "__init__" and kind.name == "Client":
            text += _constructor(call)
        elif not call.name.startswith("_") and call.name not in left_out:
            text += _call(call, kind.name)
    return text


def _constructor(call: ast.FunctionDef | ast.AsyncFunctionDef) -> str:
    parameters = f"{_parameters(call, '')}, portal: Portal | None = None"
    made = f"lambda: Client({_arguments(call)})"
    return f"\n    def __init__({parameters}) -> None:\n        super().__init__({made}, portal)\n"


def _call(call: ast.FunctionDef | ast.AsyncFunctionDef, kind: str) -> str:
    returns = _annotation(call.returns, kind).replace("AsyncIterator", "Iterator")
    asked = f"self._aio.{call.name}({_arguments(call)})"
    decorator = ""
    if kind == "Client" and call.name in OPENING:
        body = f"self.{OPENING[call.name]}()"
    elif call.decorator_list:
        decorator, body = "    @property\n", f"return self._aio.{call.name}"
    elif isinstance(call, ast.FunctionDef):
        function = f"lambda: {asked}" if _arguments(call) else f"self._aio.{call.name}"
        body = f"{'' if returns == 'None' else 'return '}self._call(called({function}))"
    elif returns.startswith("Iterator"):
        body = f"return self._each({asked})"
    elif returns == "SyncTask":
        body = f"return self._handle(SyncTask, {asked})"
    else:
        body = f"{'' if returns == 'None' else 'return '}self._call({asked})"
    head = f"{decorator}    def {call.name}({_parameters(call, kind)}) -> {returns}:\n"
    return f"\n{head}{indent(_docstring(call), '    ')}\n        {body}\n"


def _docstring(node: ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) -> str:
    text = ast.get_docstring(node) or ""
    text = text.replace(OF_LOOP, OF_PORTAL).replace("``Client", "``SyncClient")
    end = "\n" if "\n" in text else ""
    return indent(f'"""{text}{end}"""', "    ")


def _parameters(call: ast.FunctionDef | ast.AsyncFunctionDef, kind: str) -> str:
    for each in (*call.args.args, *call.args.kwonlyargs):
        if each.annotation is not None:
            each.annotation = ast.Name(_annotation(each.annotation, kind))
    return ast.unparse(call.args)


def _annotation(annotation: ast.expr | None, kind: str) -> str:
    """Return an annotation of the blocking client; in SyncTask its own name is quoted."""
    assert annotation is not None
    text = ast.unparse(annotation).strip("'")
    words = [f"Sync{word}" if word == "Task" else word for word in text.split(" ")]
    is_own = kind == "Task" and words != text.split(" ")
    return f'"{" ".join(words)}"' if is_own else " ".join(words)


def _arguments(call: ast.FunctionDef | ast.AsyncFunctionDef) -> str:
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
        command = [sys.executable, "-m", "ruff", *step.split(), "--stdin-filename", SYNC, "-"]
        text = subprocess.check_output(command, input=text, text=True, cwd=ROOT)
    return text
