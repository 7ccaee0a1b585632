"""What becomes of each command in a plan: one row for each of MAVLink's commands.

It is driven, or sent to the vehicle at its place, or skipped, as autopilots do that store what they
cannot do; or the plan is refused, because it would be unsafe or mean nothing. A command without a
row of its own is treated by its kind in the policy table. tools/plan_table.py prints it.
"""

import re
from dataclasses import replace
from math import copysign, inf, isnan
from typing import NamedTuple

from mav_tasks.basics.errors import Rejection
from mav_tasks.config.settings import Driving
from mav_tasks.engine.commands.ability import ability_of
from mav_tasks.engine.commands.goals import goal_of
from mav_tasks.engine.policy import row_of_command
from mav_tasks.engine.services.commands import NO_MESSAGE, Command
from mav_tasks.engine.services.missions import NOT_GIVEN
from mav_tasks.engine.services.persona import Persona
from mav_tasks.kinds import Act, GoTo, Place, Wait
from mav_tasks.kinds.act import LONGEST, TIME_LIMIT
from mav_tasks.kinds.base import Ability
from mav_tasks.kinds.params import MAX_WAIT, MIN_SPEED, bad, identifier, number, place_in, whole
from mav_tasks.mavlink.address import AUTOPILOT
from mav_tasks.mavlink.enums import MavAutopilot, MavFrame
from mav_tasks.tasks.goal import Delay, Jump, Near, Nothing, Perform, SetReverse, SetSpeed, Step
from mav_tasks.tasks.lifecycle import TaskReason
from mav_tasks.tasks.task import DEFAULT_PRIORITY, MAX_DELAY, MAX_PRIORITY, Terms

R = TaskReason

FOR_EVER = 1e9  # s; JSON has no infinity
MAX_JUMPS = 65_535
MAX_COMPONENT = 255
MOST_TURNS = 255  # as ArduPilot stores
LEAST_CIRCLE = 0.9  # m, radius; ArduPilot's TURN_RADIUS
NO_CHANGE, DEFAULT = (0.0, -1.0), -2.0  # DO_CHANGE_SPEED, param2
GROUND_OR_AIR = 1  # the same, highest param1: airspeed counts as ground speed
SENT, SKIPPED, REFUSED = "sends", "skips", "refuses"  # uses of commands
HERE = (0, NOT_GIVEN)  # values of x and y that mean no place
PLACES = (16, 17, 21, 22, 4501)  # commands of which 0/0 is where the vehicle is


class MissionParseOptions(NamedTuple):
    """How items are parsed: the vehicle's conventions, and the server's limits."""

    has_home: bool  # item 0 is home, as with ArduPilot
    ability: Ability
    driving: Driving
    is_px4: bool = False  # an item means what it means to a PX4

    @classmethod
    def of(
        cls, persona: Persona | None, *, is_staged: bool, driving: Driving
    ) -> "MissionParseOptions":
        """Return the options of a vehicle, or of any; ``is_staged``: of its autopilot's plans."""
        if persona is None:
            return cls(has_home=False, ability=Ability(), driving=driving)
        is_px4 = persona.autopilot == MavAutopilot.PX4
        return cls(persona.has_home_item and is_staged, ability_of(persona), driving, is_px4)


class PlanRow(NamedTuple):
    """What becomes of a command: ``use`` says how, ``about`` what, or why not."""

    use: str
    about: str
    ardupilot: str  # what it does with it in its own missions, for the document
    px4: str


def row_of_item(command: int) -> PlanRow:
    """Return the row of a command: its own, or that of its kind in the policy table."""
    policy = row_of_command(command)
    return ROWS.get(str(command)) or ROWS[policy.kind.name + "-bound" * policy.is_bound]


