"""What somebody may try who reaches the port, or has a key for less: each was possible once."""

from pymavlink.dialects.v20 import ardupilotmega as ardupilot
from pymavlink.dialects.v20 import common

from mav_tasks.config.settings import Clients, Limits, Roles, Settings
from mav_tasks.engine.inputs import KeysChanged, PeerChanged, SettingsChanged
from mav_tasks.mavlink.signing import Key
from mav_tasks.shell.in_memory import CLIENT_LINK
from mav_tasks.tasks.lifecycle import TaskReason as R
from rover_sim.personas import Persona
from tests.kit.cases import for_each
from tests.kit.client import (
    AUTO,
    DENIED,
    GUIDED,
    MOVE,
    FakeClient,
    Message,
    set_mode,
    setpoint,
)
from tests.kit.mission import Item
from tests.kit.px4 import MISSION, PROMPT_PX4
from tests.kit.restarts import UTC
from tests.kit.rows import check, parsed
from tests.kit.world import PROMPT, World, at
from tests.scenarios.conftest import MakeWorld
from tests.scenarios.test_roles import (
    OBSERVER,
    OPERATOR,
    SUBMITTER,
    MakeRoles,
    active,
    answer,
    join,
)
from tests.scenarios.test_roles import with_roles as with_roles
from tests.scenarios.test_signed_rovers import sent_to_rover
from tests.scenarios.test_signing import ALICE, BOB, put, signing

WAYPOINT = 16
FENCE = 1  # MAV_MISSION_TYPE


def radio_status() -> object:
    return common.MAVLink_radio_status_message(10, 10, 0, 0, 0, 0, 0)


def test_a_radio_s_status_makes_nobody_a_client_where_all_is_signed(world: World) -> None:
    """It is signed by nobody, and so says nothing of who sends it."""
    put(world, ALICE)
    stranger = world.add_client("stranger", system_id=51, component_id=68)
    stranger.heartbeats = False
    towards = sent_to_rover(world)
    stranger.stream(radio_status(), rate=5)
    world.run(3.0)
    assert not stranger.received
    assert 109 not in [data[7] for data in towards]


def connected(world: World, key: Key) -> FakeClient:
    """Return a client that has dialled, as over TCP, and signs."""
    client = signing(world, key, name="dialled")
    change = PeerChanged(CLIENT_LINK, client.name, up=True)
    world.server.pump.handle(change, now=world.now)
    world.run(1.5)
    return client


@for_each("role", ["observer", ""])
def test_a_key_that_may_less_now_may_less_at_once(world: World, role: str) -> None:
    """Also on a connection that stays: "" is of vehicles, and no client's any more."""
    put(world, ALICE)
    client = connected(world, ALICE)
    assert answer(world, client.move(1.0)) is not None
    less = Key("alice", ALICE.secret, role)
    world.server.pump.handle(KeysChanged((less, BOB)), now=world.now)
    sent = client.move(2.0)
    assert answer(world, sent) == ((DENIED, R.NOT_ALLOWED) if role else None)
    assert len(world.tasks()) == 1


@for_each("persona, mode", [(PROMPT, AUTO), (PROMPT_PX4, MISSION)])
def test_a_plan_that_is_started_again_keeps_to_the_limits_of_who_starts_it(
    make_world: MakeWorld, persona: Persona, mode: int
) -> None:
    roles = Roles(
        unsigned="safety", addresses={"10/190": "submitter"}, submitter=Limits(max_speed=0.3)
    )
    world = make_world(settings=Settings(roles=roles), persona=persona)
    submitter = join(world, SUBMITTER)
    assert world.upload([Item(WAYPOINT, **at(2.0, 0.0))] * 2, client=submitter).result == 0
    for number in (1, 2):
        submitter.send(set_mode(mode))
        world.run(0.3)
        world.client.arm()
        world.until_idle(tasks=number)
        world.client.arm(False)
        world.run(2.0)
    assert [task.terms.top_speed for task in world.tasks()] == [0.3, 0.3]


def test_only_an_operator_s_stop_clears_the_queue(with_roles: MakeRoles) -> None:
    """Everybody stops a rover; but the tasks of others are theirs."""
    world = with_roles()
    active(world, 20.0)
    check(
        world,
        """
TASK_MOVE 1 : ACCEPTED #2
observer> TASK_STOP 1 : ACCEPTED #1 / queue STOPPED / task 2: QUEUED / stopped, but role observer \
may not clear a queue; operator may
operator> TASK_STOP 1 : ACCEPTED #0 / task 2: CANCELLED
""",
        observer=join(world, OBSERVER),
        operator=join(world, OPERATOR),
    )


