"""Act: one command to the rover or one of its components, such as a camera, gripper or relay."""

from dataclasses import dataclass
from math import isfinite
from types import MappingProxyType
from typing import ClassVar

from mav_tasks.config.setting_keys.parts import Part
from mav_tasks.config.setting_keys.shapes import Name, Number
from mav_tasks.config.settings import Driving
from mav_tasks.kinds.base import Leg, Took
from mav_tasks.kinds.form import Form, any_number
from mav_tasks.kinds.params import INTEGERS
from mav_tasks.kinds.places import Pose
from mav_tasks.kinds.sent import LARGEST, Sent
from mav_tasks.mavlink.address import AUTOPILOT
from mav_tasks.mavlink.enums import MavCmd, MavFrame

#: of ``done``: the rover has been told, or is just about to be; it has accepted
TOLD, ACCEPTED = 0.5, 1.0
TIME_LIMIT, LONGEST = 10.0, 600.0  # s, for the answer
USUAL = 1.0  # s that one takes, for estimates
LAST_PARAM = 7
MOST_COMMAND = 65_535

#: names of usual commands: the command, and parameters by their numbers from 1
NAMES = MappingProxyType(
    {
        "photo": (2000, {3: 1.0}),
        "camera-trigger": (203, {5: 1.0}),
        "video-start": (2500, {}),
        "video-stop": (2501, {}),
        "gripper-open": (211, {1: 1.0, 2: 0.0}),
        "gripper-close": (211, {1: 1.0, 2: 1.0}),
        "relay-on": (181, {2: 1.0}),
        "relay-off": (181, {2: 0.0}),
        "servo": (183, {}),
        "winch": (42600, {1: 1.0}),
        "script": (217, {}),
    }
)


@dataclass(frozen=True, slots=True)
class Act(Leg):
    """Send one command, once, and wait until it is accepted.

    ``command`` is the number of a MAV_CMD, ``params`` are its seven parameters, 5 and 6 whole
    numbers. ``component`` is the id of the component that it is for, by default the autopilot.
    It fails if it is refused, or not answered within ``time_limit`` seconds. ``frame`` is the
    MAV_FRAME of a place in it. ``role``: the least that may send it, as the server's policy says.
    """

    rule: ClassVar[str] = "act"
    is_standing: ClassVar[bool] = True
    command: int
    params: tuple[float, ...] = (0.0,) * LAST_PARAM
    component: int = AUTOPILOT
    time_limit: float = TIME_LIMIT
    frame: int = MavFrame.MISSION.value
    role: str = "operator"

    @property
    def words(self) -> str:
        given, what = dict(enumerate(self.params, 1)), f"command {self.command}"
        for name, (number, usual) in NAMES.items():
            if number == self.command and usual.items() <= given.items():
                what = name
        whom = "" if self.component == AUTOPILOT else f" of component {self.component}"
        return f"act {what}{whom}"

    @property
    def length(self) -> float:
        return ACCEPTED

    @property
    def is_instant(self) -> bool:
        return True

    def done_so_far(
        self,
        anchor: Pose,  # noqa: ARG002
        pose: Pose,  # noqa: ARG002
        *,
        before: float,
        elapsed: float = 0.0,  # noqa: ARG002
    ) -> float:
        return before

    def released(self, done: float) -> float:
        """It is told again, unless it was accepted."""
        return done if done == ACCEPTED else 0.0

    def took(self, left: float, anchor: Pose, speed: float, driving: Driving) -> Took:  # noqa: ARG002
        return Took(USUAL * left, 0.0, anchor)

    @property
    def sent(self) -> tuple[Sent, ...]:
        """Whom it is for, and the command itself."""
        if len(self.params) != LAST_PARAM:
            raise ValueError(f"{self}: expected {LAST_PARAM} parameters, not {len(self.params)}")
        for index, value in enumerate(self.params, 1):
            is_whole = index in INTEGERS
            fits = isfinite(value) and abs(value) <= LARGEST and value == int(value)
            if not (fits if is_whole else isfinite(value)):
                kind = "a whole number" if is_whole else "a number"
                raise ValueError(f"{self}: param{index} {value:g} is not {kind}")
        one, two, three, four, x, y, z = self.params
        whom = Sent(MavCmd.TASK_ACT, float(self.component), self.time_limit)
        return whom, Sent(self.command, one, two, three, four, self.frame, int(x), int(y), z)


COMMAND = Name(tuple(NAMES), MOST_COMMAND)


def act(
    command: object,
    *,
    component: float | None = None,
    time_limit: float | None = None,
    **params: float | None,
) -> Act:
    """Return an act by a command's name or number; ``param1`` to ``param7`` are its parameters.

    Raise SettingError for an unknown name.
    """
    name = COMMAND.kept(command)
    number, usual = NAMES[name] if isinstance(name, str) else (name, {})
    given = {int(key.removeprefix("param")): value for key, value in params.items()}
    values = (given.get(index) for index in range(1, LAST_PARAM + 1))
    pairs = ((usual.get(at, 0.0) if value is None else value) for at, value in enumerate(values, 1))
    whom = AUTOPILOT if component is None else int(component)
    return Act(number, tuple(pairs), whom, TIME_LIMIT if time_limit is None else time_limit)


def _param(index: int) -> Part:
    whole = index in INTEGERS
    shape = Number(-LARGEST, LARGEST, is_whole=True) if whole else any_number("")
    return Part(f"param{index}", shape, f"parameter {index}; by default that of the name, or 0")


FORM = Form(
    "act",
    "Act (camera, gripper, relay ...)",
    "Send one command to the rover or a component of it, and wait until it is accepted.",
    (
        Part("command", COMMAND, "the number of a MAV_CMD, or a name", True),
        *map(_param, range(1, LAST_PARAM + 1)),
        Part(
            "component", Number(1, 255, is_whole=True), "component id; the autopilot if not given"
        ),
        Part(
            "time_limit",
            Number(0.1, LONGEST, "s"),
            f"limit for the answer; {TIME_LIMIT:g} s if not given",
        ),
    ),
    act,
)