def step_of_command(command: Command, count: int, how: MissionParseOptions) -> Step:
    """Return the step that a command becomes in a plan of ``count`` items.

    Raise Rejection for one that is not for a plan.
    """
    code, driving = command.command, how.driving
    row = row_of_item(code)
    if row.use == SENT:
        return Perform(row_of_command(code).role)
    if row.use == REFUSED:
        words = f"command {name_of(code)} is not for a plan: {row.about}"
        raise Rejection(R.NOT_SUPPORTED_BY_VEHICLE, words)
    place = _place(command) if code in PLACES else None
    match code:
        case 16 if place is None:
            return Wait(number(command, 1, "hold", low=0.0, high=MAX_WAIT, default=0.0))
        case 16:
            goal = goal_of(command, driving)
            assert isinstance(goal, GoTo), "a waypoint is a place"
            return goal if goal.wait or goal.yaw is not None else replace(goal, passes=True)
        case 17:
            return GoTo(place, wait=FOR_EVER) if place else Wait(FOR_EVER)
        case 18:
            turns, most = (
                number(command, 1, "turns", low=0.0, high=MOST_TURNS),
                driving.max_distance,
            )
            radius = number(command, 3, "radius", low=-most, high=most, default=0.0)
            around = copysign(max(abs(radius), LEAST_CIRCLE), radius)
            # without a place it is round the place before, which ``plan_of`` knows
            return GoTo(_place(command), turns=turns, around=around) if turns else Nothing()
        case 21 | 22 if place and how.is_px4:
            return GoTo(place)
        case 19 | 20 | 93 | 115 | 213:
            return goal_of(command, driving)
        case 112:
            return Delay(number(command, 1, "delay", low=0.0, high=MAX_WAIT))
        case 114:
            return Near(number(command, 1, "distance", low=0.0, high=driving.max_distance))
        case 4501:
            return Near(0.0)  # ``plan_of`` knows from where to where
        case 177 | 224 | 601:
            # ``plan_of`` knows where a tag is
            to = 0 if code == 601 else whole(command, 1, "item", high=count - 1, default=None)
            if code == 224:
                return Jump(to, -1)
            times = whole(command, 2, "repeat", low=-1, high=MAX_JUMPS, default=None)
            return Jump(to, times)
        case 178:
            whole(command, 1, "speed type", high=GROUND_OR_AIR)
            wish = command.params[1]
            if wish in NO_CHANGE or isnan(wish):
                return SetSpeed(None) if how.is_px4 else Nothing()
            if wish == DEFAULT:
                return SetSpeed(None)
            # planners leave speeds of aircraft there: bound them to the limit
            speed = number(command, 2, "speed", low=MIN_SPEED, high=inf)
            return SetSpeed(min(speed, driving.max_speed))
        case 194:
            return SetReverse(command.params[0] == 1.0)
        case 54000 | 54001 | 54002:
            for index, name in ((5, "run after"), (6, "start delay")):
                if command.params[index - 1] not in HERE:
                    words = f"param{index} {name}: not in a plan item, use TASK_OPTIONS"
                    raise bad(words, param=index)
            return goal_of(command, driving)
        case 54014:
            options_of(command, now=0.0)  # only to check them
        case 54015:
            act_of(command, Command(command.target, 0, (0.0,) * 7, 0, None, NO_MESSAGE))
    return Nothing()


def name_of(command: int) -> str:
    """Return a command's number and name."""
    return f"{command} {row_of_command(command).name}".strip()


def options_of(command: Command, *, now: float) -> Terms:
    """Return the terms in a TASK_OPTIONS. Raise Rejection that names a bad parameter."""
    delay = number(command, 2, "start delay", low=0.0, high=MAX_DELAY, default=0.0)
    deadline = number(command, 3, "deadline", low=0.0, high=MAX_DELAY, default=0.0)
    return Terms(
        priority=whole(command, 1, "priority", high=MAX_PRIORITY, default=DEFAULT_PRIORITY),
        after=identifier(command, 4, "run after"),
        start_at=now + delay if delay else None,
        deadline=now + deadline if deadline else None,
    )


def act_of(whom: Command, what: Command) -> Act:
    """Return the act of a TASK_ACT and the command after it.

    Raise Rejection that names a bad parameter.
    """
    component = whole(whom, 1, "component", high=MAX_COMPONENT)
    limit = number(whom, 2, "time limit", low=0.0, high=LONGEST, default=0.0)
    params = tuple(0.0 if isnan(value) else value for value in what.params)
    return Act(
        what.command,
        params,
        component or AUTOPILOT,
        limit or TIME_LIMIT,
        MavFrame.MISSION.value if what.frame is None else what.frame,
        row_of_command(what.command).role,
    )


def _place(command: Command) -> Place | None:
    """Return the place of an item, None if that is where the vehicle is."""
    is_here = all(part in HERE for part in command.params[4:6])
    return None if is_here and command.frame != MavFrame.LOCAL_NED else place_in(command)


