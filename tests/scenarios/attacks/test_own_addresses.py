"""Attack S6: who calls itself the server, or a rover, is heeded by nobody, whatever it sends.

A command of theirs is denied. STOP alone is heeded: it only stops, and it is never too late to find
out who has sent it.
"""

from mav_tasks.tasks.events import SubmissionRefused
from mav_tasks.tasks.lifecycle import TaskReason as R
from mav_tasks.tasks.lifecycle import TaskState as S
from rover_sim.personas import Mode
from tests.kit.cases import for_each
from tests.kit.client import DENIED, FakeClient, heartbeat
from tests.kit.rows import ask
from tests.kit.world import World

#: of the server towards rovers, and of a rover. That of the server in the rover's system is free
#: for clients (see ``test_mavros``)
OWN = ((250, 191), (1, 1))
SERVO, SPEED = 183, 178
MISSION_COUNT = 44

SENT = """COMPONENT_ARM_DISARM 1 to=autopilot
DO_SET_SERVO 1 1900 to=autopilot
DO_SET_MODE 1 15 to=autopilot
client:set_mode 1 1 15
TASK_MOVE 2
DO_SET_SERVO 1 1900 to=all
DO_CHANGE_SPEED 1 1.5
DO_PAUSE_CONTINUE 0
COMPONENT_ARM_DISARM 0 to=autopilot
param_set TSK_SPEED 1.5 9 to=server
param_set CRUISE_SPEED 1.5 9
mission_count 2 0
mission_clear_all 0
request_data_stream 0 20 1"""


def borrowed(world: World, source: tuple[int, int]) -> FakeClient:
    """Let a client take part that says that it is somebody of ours."""
    client = world.add_client("of a borrowed name", system_id=source[0], component_id=source[1])
    client.reads_dialect = False
    world.run(1.2)
    return client


@for_each("source", OWN)
@for_each("what", SENT.splitlines())
def test_nothing_is_done_for_who_calls_itself_the_server_or_a_rover(
    world: World, source: tuple[int, int], what: str
) -> None:
    client = borrowed(world, source)
    client.heartbeats = False
    armed, mode = world.is_armed, world.mode()
    speed = world.rover.autopilot.parameters["CRUISE_SPEED"]
    reached = len(of_source(world, source))
    ask(world, what, client)
    world.run(1.0)
    assert {(ack.result, ack.result_param2) for ack in client.acks} <= {(DENIED, R.NOT_ALLOWED)}
    assert MISSION_COUNT not in [packet.message_id for packet in client.received]
    assert (world.is_armed, world.mode()) == (armed, mode)
    assert world.rover.autopilot.parameters["CRUISE_SPEED"] == speed
    assert world.server.engine.parameters == {}
    assert (world.tasks(), world.paused()) == ((), R.NONE)
    assert len(of_source(world, source)) == reached
    refused = [
        event
        for event in world.events(SubmissionRefused)
        if "change this client's component id" in str(event)
    ]
    assert len(refused) == 1


def of_source(world: World, source: tuple[int, int]) -> list[object]:
    """Return what has reached the rover from an address, but for what the server itself sends."""
    if source == (250, 191):
        return []  # the server sends heartbeats and requests as such; arming and mode tell enough
    return [packet for packet in world.observer.reached if packet.source == source]


@for_each("source", OWN)
def test_its_stop_stops_all_the_same(world: World, source: tuple[int, int]) -> None:
    task = world.client.move(20.0)
    client = borrowed(world, source)
    world.until_state(task.task_id, S.EXECUTING)
    client.stop()
    world.until_state(task.task_id, S.KILLED, within=1.0)
    world.until(world.stands, within=3.0)
    assert (world.paused(), world.mode()) == (R.STOPPED, Mode.HOLD)
    client.proceed()
    world.run(1.0)
    assert world.paused() is R.STOPPED


def test_a_companion_of_the_rover_is_somebody_else(world: World) -> None:
    client = borrowed(world, (1, 195))
    client.send(heartbeat())
    sent = client.move(0.5)
    world.run(0.2)
    assert sent.task_id == 1
