"""Figures that differ from the real ones on purpose or unavoidably, each with the reason.

An explanation covers only a range of simulated values, so that it cannot hide a change.
"""

from dataclasses import dataclass
from fnmatch import fnmatchcase

from rover_sim.compare.figure import Figure, Value
from rover_sim.compare.manoeuvres import DISARM, HOLD, SILENCE
from rover_sim.compare.pairs import Pair


@dataclass(frozen=True, slots=True)
class Explanation:
    """The reason why some figures of some rovers differ."""

    rovers: str  # a pattern of the pair's name
    group: str  # a pattern
    name: str  # a pattern
    between: tuple[float, float] | str | None  # permitted simulated values
    why: str

    def covers(self, pair: Pair, figure: Figure) -> bool:
        """Return whether this explains the figure with its value."""
        return self.is_about(pair, *figure.key) and self._allows(figure.value)

    def is_about(self, pair: Pair, group: str, name: str) -> bool:
        """Return whether this is about the figure with that group and name."""
        return (
            fnmatchcase(pair.name, self.rovers)
            and fnmatchcase(group, self.group)
            and fnmatchcase(name, self.name)
        )

    def _allows(self, value: Value) -> bool:
        if isinstance(self.between, tuple):
            low, high = self.between
            return isinstance(value, (int, float)) and low <= value <= high
        return value == self.between


STANDING, PLACES = "Standing *", "Origin and home"
POWER = "Preflight Fail: system power unavailable"
DENIED = "Arming denied: Resolve system health failures firs"
SHORT_SAMPLE = (
    "Of something that wanders over seconds, 20 s are too short a sample: eight in recordings of"
    " PX4 gave 0.12 to 0.89 after 1 s, -0.13 to 0.65 after 3 s."
)
SHORT_SAMPLES = (
    "20 s are too short a sample of it: four in recordings of SIH gave a mean of 0.007 to 0.031 m/s"
    " and 33 to 40 % below 0.03 m/s, a yaw of 0.11 to 0.30 deg."
)
FARTHEST = (
    "How far a position has strayed at most within five minutes is chance: two recordings of each"
    " gave 0.03 and 0.06 m (differential), 0.71 and 0.99 m (SIH)."
)
ONCE_A_SECOND = (
    "HEARTBEAT comes once a second and not with a change: when in that second is chance."
)
ROLLS_ON = (
    "SIH's rover rolls on for ever when disarmed, which is its model of the vehicle; the simulated"
    " one rolls out, as vehicles do."
)
HEADING_ERROR = "It follows the error of the heading, which wanders by chance."

PX4_DIFFERENTIAL_ONLY = (
    Explanation(
        "px4-differential",
        STANDING,
        "reported speed, max",
        (0.005, 0.019),
        "Four times 20 s recorded gave 0.005 to 0.019 m/s.",
    ),
    Explanation(
        "px4-differential",
        "Standing armed",
        "reported yaw rate, *",
        (0.0, 1.5),
        "The time begins while the turn by the first zeros ends.",
    ),
    Explanation(
        "px4-differential",
        "Estimate and truth",
        "reported yaw off the true one, max",
        (0.05, 2.0),
        "At 195 deg/s 1 deg is 5 ms between truth and message in the recording.",
    ),
    Explanation(
        "px4-differential",
        "Estimate and truth",
        "reported velocity off the true one, max",
        (0.01, 0.06),
        "At 6 m/s² of braking 0.03 m/s are 5 ms between truth and message in the recording.",
    ),
    Explanation(
        "px4-differential",
        "Step 2 m/s",
        "reaches 90 %*",
        None,
        "RO_SPEED_LIM is 90 % of what is asked: a millimetre a second decides.",
    ),
    Explanation(
        "px4-differential",
        "Step 0.*",
        "peak over *",
        (-5.0, 5.0),
        "The recorded one drove 4 to 6 mm/s too fast; the simulated wheels follow exactly.",
    ),
    Explanation(
        "px4-differential",
        HOLD,
        "slower by a tenth after",
        (0.05, 0.12),
        "The recorded one took 0.05 s longer from its answer to HOLD until its wheels slowed.",
    ),
)
PX4_ACKERMANN_ONLY = (
    Explanation(
        "px4-ackermann",
        "Start",
        "reasons given",
        f"{POWER}; {DENIED}",
        "The text about power came in the differential rover's start only.",
    ),
    Explanation("px4-ackermann", STANDING, "*velocity, its mean", (0.004, 0.04), SHORT_SAMPLES),
    Explanation("px4-ackermann", STANDING, "*below 0.03 m/s", (10.0, 70.0), SHORT_SAMPLES),
    Explanation(
        "px4-ackermann",
        "Estimate and truth",
        "reported yaw off the true one, *",
        (1.5, 20.0),
        "Pushing upsets its heading by chance: p95 was 9.2 deg in one recording, 5.5 in another.",
    ),
    Explanation("px4-ackermann", "Step *", "yaw changed*", (0.0, 15.0), HEADING_ERROR),
    Explanation("px4-ackermann", SILENCE, "yaw changed", (60.0, 260.0), HEADING_ERROR),
    Explanation("px4-ackermann", DISARM, "slower by a tenth after", (0.1, 1.0), ROLLS_ON),
    Explanation("px4-ackermann", DISARM, "stands after", (5.0, 15.0), ROLLS_ON),
    Explanation("px4-ackermann", DISARM, "stands within", (2.0, 20.0), ROLLS_ON),
    Explanation("px4-ackermann", DISARM, "yaw changed", (0.0, 3.0), ROLLS_ON),
    Explanation("px4-ackermann", PLACES, "HOME_POSITION, different places", (8, 43), ROLLS_ON),
    Explanation("px4-ackermann", PLACES, "HOME_POSITION, farthest *", (15.0, 50.0), ROLLS_ON),
    Explanation("px4-ackermann", PLACES, "home's moves when disarmed *", (2, 14), ROLLS_ON),
    Explanation(
        "px4-ackermann",
        PLACES,
        "HOME_POSITION, * altitude*",
        (0.0, 0.0),
        "The simulated estimate has no error of height.",
    ),
)