#: a fence's item, no fence, nothing at all, an old fence, an old rally point, a device
BOUNDING = f"""
mission_item_int 1 1 0 6 5003 0 1 9 0 0 0 0 0 0 {FENCE}
mission_clear_all 1 1 {FENCE}
mission_clear_all 1 1 255
fence_point 1 1 0 0 0 0
rally_point 1 1 0 0 0 0 0 0 0 0
device_op_write 1 1 0 0 0 0 x 0 1 {",".join("0" * 128)}
"""


@for_each("what", BOUNDING.strip().split("\n"))
@for_each("who", [OPERATOR, 255])
def test_what_bounds_a_rover_is_not_passed_on_for_an_operator(
    make_world: MakeWorld, what: str, who: int
) -> None:
    """Also where the server leaves missions to the rover; 255 is in charge of safety."""
    roles = Roles(unsigned="safety", addresses={"12/190": "operator"})
    world = make_world(settings=Settings(roles=roles, claim=False))
    client = join(world, who)
    name, numbers, _ = parsed(what)
    message = getattr(ardupilot, f"MAVLink_{name}_message")(*numbers)
    passed = world.passed_on((who, 190))
    client.send(message)
    world.run(0.2)
    assert (message.get_msgId() in passed) == (who != OPERATOR)


def test_switching_the_fence_off_as_a_switch_does_is_of_safety(with_roles: MakeRoles) -> None:
    world = with_roles()
    switch = "operator> 218 11 0 to=autopilot : NOT_ALLOWED"
    check(world, switch, operator=join(world, OPERATOR))


def test_what_a_revoked_key_drives_stands(world: World) -> None:
    """It is not waited for until the rover itself misses the setpoints."""
    put(world, ALICE)
    client = signing(world, ALICE)
    world.run(1.5)
    client.command(MOVE, 1, 0, 0, 0, 0, 60)  # it is paused
    client.mode(GUIDED)
    world.run(0.5)
    client.arm()
    world.run(1.0)
    client.stream(setpoint(0.5), rate=10)
    world.until_faster(0.3, within=5)
    revoked = Key("alice", b"", "operator", ALICE.fingerprint)
    world.server.pump.handle(KeysChanged((revoked, BOB)), now=world.now)
    world.until(world.stands, within=1.5)


def test_commands_that_have_ended_keep_nobody_away_for_long(world: World) -> None:
    """Each run of the command line is a client; a script of them took all places for a minute."""
    put(world, ALICE, takes_unsigned=True)
    crowd = Settings(clients=Clients(max_clients=4), roles=Roles(unsigned="observer"))
    world.server.pump.handle(SettingsChanged(crowd), now=world.now)
    commands = [world.add_client(f"command {number}") for number in range(4)]
    for number, each in enumerate(commands):
        each.sign(ALICE.secret, utc=UTC + world.now, link_id=number)
    world.run(1.5)
    for each in commands:
        world.leave(each)
    world.run(10.0)
    newcomer = world.add_client("newcomer", system_id=20)
    world.run(3.0)
    assert newcomer.heard("LOCAL_POSITION_NED")


def test_what_the_server_has_signed_itself_makes_nobody_a_client(world: World) -> None:
    put(world, ALICE)
    client = signing(world, ALICE)
    world.run(1.5)
    attacker = world.add_client("attacker")
    attacker.heartbeats = False
    old = world.server.engine.signatures.counts.old
    overheard = client.received[-20:]
    for packet in overheard:
        attacker.send_raw(packet.raw)
    world.run(0.5)
    assert not attacker.received
    assert world.server.engine.signatures.counts.old - old == len(overheard)


def test_an_upload_is_of_who_began_it_and_not_of_its_endpoint(world: World) -> None:
    """Or else who signs otherwise, or not at all, could put his items into another's plan."""
    put(world, ALICE, takes_unsigned=True)
    client = signing(world, ALICE)
    unsigned = common.MAVLink(None, client.system_id, client.component_id)
    world.run(1.5)

    def items(number: int) -> Message:
        where = at(2.0 + number, 0.0)
        return common.MAVLink_mission_item_int_message(
            1, 191, number, 6, WAYPOINT, 0, 1, 0, 0, 0, 0, where["x"], where["y"], 0, 0
        )

    client.send(common.MAVLink_mission_count_message(1, 191, 2, 0))
    world.run(0.1)
    client.send_raw(items(0).pack(unsigned))
    world.run(0.1)
    client.send(items(1))
    world.run(0.1)
    assert world.tasks() == ()
    client.send(items(0))
    world.run(0.1)
    client.send(items(1))
    world.run(0.3)
    assert [task.submitter.key for task in world.tasks()] == ["alice"]
