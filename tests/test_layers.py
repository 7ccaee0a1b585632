"""Who may import whom, what pure packages may not touch, and on which seams tests stand."""

import ast
import subprocess
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import mav_tasks

ROOT = Path(__file__).resolve().parent.parent

#: beside dotfiles
TOP = {"README.md", "dialects", "mav_tasks", "pyproject.toml", "sim", "tests", "tools"}

#: rooms of mav_tasks, each with those above it that it may import; then the rover's
LAYERS = """
basics:
mavlink:
links: basics
config: basics mavlink links
plans: basics mavlink
kinds: basics mavlink config
tasks: basics config kinds
engine: basics mavlink config kinds tasks
store: basics config kinds tasks engine
fleet: basics links engine store
recording: basics mavlink config tasks engine store
metrics: basics mavlink links tasks engine
shell: basics mavlink links config kinds tasks engine store fleet recording metrics
client: basics mavlink links config plans kinds tasks engine
web: basics mavlink config plans kinds tasks engine store recording metrics shell client
agents: basics mavlink config kinds tasks shell client
probe: basics mavlink links config kinds tasks engine client
rover_sim: basics config links mavlink
rover_sim.testing: client shell kinds links mavlink rover_sim config store tasks
rover_sim.observing: client links mavlink rover_sim rover_sim.testing
rover_sim.check_vehicle: links rover_sim rover_sim.testing rover_sim.observing
rover_sim.trial: basics client kinds links tasks rover_sim.testing rover_sim.observing
rover_sim.demo: client basics mavlink shell kinds links recording rover_sim rover_sim.testing \
config tasks rover_sim.observing
cli: basics mavlink links config plans kinds tasks store recording shell client web agents probe \
rover_sim rover_sim.trial rover_sim.demo
"""


def full(name: str) -> str:
    return name if name.startswith("rover_sim") else f"mav_tasks.{name}"


MAY_IMPORT = {
    full(name): frozenset(map(full, allowed.split()))
    for name, _, allowed in (row.partition(":") for row in LAYERS.strip().splitlines())
}

#: pure: no I/O, no clock, no chance
PURE = (
    *("mav_tasks.fleet", "mav_tasks.basics.errors", "mav_tasks.basics.histogram"),
    *("mav_tasks.config.settings", "mav_tasks.config.setting_keys"),
    *("mav_tasks.config.parameter_table", "mav_tasks.kinds", "mav_tasks.mavlink"),
    *("mav_tasks.tasks", "mav_tasks.engine", "mav_tasks.probe", "rover_sim.autopilot"),
)
IMPURE = ("mav_tasks.fleet.io", "mav_tasks.probe.probing")
BANNED_IN_PURE = frozenset(
    {
        "asyncio",
        "socket",
        "threading",
        "time",
        "datetime",
        "random",
        "secrets",
        "uuid",
        "os",
        "sqlite3",
        "logging",
        "pathlib",
        "io",
        "shutil",
        "tempfile",
        "subprocess",
    }
)
#: says where a file of the package is, and opens none
WITH_A_PATH = "mav_tasks.mavlink.definitions"
#: may compute with the datetimes that it is given
WITH_DATES = "mav_tasks.tasks.cron"
ASKS_FOR_THE_TIME = frozenset({"now", "utcnow", "today"})
GENERATED = "mav_tasks.mavlink._dialect"


def is_pure(module: str) -> bool:
    """Return whether a module, or a package that it is in, is in PURE."""
    if module.startswith(IMPURE):
        return False
    return any(module == name or module.startswith(f"{name}.") for name in PURE)


def modules() -> Iterator[tuple[str, Path]]:
    """Every hand-written module of the two packages, by its full name."""
    for base in (ROOT, ROOT / "sim"):
        for package in ("mav_tasks", "rover_sim"):
            for path in sorted((base / package).rglob("*.py")):
                name = ".".join(path.relative_to(base).with_suffix("").parts)
                name = name.removesuffix(".__init__")
                if name != GENERATED:
                    yield name, path


MODULES = dict(modules())


@cache
def imports_of(path: Path) -> tuple[str, ...]:
    """Return every module that a file imports, wherever in it."""
    found: list[str] = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: relative import"
            assert node.module is not None
            found += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    return tuple(found)


def layer_of(module: str) -> str | None:
    """The rule that a module falls under, or None for what is not ours."""
    parts = module.split(".")
    if parts[0] == "rover_sim":
        room = ".".join(parts[:2])
        return room if room in MAY_IMPORT else parts[0]
    return ".".join(parts[:2]) if parts[0] == "mav_tasks" and len(parts) > 1 else None


def violations(module: str, path: Path) -> list[str]:
    """What a module imports and may not."""
    layer = layer_of(module)
    if layer is None:
        return []
    allowed = MAY_IMPORT[layer] | {layer}
    return [
        imported
        for imported in imports_of(path)
        if (target := layer_of(imported)) in MAY_IMPORT and target not in allowed
    ]


