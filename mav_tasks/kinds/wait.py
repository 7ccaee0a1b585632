"""Wait: stand for a time, or until a time of day."""

from dataclasses import dataclass
from typing import ClassVar

from mav_tasks.config.settings import Driving
from mav_tasks.kinds.base import Leg
from mav_tasks.kinds.form import DURATION, Form
from mav_tasks.kinds.params import MAX_WAIT, Given, Parsers, number, whole
from mav_tasks.kinds.sent import Sent
from mav_tasks.mavlink.enums import MavCmd

MINUTE, HOUR, DAY = 60.0, 3600.0, 86_400.0  # s
SHORT = 1.0  # s; a loop of shorter waits would only keep the server busy
LATE = 1.0  # s that a clock may have been set back by


@dataclass(frozen=True, slots=True)
class Wait(Leg):
    """Stand for ``duration`` seconds.

    With ``until`` it stands until that time of day (UTC), and ``duration`` is when it comes again:
    hour, minute and second, of which the first ones may be -1 = any.
    """

    rule: ClassVar[str] = "wait"
    is_standing: ClassVar[bool] = True
    duration: float
    until: tuple[int, ...] = ()

    @property
    def words(self) -> str:
        if self.until:
            return f"wait until {':'.join(f'{part:02}' for part in self.until)} UTC"
        return f"wait {self.duration:g} s"

    @property
    def sent(self) -> tuple[Sent, ...]:
        return (Sent(MavCmd.NAV_DELAY, self.duration),)

    @property
    def length(self) -> float:
        return self.duration

    @property
    def is_instant(self) -> bool:
        return self.duration < SHORT

    def done_at(self, done: float, *, utc: float) -> float:
        if not self.until:
            return done
        hours, minutes, seconds = (max(part, 0) for part in self.until)
        left = (hours * HOUR + minutes * MINUTE + seconds - utc) % self.duration
        over = self.duration - left
        return over if over >= done - LATE else self.duration  # that time came meanwhile


def _delay(command: Given, _driving: Driving) -> Wait:
    wish = command.params[0]
    if wish < 0.0 or (wish == 0.0 and any(command.params[1:4])):
        return _time_of_day(command)
    return Wait(number(command, 1, "delay", low=0.0, high=MAX_WAIT))


def _time_of_day(command: Given) -> Wait:
    until = tuple(
        whole(command, index, name, low=-1, high=high, default=-1)
        for index, name, high in ((2, "hour", 23), (3, "minute", 59), (4, "second", 59))
    )
    again = [period for part, period in zip(until, (DAY, HOUR, MINUTE), strict=True) if part >= 0]
    return Wait(again[0], until) if again else Wait(0.0)


#: how its commands are read
PARSERS: Parsers = {
    MavCmd.NAV_DELAY: _delay,
}

FORM = Form("wait", "Wait", "Stand still.", (DURATION,), Wait)