EXPLANATIONS: tuple[Explanation, ...] = (
    Explanation("px4-ackermann", STANDING, "reported yaw, standard*", (0.07, 0.3), SHORT_SAMPLES),
    Explanation("px4-*", STANDING, "* alike after 1 s", (0.1, 0.95), SHORT_SAMPLE),
    Explanation(
        "px4-*", "Estimate and truth", "reported position off, *, max", (0.02, 1.1), FARTHEST
    ),
    Explanation("*", STANDING, "* alike after 3 s", (-0.6, 0.9), SHORT_SAMPLE),
    Explanation(
        "ardupilot-*",
        STANDING,
        "reported position from its mean, *",
        (0.0, 0.04),
        "The recorded position wandered by 2 mm in these 20 s, and by 21 mm in the next.",
    ),
    Explanation(
        "ardupilot-*",
        STANDING,
        "reported speed below 0.03 m/s",
        (30.0, 100.0),
        "It wanders about 0.027 m/s, next to the limit: 20 s recorded gave 100 %, the next 58 %.",
    ),
    Explanation(
        "ardupilot-*",
        "Start",
        "yaw of the first ATTITUDE *",
        (0.5, 1.5),
        "The recorded one had no compass in its first second, and looked north.",
    ),
    Explanation("ardupilot-*", DISARM, "last change of mode *", (0.02, 1.05), ONCE_A_SECOND),
    Explanation("px4-*", HOLD, "last change of mode *", (0.0, 1.05), ONCE_A_SECOND),
    Explanation("px4-*", DISARM, "last change of mode *", (0.0, 1.05), ONCE_A_SECOND),
    Explanation(
        "ardupilot-ackermann",
        "Step 2 m/s",
        "swings back to",
        (0.0, 0.035),
        "Its throttle is cut while it pushes back: it stands then, or rolls on by 2 cm/s.",
    ),
    Explanation(
        "ardupilot-ackermann",
        "Throttle stick, asked 0.5 m/s",
        "speed, stick released",
        (0.0, 0.2),
        "It swings from 3.7 m/s to below what is asked; which moment is looked at decides.",
    ),
    *PX4_DIFFERENTIAL_ONLY,
    *PX4_ACKERMANN_ONLY,
    Explanation(
        "px4-*",
        "Timing",
        "between two LOCAL_POSITION_NED, max",
        (0.02, 0.07),
        "One or two of 11,000 messages were late in the recordings; simulated, none is.",
    ),
    Explanation(
        "px4-*",
        "Timing",
        "acknowledgement *, max",
        (0.02, 0.07),
        "The longest of some 30 answers, most of which take 4 ms, is chance.",
    ),
)


def explanation_of(pair: Pair, figure: Figure) -> Explanation | None:
    """Return the explanation of a figure, or None."""
    return next((each for each in EXPLANATIONS if each.covers(pair, figure)), None)