def test_nothing_but_what_was_agreed_stands_at_the_top() -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, check=True)
    names = {line.strip('"').partition("/")[0] for line in listed.stdout.decode().splitlines()}
    assert {name for name in names if not name.startswith(".")} == TOP


def test_every_module_has_a_rule() -> None:
    assert {layer_of(module) for module in MODULES} - {None} == set(MAY_IMPORT)


def test_each_room_imports_from_those_above_it_only() -> None:
    above: set[str] = set()
    for room, allowed in MAY_IMPORT.items():
        assert allowed <= above, room
        above.add(room)


def test_imports_stay_within_the_layers() -> None:
    found = {module: violations(module, path) for module, path in MODULES.items()}
    assert {module: wrong for module, wrong in found.items() if wrong} == {}


def importers_of(*names: str) -> set[tuple[str, str]]:
    """Return (module, imported) for each import of one of these modules, or of what is in them."""
    return {
        (module, imported)
        for module, path in MODULES.items()
        for imported in imports_of(path)
        if any(imported == name or imported.startswith(f"{name}.") for name in names)
    }


def test_pure_modules_touch_no_clock_and_no_world() -> None:
    """Hence nothing that comes from the wire names a file: what reads it opens none."""
    found = importers_of(*BANNED_IN_PURE)
    assert found
    impure = {(module, imported) for module, imported in found if is_pure(module)}
    dates = {each for each in impure if each[0] == WITH_DATES and each[1].startswith("datetime")}
    paths = {(WITH_A_PATH, name) for name in ("pathlib", "pathlib.Path")}
    assert impure == dates | paths
    sources = {module: path.read_text(encoding="utf-8") for module, path in MODULES.items()}
    assert not [each for each, text in sources.items() if is_pure(each) and " open(" in text]
    tree = ast.parse(sources[WITH_DATES])
    names = {node.attr for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
    assert names & ASKS_FOR_THE_TIME == set()


def test_the_generated_dialect_is_seen_by_its_package_only() -> None:
    seen_by = {module for module, _ in importers_of(GENERATED)}
    assert {module for module in seen_by if not module.startswith("mav_tasks.mavlink")} == set()
    assert seen_by


def test_clients_and_vehicles_do_not_know_each_other() -> None:
    for one, other in (("gcs_side", "vehicle_side"), ("vehicle_side", "gcs_side")):
        (module,) = [each for each in MODULES if each.endswith(f".{one}")]
        assert not any(name.endswith(f".{other}") for name in imports_of(MODULES[module]))


def test_the_judges_of_rovers_read_messages_with_pymavlink_only() -> None:
    """A mistake in our codec would cancel itself out."""
    judges = ("rover_sim.observing", "rover_sim.check_vehicle", "rover_sim.trial")
    codec = {"mav_tasks.mavlink.codec", "mav_tasks.mavlink.messages", "mav_tasks.mavlink"}
    for judge in judges:
        inside = [path for module, path in MODULES.items() if module.startswith(judge)]
        assert len(inside) > 3
        assert not [path for path in inside if codec & set(imports_of(path))], judge


def test_only_bullet_imports_pybullet() -> None:
    assert {module for module, _ in importers_of("pybullet")} == {"rover_sim.bullet"}


def test_only_the_store_in_postgresql_and_its_demonstration_import_psycopg() -> None:
    found = {module for module, _ in importers_of("psycopg")}
    assert found
    theirs = ("mav_tasks.store.postgres", "rover_sim.demo.fleet")
    assert {each for each in found if not each.startswith(theirs)} == set()


def test_the_rules_are_able_to_fail(tmp_path: Path) -> None:
    bad = tmp_path / "bad.py"
    bad.write_text("import time\nfrom mav_tasks.engine import engine\n", encoding="utf-8")
    assert violations("mav_tasks.tasks.bad", bad) == [
        "mav_tasks.engine",
        "mav_tasks.engine.engine",
    ]
    assert "time" in set(imports_of(bad))


def test_the_simulator_itself_knows_neither_the_server_nor_its_plugin(tmp_path: Path) -> None:
    bad = tmp_path / "bad.py"
    bad.write_text("import mav_tasks.shell.in_memory\nimport rover_sim.testing.lossy\n", "utf-8")
    assert violations("rover_sim.bad", bad) == [
        "mav_tasks.shell.in_memory",
        "rover_sim.testing.lossy",
    ]
    assert violations("rover_sim.testing.bad", bad) == []


# tests stand on seams

#: what tests may import from the product; all else may change without them
SEAMS = (
    # the wire world: bytes in, bytes and events out of a server in virtual time
    *("mav_tasks.shell.in_memory", "mav_tasks.links", "mav_tasks.engine.engine"),
    *("mav_tasks.engine.inputs", "mav_tasks.engine.snapshot", "mav_tasks.basics.errors"),
    # its events and words
    *("mav_tasks.tasks.events", "mav_tasks.tasks.lifecycle", "mav_tasks.kinds"),
    *("mav_tasks.tasks.task", "mav_tasks.tasks.goal", "mav_tasks.tasks.restored"),
    *("mav_tasks.tasks.view", "mav_tasks.tasks.timing"),
    # contracts that have several implementations
    *("mav_tasks.store", "mav_tasks.fleet", "mav_tasks.recording"),
    # what people and programs call
    *("mav_tasks.client", "mav_tasks.cli", "mav_tasks.web", "mav_tasks.agents"),
    *("mav_tasks.metrics", "mav_tasks.probe"),
    # the codec
    "mav_tasks.mavlink",
    # pure functions of plain values, and of files
    *("mav_tasks.tasks.driving", "mav_tasks.tasks.repetition", "mav_tasks.tasks.queue"),
    *("mav_tasks.tasks.cron", "mav_tasks.plans", "mav_tasks.config", "mav_tasks.shell.logs"),
)
#: public all the same: of named tuples, of the interpreter, of pymavlink's messages
NOT_PRIVATE = frozenset({"_replace", "_make", "_asdict", "_exit", "_timestamp"})
PUBLIC = frozenset(mav_tasks.__all__)
#: files that reach below, and why
BELOW = {
    # the table of joint control: a walk over all its states, and the server beside it
    "kit/joint/agreement.py": "the table",
    "kit/joint/graph.py": "the table",
    "kit/joint/model.py": "the table",
    "unit/engine/vehicles/test_control.py": "the table",
    "kit/asleep.py": "a process whose machine sleeps: its clock",
}


def functions_in(tree: ast.Module) -> set[str]:
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


@cache
def functions_of_the_product() -> set[str]:
    """Return the names of its functions and methods."""
    paths = [path for module, path in MODULES.items() if module.startswith("mav_tasks.")]
    return {name for path in paths for name in functions_in(ast.parse(path.read_text("utf-8")))}


def reaches_below(tree: ast.Module) -> Iterator[str]:
    """Yield what a test imports below the seams, reads of others' privates, and patches."""
    ours: set[str] = set()  # names of the product
    own = functions_in(tree)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [(alias.name, alias.asname or alias.name.split(".")[0]) for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [
                (f"{node.module}.{each.name}", each.asname or each.name) for each in node.names
            ]
        else:
            continue
        for whole, name in names:
            if whole.startswith("mav_tasks."):
                ours.add(name)
                is_seam = any(f"{whole}.".startswith(f"{seam}.") for seam in SEAMS)
                if not is_seam and whole.removeprefix("mav_tasks.") not in PUBLIC:
                    yield f"imports {whole}"
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(attr=name, value=value) if name[0] == "_" and name[1:2].isalpha():
                is_own = isinstance(value, ast.Name) and value.id in ("self", "cls")
                is_own |= isinstance(value, ast.Call) and ast.unparse(value) == "super()"
                if not is_own and name not in NOT_PRIVATE:
                    yield f"reads {name}"
            case ast.Assign(targets=[ast.Attribute(attr=name) as target], value=value):
                is_function = isinstance(value, ast.Lambda)
                is_function |= isinstance(value, ast.Name) and value.id in own
                is_own = ast.unparse(target).startswith("self.")
                if is_function and not is_own and name in functions_of_the_product():
                    yield f"replaces {ast.unparse(target)}"
            case ast.Call(func=ast.Attribute(attr="setattr" | "setitem" | "delattr"), args=args):
                first = args[0]
                while isinstance(first, ast.Attribute):
                    first = first.value
                is_ours = isinstance(first, ast.Name) and first.id in ours
                named = first.value if isinstance(first, ast.Constant) else ""
                if is_ours or str(named).startswith("mav_tasks."):
                    yield f"replaces {ast.unparse(args[0])}"


def test_tests_stand_on_seams() -> None:
    found = {}
    for path in sorted((ROOT / "tests").rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        found[str(path.relative_to(ROOT / "tests"))] = sorted(set(reaches_below(tree)))
    below = {name: what for name, what in found.items() if what}
    assert {name: what for name, what in below.items() if name not in BELOW} == {}
    assert set(BELOW) - set(below) == set(), "they stand on seams now: take them out of BELOW"


def test_the_rule_of_seams_is_able_to_fail() -> None:
    source = """
from mav_tasks.engine.vehicles import pilot
from mav_tasks.shell import runner
def test(monkeypatch, world):
    monkeypatch.setattr(runner.Loop, "turn", None)
    monkeypatch.setattr("mav_tasks.shell.runner.Loop", None)
    def taken(): ...
    world.engine.take_packets = taken
    assert world.server._tasks == self._own
"""
    assert list(reaches_below(ast.parse(source))) == [
        "imports mav_tasks.engine.vehicles.pilot",
        "imports mav_tasks.shell.runner",
        "replaces world.engine.take_packets",
        "replaces runner.Loop",
        "replaces 'mav_tasks.shell.runner.Loop'",
        "reads _tasks",
    ]
