"""All commands, in the order of the help: name, function, and the first line of its help."""

from mav_tasks.cli.lazy import LazyCommand as Lazy
from mav_tasks.cli.program import Program
from mav_tasks.client.operations import OPERATION, OPERATIONS, Operation

HALTS = ("stop", "pause", "resume")


def _made(operation: Operation) -> Lazy:
    """Return the command of a declared operation."""
    by_hand = "halts" if operation.name in HALTS else "control"
    home = by_hand if "command" in operation.by_hand else "asked"
    return Lazy(operation.name, f"{home}:{operation.name}", f"{operation.summary}.")


def _shows(name: str) -> Lazy:
    return Lazy(name, f"{name}:{name}", f"{OPERATION[name].summary}.")


COMMANDS = (
    Lazy("serve", "serve:serve", "Run the task server.", kind="serve:ServeCommand"),
    Program("sim", "rover_sim", "Run simulated rovers on UDP 14580."),
    Program("demo", "rover_sim.demo", "Run the demonstration: three tasks, driven and measured."),
    Lazy("submit", "submit:app", "Submit a task."),
    *(_shows(name) for name in ("status", "queue", "history")),
    *map(_made, OPERATIONS),
    _shows("vehicles"),
    Lazy("ready", "ready:ready", "Check that the server answers and that it hears its rovers."),
    Lazy(
        "doctor",
        "doctor:doctor",
        "Look for what is wrong, from the settings to the rovers.",
    ),
    Lazy("probe", "probe:probe", "Test what a rover can do, without a server."),
    Lazy(
        "trial", "trial:trial", "Drive a rover through a table of requirements, and write a report."
    ),
    Lazy("mission", "plans:mission", "Upload, start and download missions."),
    Lazy("fence", "plans:fence", "Upload, download and clear the fence."),
    Lazy("rally", "plans:rally", "Upload and clear rally points."),
    Lazy("web", "web:app", "Show and steer the rovers in a browser."),
    Lazy("log", "log:log", "Print the journal, one change per line; times are UTC."),
    Lazy("replay", "replay:replay", "Replay a record and compare the results."),
    Lazy(
        "export",
        "export:export",
        "Convert recordings to MCAP, for Foxglove and Lichtblick.",
    ),
    Lazy("config", "config:app", "Show, check and create the configuration of the server."),
    Lazy("keys", "keys:app", "Add, list and revoke signing keys."),
    Lazy(
        "qgc-actions",
        "qgc_actions:qgc_actions",
        "Print or install action buttons for QGroundControl.",
    ),
    Lazy("mcp", "mcp:mcp", "Offer the task server to AI agents (Model Context Protocol)."),
    Lazy("dialect", "dialect:dialect", "Print the MAVLink definitions of the task messages."),
)