#: numbers, or a kind of the policy table ("-bound" if it is) · what the server does with an item ·
#: how, or why not and what to write · ArduPilot Rover 4.6.3 · PX4 1.17.0; "*": tried there
TABLE = """
16 | drives | drives there. Stops if it has a hold time (param1) or a yaw (param4), or the path
bends by more than 45°; else passes within the acceptance radius (param2; 0:
`driving.acceptance_radius`, 0.5 m). At 0/0: holds here | the same; 0/0 is here* | drives there; at
0/0 it sets off to that place on earth*

17 | drives | drives there and stays until another item is set | the same | the same

18 | drives | drives param1 turns forwards on the circle of param3 metres round the place (negative:
counter-clockwise; at least 0.9 m, and its turning radius). At 0/0: round the place before |
the same, and drives on at the end* | refuses the plan*

19 | drives | as the command: drives there and stands for param1 seconds | the same | the same

20 | drives | as the command: returns; as the last item it also disarms the rover |
drives home, stays armed* | begins its Return mode*

21 | skips | PX4: drives there. ArduPilot: nothing | skips it, and goes on* |
drives there and stays, armed*

22 | skips | PX4: drives there. ArduPilot: nothing | skips it* |
drives there; without an altitude it refuses to start*

93 | drives | as the command: stands for param1 seconds, or until a time of day (UTC) |
the same; if all are 0 it stands until midnight* | ignores a time of day*

112 | drives | delays the following items, up to the next place, by param1 seconds | the same |
stores it

114 | drives | delays them until that place is param1 metres away | the same | stores it

115 | drives | as the command: turns to a heading | skips it* | refuses the plan*

177 | drives | continues with item param1, param2 times in the whole plan (-1: for ever). A loop
without motion is refused | the same* | the same

178 | drives | from here on drives at param2 m/s, at most the server's limit. 0, -1: no change (PX4:
default). -2: default |
no change for 0, -1, -2* | back to its default for 0, -1, -2*

194 | drives | param1 = 1: drives to the following places backwards, else forwards; not a return or
a circle. Refused for a rover that cannot reverse | the same* | refuses the plan*

213 | drives | as the command: drives on a heading for 3 s | until the heading is reached |
refuses the plan

224 | drives | continues with item param1 | refuses the plan | refuses the plan

600 | drives | a place to which DO_JUMP_TAG leads, named by param1 | the same* | refuses the plan

601 | drives | continues with the item after JUMP_TAG param1, param2 times, as DO_JUMP |
the same; ends the plan if there is no such tag* | refuses the plan

4501 | drives | delays the following items, up to the next place, until the rover has passed it |
refuses the plan* | the same*

54000 54001 54002 | drives | as the command; param5 and param6 (after, delay) must be 0 | – | –

54015 | drives | sends the next item once, to component param1 (0: the autopilot), and waits until
it is accepted, for param2 seconds (0: 10; up to 600) | – | –

54014 | drives | options of the whole plan. 1: priority · 2: start delay, s · 3: deadline, s (from
the end of the upload) · 4: run after · 5 (`x`): nonce · 6 (`y`): more bits of it | – | –

82 | skips | a curve; write NAV_WAYPOINT (16) if it shall be driven to | skips it* |
refuses the plan*

193 | skips | a plan does not pause itself; write NAV_DELAY (93) or NAV_LOITER_UNLIM (17) |
skips it* | refuses the plan*

215 | skips | a task that resumes goes on exactly where it was interrupted | goes back by param1
metres when it resumes | refuses the plan

188 189 190 191 | skips | a mark for the autopilot's own return | skips it* | 189: stores it

30 31 83 84 85 94 208 210 212 222 223 3000 42703 | skips | for aircraft, engines, or what others
drive | skips it | 31, 84, 85, 3000: stores it, else refuses the plan

ACTION | sends | sent to the rover as a command when its turn comes | does 179, 181*, 182, 183*,
184*, 195, 197, 201 to 203, 206, 211*, 216*, 531, 532, 534, 1000, 2000, 2001, 2500, 2501; skips 205
and 42600; refuses a plan with another one | does 179, 187, 195 to 197, 200, 201, 203 to 206, 211,
214, 260, 530, 532, 534, 1000, 1001, 2000*, 2001, 2003, 2500, 2501, 42600; refuses a plan with
another one*

217 | sends | sent; scripts on the rover read it | does it; refuses it as a command |
refuses the plan

207 218 | sends | sent; limits or can do anything, so it needs role `safety` | does it* |
refuses the plan*

92 | refuses | nobody else can drive in the middle of a plan: end the plan there |
waits for others' set-points* | refuses the plan*

400 | refuses | the server arms the rover; as the last item NAV_RETURN_TO_LAUNCH (20) disarms it |
refuses the plan* | disarms; the rover rolls on*

42702 | refuses | a script cannot drive in a plan; DO_SEND_SCRIPT_MESSAGE (217) tells it something |
a script drives | refuses the plan

95 159 240 | refuses | it is no command, but the end of a range of them | refuses | refuses

MOTION | refuses | write NAV_WAYPOINT (16) or NAV_LOITER_TURNS (18) to drive somewhere |
refuses | refuses

MOTION-bound | refuses | tests, calibrates or restarts the rover: never on the way |
refuses | refuses

GO GO-bound HALT | refuses | the server starts, stops and arms the rover, and sets its mode: leave
it out, or send it as a command | refuses | refuses

QUESTION | refuses | it asks, and nobody would hear the answer: send it as a command |
refuses | refuses

WISH | refuses | it is about tasks or goes to a place at once: send it as a command, or see 16 |
refuses | refuses

ACTION-bound | refuses | limits or identifies the rover: do that before the plan | refuses | refuses
"""


_PARAGRAPHS = (re.split(r"\s*\|\s*", " ".join(each.split())) for each in TABLE.split("\n\n"))
ROWS = {name: PlanRow(*row) for names, *row in _PARAGRAPHS for name in names.split()}
