"""The simulated rovers beside the real ones, each in a world of its own in virtual time."""

import math
import statistics
from collections.abc import Callable, Coroutine, Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any, TypeVar

from mav_tasks.links.base import Link
from mav_tasks.links.memory import Conditions, MemoryNet
from rover_sim.body import Pose
from rover_sim.check_vehicle.figures import FIGURES, Row, Value, rows_of
from rover_sim.check_vehicle.manoeuvres import Drive, Moment
from rover_sim.frames import Frame
from rover_sim.kinematic_bodies import kinematic_body
from rover_sim.observing.driver import Driver
from rover_sim.observing.observer import Observer
from rover_sim.observing.track import Track
from rover_sim.observing.virtual import ROVER, VirtualGround
from rover_sim.personas import PERSONAS
from rover_sim.realism import Gps
from rover_sim.vehicle import make_vehicle

T = TypeVar("T")

LOOPBACK = Conditions(delay=0.0001)  # s each way; the real rovers were recorded on one machine
RUNS = 5  # a single run could deviate by chance as much as a recording


@dataclass(frozen=True, slots=True)
class Make:
    """An autopilot with a frame, and the one that was recorded."""

    persona: str
    frame: Frame
    real: str
    heading: float = 0.0  # rad, the recorded one's at the start
    gps: Gps = Gps.FINE  # class of the recorded one's errors


#: by the names of the columns of real.csv
ROVERS = {
    "ardupilot-skid": Make("ardupilot", Frame.SKID, "ArduPilot Rover 4.6.3 SITL, rover-skid"),
    "ardupilot-ackermann": Make("ardupilot", Frame.ACKERMANN, "ArduPilot Rover 4.6.3 SITL, rover"),
    "px4-differential": Make(
        "px4", Frame.DIFFERENTIAL, "PX4 1.17.0 SITL, kinematic differential rover", math.pi / 2
    ),
    "px4-ackermann": Make(
        "px4", Frame.ACKERMANN, "PX4 1.17.0, the Ackermann rover of its SIH", gps=Gps.METRE
    ),
}


def in_its_world(make: Make, seed: int, run: Callable[[Link, Track], Coroutine[Any, Any, T]]) -> T:
    """Switch a rover on, and run what is done with a link to it and its true track.

    Its wheels neither slip nor vary between rovers, as in the recordings.
    """
    persona = PERSONAS[make.persona].on(make.frame)
    realism = replace(persona.realism, boot=persona.boot, estimator=persona.estimators[make.gps])
    body = kinematic_body(make.frame, start=Pose(yaw=make.heading), slip=0.0, seed=None)
    vehicle = make_vehicle(body, system_id=1, now=0.0, persona=persona, realism=realism, seed=seed)
    ground = VirtualGround(vehicle, MemoryNet(conditions=LOOPBACK))
    return ground.run(run(ground.net.link("checker", peers=(ROVER,)), ground.truth))


async def drive(link: Link, truth: Track) -> dict[str, Moment]:
    """Drive a rover through the manoeuvres."""
    with closing(Observer(link, keeps=True)) as observer:
        return await Drive(Driver(observer), truth).run()


def measure(name: str, *, seed: int) -> Iterator[tuple[Row, Value]]:
    """Yield each figure of a real rover with its simulated value, the median of some runs."""
    drives = [in_its_world(ROVERS[name], seed + run, drive) for run in range(RUNS)]
    for row in rows_of(name):
        look = FIGURES[row.figure]
        yield row, _middle([look(moments[row.mark]) for moments in drives])


def _middle(values: list[Value]) -> Value:
    """Return the median of numbers; for words, or if some are None, the most frequent value."""
    numbers = [float(value) for value in values if isinstance(value, int | float)]
    return statistics.median(numbers) if len(numbers) == len(values) else statistics.mode(values)
