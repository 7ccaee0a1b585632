"""The hands on the controller while a rover is probed: each tick is checked before it is driven.

Nothing moves that was not seen armed and in our mode, inside the area, on fresh data. Whatever ends
the driving, zeros and HOLD follow, and it is disarmed if it was us who armed it.
"""

from math import inf

from mav_tasks.engine.services.offboard import OffboardControl, Refused
from mav_tasks.engine.services.orders import STANDING, Speeds
from mav_tasks.engine.services.persona import Persona
from mav_tasks.kinds.guidance import Motion
from mav_tasks.kinds.path import distance
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.probe.conversation import Conversation
from mav_tasks.probe.driving_area import DrivingArea
from mav_tasks.probe.findings import Drive
from mav_tasks.probe.steps import Steps, pause

TAKE_WITHIN = 12.0  # s; PX4 takes four heartbeats
STAND_WITHIN = 4.0  # s of zeros
REST_WITHIN = 10.0  # s, for zeros, HOLD and disarming
SHOW_EACH = 0.25  # s, between requests for a heartbeat
BRAKE_WITHIN = 3.0  # s in HOLD, after which one that is not seen to stand is disarmed all the same


class DriveEnded(Exception):
    """The driving is over before its time; the text says why."""


class DriveController:
    """Our hold on the rover, in an area about the place where it stands now."""

    def __init__(
        self, talk: Conversation, persona: Persona, drive: Drive, area: DrivingArea
    ) -> None:
        self._talk = talk
        self._persona = persona
        self._drive = drive
        self.area = area
        self._tick_at = inf
        self._show_at = -inf
        self._is_ours = False  # armed and in our mode, as long as nobody changes that
        self._may_leave_mode = False
        self.control: OffboardControl = talk.begin_control(persona)

    def __repr__(self) -> str:
        return f"DriveController({self.control!r}, {self.area})"

    @property
    def motion(self) -> Motion:
        """What was measured last; it is there since before the controller was taken."""
        motion = self._talk.motion.latest()
        assert motion is not None
        return motion

    @property
    def now(self) -> float:
        """Monotonic seconds."""
        return self._talk.now

    @property
    def is_still(self) -> bool:
        """Whether it was measured to stand for a while."""
        return self._talk.motion.is_still(now=self.now)

    @property
    def still_speed(self) -> float:
        """The speed below which it stands, m/s."""
        return self._talk.watch.still_speed

    @property
    def ahead(self) -> float:
        """How far ahead of the middle of the area it is, m."""
        return self.area.place_of(self.motion.pose)[0]

    def take(self) -> Steps[None]:
        """Get into control; it does not move. DriveEnded says what it refused."""
        mark, end = len(self._talk.texts), self.now + TAKE_WITHIN
        while not self.control.in_control:
            self.control.take(may_arm=True, now=self.now)
            refused = self.control.refused
            if refused is not None:
                words = _with_texts(f"{_REFUSED[refused]} refused", self._talk.texts[mark:])
                if refused is Refused.ARM:
                    self._drive.arming = words
                raise DriveEnded(words)
            if self.now >= end:
                raise DriveEnded(_with_texts("no control in time", self._talk.texts[mark:]))
            yield from self._tick()
        self._drive.arming = "accepted"
        self._is_ours = True

    def speak(self, persona: Persona) -> None:
        """Use another kind of setpoints from now on; it stands."""
        self.control.adopt(persona)

    def drive(self, wanted: Speeds) -> Steps[None]:
        """Ask for one speed, for one tick."""
        self._check()
        self.control.drive(wanted)
        yield from self._tick()

    def let_go(self) -> Steps[None]:
        """Ask for nothing, for one tick; the rover may leave our mode for it."""
        self._may_leave_mode = True
        self._check()
        yield from self._tick()

    def stand(self) -> Steps[bool]:
        """Ask for zero until it stands; gives whether it does."""
        end = self.now + STAND_WITHIN
        while not self.is_still and self.now < end:
            yield from self.drive(STANDING)
        return self.is_still

    def give_back(self) -> Steps[None]:
        """Zeros, HOLD, and disarmed if we armed it; from whatever state."""
        if not self.control.is_engaged:
            self._drive.left = self._left()
            return
        if self._is_ours and self._talk.mode in self._persona.manual_modes:
            # a person has it: nothing of ours may work against that
            self.control.drive(STANDING)
            yield pause(self._talk.watch.setpoint_period)
            self.control.lose()
            self._drive.left = self._left()
            return
        self.control.begin_release(now=self.now)
        yield pause(self._talk.watch.setpoint_period)
        end, brake_by = self.now + REST_WITHIN, self.now + BRAKE_WITHIN
        while self.control.is_engaged and self.now < end:
            holds = self._talk.mode == self._persona.hold_mode
            if holds:
                self._drive.hold = "yes"
            if not holds or self.is_still or self.now >= brake_by:
                self.control.release(still=self.is_still, disarm=True, now=self.now)
            yield pause(self._talk.watch.setpoint_period)
        if self.control.we_armed:  # asked to, and not seen disarmed since: it may not have shown it
            yield from self._talk.ask(MavCmd.COMPONENT_ARM_DISARM, 0.0)
            self._talk.ask_to_show()
            yield pause(SHOW_EACH)
        self._drive.hold = self._drive.hold or "no"
        self._drive.left = self._left()

    def _left(self) -> str:
        armed = "ARMED" if self._talk.armed else "disarmed"
        return f"{self._persona.mode_name(self._talk.mode)}, {armed}"

    def _tick(self) -> Steps[None]:
        self._tick_at = self.now
        if self.now >= self._show_at:  # by itself it shows once a second whose it is
            self._show_at = self.now + SHOW_EACH
            self._talk.ask_to_show()
        yield pause(self._talk.watch.setpoint_period)
        self._drive.farthest = max(
            self._drive.farthest, distance(self.area.middle, self.motion.pose)
        )

    def _check(self) -> None:
        """Raise DriveEnded for anything that is not as it must be."""
        why = self._why_end()
        if why:
            raise DriveEnded(why)

    def _why_end(self) -> str:
        talk, watch = self._talk, self._talk.watch
        assert talk.monitor is not None
        if self.now - self._tick_at > watch.late_tick:
            return f"a setpoint was {self.now - self._tick_at:.1f} s late"
        if self.now - self.motion.at > watch.motion_fresh:
            return f"no position for {self.now - self.motion.at:.1f} s"
        if not talk.monitor.is_heard(now=self.now):
            return "heartbeats stopped"
        if not self.area.holds(self.motion):
            ahead, right = self.area.place_of(self.motion.pose)
            return f"at the edge of the area: {ahead:.2f} m ahead, {right:.2f} m to the right"
        if not talk.armed and not self._may_leave_mode:
            return "the rover was disarmed"
        if talk.mode != self._persona.control_mode and not self._left_by_itself():
            return f"its mode changed to {self._persona.mode_name(talk.mode)}"
        return talk.others.why_leave()

    def _left_by_itself(self) -> bool:
        """Without setpoints it may go to HOLD, or home; not to a mode that a person drives in."""
        return self._may_leave_mode and self._talk.mode not in self._persona.manual_modes


_REFUSED = {Refused.MODE: "mode", Refused.ARM: "arming"}


def _with_texts(words: str, texts: list[str]) -> str:
    said = "; ".join(dict.fromkeys(texts[-4:]))
    return f"{words}: {said}" if said else words
