"""Wait: stand for a time, or until a time of day."""

from dataclasses import dataclass
from typing import ClassVar

from mav_tasks.kinds.base import Base
from mav_tasks.kinds.form import DURATION, Form
from mav_tasks.kinds.sent import Sent
from mav_tasks.mavlink.enums import MavCmd


@dataclass(frozen=True, slots=True)
class Wait(Base):
    """Stand for ``duration`` seconds.

    With ``until`` it stands until that time of day (UTC), and ``duration`` is when it comes again:
    hour, minute and second, of which the first ones may be -1 = any.
    """

    rule: ClassVar[str] = "wait"
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
        """How long it lasts, s."""
        return self.duration


FORM = Form("wait", "Wait", "Stand still.", (DURATION,), Wait)
