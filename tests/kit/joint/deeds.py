"""Events for a rover and its server: clients' requests, a person at the rover, failures."""

from collections.abc import Callable
from enum import Enum, auto
from typing import Any, NamedTuple

from rover_sim.personas import Mode
from tests.kit.client import GUIDED, HOLD, MOVE, Sent, setpoint
from tests.kit.mission import Item, Upload
from tests.kit.px4 import ask_mode
from tests.kit.world import World, at

WAYPOINT, START, CANCEL, CLEAR, RELEASE = 16, 300, 54010, 54011, 54013
PX4_HOLD, PX4_OFFBOARD = 3 << 24 | 4 << 16, 6 << 16
SPEED = 0.5  # m/s of the client's setpoint stream
LATER = 6.0  # s until the start of the later task


class Kind(Enum):
    """The class of a deed in the halt rule."""

    HALT = auto()  # by a client, if accepted
    PARKING = auto()  # a halt at the rover itself
    DISARMING = auto()  # by a client
    DISARMED = auto()  # at the rover itself
    CONTINUE = auto()
    ARMING = auto()  # by a client
    ARMED = auto()  # at the rover itself
    GRANT = auto()  # a client requests the mode in which it drives
    GO = auto()
    WISH = auto()
    NOTHING = auto()  # releases nothing: time, failures, copies, a stream, a switch


class Deed(NamedTuple):
    """One possible event; ``act`` returns the command that awaits an answer, if any."""

    name: str
    kind: Kind
    act: Callable[["Scene"], Sent | None]
    takes: float = 1.5  # s until its effect is checked


class Scene:
    """A world with two clients: ``client`` releases the rover, ``person`` halts it."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.client = world.client
        self.person = world.add_client("person")
        self.is_px4 = world.server.engine.snapshot(now=world.now).vehicles[0].persona == "px4"
        self.streams = False
        self.is_silent = False
        self.last_go: Any = None
        home = () if self.is_px4 else (Item(WAYPOINT, frame=0, current=1),)
        upload = Upload(self.client, (*home, Item(WAYPOINT, **at(30.0, 0.0))), target=(1, 1))
        world.until(lambda: upload.result == 0, within=5)

    def go(self, sent: Sent) -> Sent:
        """Store a go request for later copies."""
        self.last_go = sent.message
        return sent


def _hold(scene: Scene) -> Sent:
    return ask_mode(scene.person, PX4_HOLD) if scene.is_px4 else scene.person.mode(HOLD)


def _guided(scene: Scene) -> Sent:
    if scene.is_px4:
        return scene.go(ask_mode(scene.client, PX4_OFFBOARD))
    return scene.go(scene.client.mode(GUIDED))


def _stream(scene: Scene) -> None:
    scene.streams = not scene.streams
    if scene.streams:
        scene.client.stream(setpoint(SPEED), rate=10)
    else:
        scene.client.end_streams()


def _copy(scene: Scene) -> None:
    if scene.last_go is not None:
        scene.last_go.confirmation += 1
        scene.client.send(scene.last_go)


def _silence(scene: Scene) -> None:
    scene.is_silent = not scene.is_silent
    silent = scene.is_silent
    scene.world.watched.loses = lambda source, _target, _data: silent and source == "rover1"


def _reboot(scene: Scene) -> None:
    scene.world.rover.autopilot.reboot(now=scene.world.now)


def _switch(mode: Mode) -> Callable[[Scene], None]:
    return lambda scene: scene.world.operator_mode(mode)


def _arms(armed: bool) -> Callable[[Scene], None]:
    return lambda scene: scene.world.operator_arm(armed)


DEEDS: tuple[Deed, ...] = (
    Deed("STOP", Kind.HALT, lambda scene: scene.person.stop()),
    Deed("HOLD", Kind.HALT, _hold),
    Deed("pause", Kind.HALT, lambda scene: scene.person.pause()),
    Deed("disarm", Kind.DISARMING, lambda scene: scene.person.arm(False)),
    Deed("HOLD by the switch", Kind.PARKING, _switch(Mode.HOLD)),
    Deed("disarmed at the rover", Kind.DISARMED, _arms(False)),
    Deed("continue", Kind.CONTINUE, lambda scene: scene.go(scene.client.proceed())),
    Deed("arm", Kind.ARMING, lambda scene: scene.go(scene.client.arm())),
    Deed("armed at the rover", Kind.ARMED, _arms(True)),
    Deed("Guided", Kind.GRANT, _guided),
    Deed(
        "start of the mission",
        Kind.GO,
        lambda scene: scene.go(scene.client.command(START, target=(1, 1))),
    ),
    Deed("release", Kind.GO, lambda scene: scene.go(scene.client.command(RELEASE, 0, 0))),
    Deed("task", Kind.WISH, lambda scene: scene.client.move(30.0)),
    Deed(
        "task for later",
        Kind.WISH,
        lambda scene: scene.client.command(MOVE, 30, 0, 0, 0, 0, LATER, 5),
    ),
    Deed("cancel", Kind.WISH, lambda scene: scene.client.command(CANCEL)),
    Deed("clear", Kind.HALT, lambda scene: scene.client.command(CLEAR, 1)),
    Deed("stream on or off", Kind.NOTHING, _stream),
    Deed("copy of the last go", Kind.NOTHING, _copy),
    Deed("MANUAL by the switch", Kind.NOTHING, _switch(Mode.MANUAL)),
    Deed("GUIDED by the switch", Kind.NOTHING, _switch(Mode.GUIDED)),
    Deed("silence on or off", Kind.NOTHING, _silence, takes=4.0),
    Deed("restart of the rover", Kind.NOTHING, _reboot, takes=4.0),
    Deed("8 s", Kind.NOTHING, lambda _: None, takes=8.0),
)
BY_NAME = {deed.name: deed for deed in DEEDS}
