"""What a rover is made to do to see how it does it: short, slow, and inside the area."""

from collections.abc import Callable
from dataclasses import replace
from math import degrees, pi

from mav_tasks.engine.services.orders import STANDING, Speeds
from mav_tasks.engine.services.persona import BY_COURSE, WITH_YAW_RATE, Persona
from mav_tasks.kinds.path import distance, forward_of, wrap
from mav_tasks.mavlink.enums import MavFrame
from mav_tasks.probe.drive_controller import DriveController, DriveEnded
from mav_tasks.probe.findings import Drive
from mav_tasks.probe.steps import Steps

TRIAL_SPEED = 0.2  # m/s
TRIAL_WAY = 0.1  # m; further a trial need not go
FOLLOWED = 0.04  # m by which it must have moved
TRIAL_TIME = 1.5  # s at the most
OF_THE_FAILSAFE = 0.7  # of its time: a setpoint that does not count must not set it off
TURN_RATE = 0.4  # rad/s
TURN_TIME = 1.5  # s
TURNED = 0.5  # of the wanted turn: it turns on the spot
STRAIGHT = 0.3  # rad, of heading that driving backwards may change
STAND_TIME = 2.0  # s of zeros
RUN_UP = 10.0  # s at the most: it may have to turn round first
AT_SPEED = 0.85  # of the speed wanted
STEADY = 0.3  # s
ON_COURSE = 0.15  # rad
SLOWING = 0.7  # of the speed: below, it has begun to stop
STOP_TIME = 5.0  # s in which it must stand
LOSS_SPARE = 3.0  # s beyond the time that its failsafe says
LEAST_SPEED = 0.08  # m/s, at which a stop still shows
BACK_TO = -0.4  # m ahead of the middle, from where there is room for the rest


class Kind:
    """One kind of velocity setpoints."""

    def __init__(self, persona: Persona, mask: int, frame: MavFrame, *, by_course: bool) -> None:
        self.name = f"{frame.name} 0x{mask:04X}"
        self.mask, self.frame = mask, frame
        self.persona = replace(
            persona,
            honours_yaw_rate=not by_course,
            setpoint_mask=mask,
            setpoint_frame=frame,
        )
        self.by_course = by_course

    def __repr__(self) -> str:
        return f"Kind({self.name})"

    def speeds(self, speed: float, course: float) -> Speeds:
        """Return what asks for this speed, in the direction in which it points anyway."""
        return Speeds(speed, 0.0, course if self.by_course else None)


def kinds_of(persona: Persona) -> list[Kind]:
    """Return all that the server could use, the persona's own first."""
    kinds = [
        Kind(persona, BY_COURSE, MavFrame.LOCAL_NED, by_course=True),
        Kind(persona, BY_COURSE, MavFrame.BODY_NED, by_course=False),
        Kind(persona, WITH_YAW_RATE, MavFrame.BODY_NED, by_course=False),
    ]
    own = (persona.setpoint_mask, persona.setpoint_frame)
    return sorted(kinds, key=lambda kind: (kind.mask, kind.frame) != own)


class Trials:
    """Goes through them, and writes down what came of each."""

    def __init__(
        self,
        controller: DriveController,
        persona: Persona,
        drive: Drive,
        *,
        speed: float,
        loss_time: float,
        is_car: bool = False,
    ) -> None:
        """``speed`` m/s of the stop; ``loss_time`` s without setpoints until it is to stop.

        ``is_car``: it turns only while it rolls, and is not asked to do so on the spot.
        """
        self._is_car = is_car
        self._controller = controller
        self._persona = persona
        self._drive = drive
        self._speed = speed
        self._loss_time = loss_time
        self._own = kinds_of(persona)[0]

    def __repr__(self) -> str:
        return f"Trials({self._drive})"

    def run(self, *, with_loss: bool) -> Steps[None]:
        """All of them; DriveEnded if one cannot go on."""
        for kind in kinds_of(self._persona):
            yield from self._try_kind(kind)
        yield from self._look_at_standing()
        yield from self._try_turning()
        yield from self._try_reverse()
        self._controller.speak(self._own.persona)
        yield from self._measure_stop()
        if with_loss:
            yield from self._measure_loss()

    def _try_kind(self, kind: Kind) -> Steps[None]:
        controller = self._controller
        before = controller.motion.pose
        wanted = kind.speeds(TRIAL_SPEED, before.yaw)
        yield from self._with(kind, wanted, lambda: distance(before, controller.motion.pose))
        yield from self._rest()
        followed = distance(before, controller.motion.pose) >= FOLLOWED
        (self._drive.accepted if followed else self._drive.refused).append(kind.name)
        if not followed and kind.name == self._own.name:
            raise DriveEnded(f"the rover does not follow {kind.name}")

    def _with(self, kind: Kind, wanted: Speeds, way: Callable[[], float]) -> Steps[None]:
        controller, limit = self._controller, TRIAL_TIME
        if self._persona.has_loss_failsafe and kind.name != self._own.name:
            limit = min(limit, OF_THE_FAILSAFE * self._loss_time)
        controller.speak(kind.persona)
        end = controller.now + limit
        while controller.now < end and abs(way()) < TRIAL_WAY:
            yield from controller.drive(wanted)

    def _rest(self) -> Steps[None]:
        self._controller.speak(self._own.persona)
        if not (yield from self._controller.stand()):
            raise DriveEnded("the rover does not stand on zero setpoints")

    @property
    def _rate_kind(self) -> Kind | None:
        rate = Kind(self._persona, WITH_YAW_RATE, MavFrame.BODY_NED, by_course=False)
        return rate if rate.name in self._drive.accepted else None

    def _look_at_standing(self) -> Steps[None]:
        """A PX4 takes a velocity of zero for a course: does it turn where it is to stand?"""
        controller = self._controller
        controller.speak(self._own.persona)
        before, end = controller.motion.pose.yaw, controller.now + STAND_TIME
        while controller.now < end:
            yield from controller.drive(STANDING)
        self._drive.turned_standing_deg = round(
            degrees(wrap(controller.motion.pose.yaw - before)), 1
        )

    def _try_turning(self) -> Steps[None]:
        kind, controller, drive = self._rate_kind, self._controller, self._drive
        if kind is None:
            drive.yaw_rate = "ignored"
            return
        if self._is_car:
            drive.yaw_rate = "honoured"
            return
        shares: list[float] = []
        for rate in (TURN_RATE, -TURN_RATE):
            controller.speak(kind.persona)
            before, end, turned = controller.motion.pose.yaw, controller.now + TURN_TIME, 0.0
            while controller.now < end:
                yield from controller.drive(Speeds(0.0, rate))
                turned = wrap(controller.motion.pose.yaw - before)
            shares.append(turned / (rate * TURN_TIME))
            yield from self._rest()
        drive.turned_of_wanted = round(min(shares), 2)
        drive.yaw_rate = "honoured" if min(shares) >= TURNED else "ignored"

    def _try_reverse(self) -> Steps[None]:
        kind, controller, drive = self._rate_kind, self._controller, self._drive
        if kind is None:
            drive.reverse = "no"
            return
        before = controller.motion.pose
        backwards = Speeds(-TRIAL_SPEED)
        yield from self._with(kind, backwards, lambda: forward_of(before, controller.motion.pose))
        backed = forward_of(before, controller.motion.pose) <= -FOLLOWED
        straight = abs(wrap(controller.motion.pose.yaw - before.yaw)) < STRAIGHT
        drive.reverse = "yes" if backed and straight else "no"
        if drive.reverse == "yes":  # and on, for room ahead
            end = controller.now + RUN_UP
            while controller.ahead > BACK_TO and controller.now < end:
                yield from controller.drive(backwards)
        yield from self._rest()

    def _measure_stop(self) -> Steps[None]:
        controller, drive = self._controller, self._drive
        speed = yield from self._run_up(self._speed, stop_time=1.0)
        before, began = controller.motion.pose, controller.now
        stood_at = began
        end = began + STOP_TIME
        while not controller.is_still and controller.now < end:
            yield from controller.drive(STANDING)
            if controller.motion.speed > controller.still_speed:
                stood_at = controller.now
        if not controller.is_still:
            raise DriveEnded(f"the rover does not stand within {STOP_TIME:g} s of zero setpoints")
        drive.speed = round(speed, 3)
        drive.stopping_distance = round(distance(before, controller.motion.pose), 3)
        drive.stopping_time = round(stood_at - began, 2)

    def _measure_loss(self) -> Steps[None]:
        """Drive, then say nothing: does it stop by itself, and where?"""
        controller, drive = self._controller, self._drive
        course, room = self._roomiest()
        speed = min(TRIAL_SPEED, (room - 0.25) / (self._loss_time + 1.5))
        if speed < LEAST_SPEED:
            drive.loss_note = (
                f"not tried: only {room:.1f} m ahead for a wait of {self._loss_time:g} s"
            )
            return
        speed = yield from self._run_up(speed, stop_time=self._loss_time, course=course)
        before, began = controller.motion.pose, controller.now
        end = began + self._loss_time + LOSS_SPARE
        slowed_at: float | None = None
        try:
            while not controller.is_still and controller.now < end:
                yield from controller.let_go()
                if slowed_at is None and controller.motion.speed < SLOWING * speed:
                    slowed_at = controller.now
        except DriveEnded:
            if controller.now > began + self._loss_time + 1.0 and slowed_at is None:
                drive.loss_stop = "no"
            raise
        drive.loss_stop = "yes" if controller.is_still else "no"
        drive.loss_speed = round(speed, 3)
        drive.loss_distance = round(distance(before, controller.motion.pose), 3)
        if slowed_at is not None:
            drive.setpoint_timeout = round(slowed_at - began, 2)
        if drive.loss_stop == "no":
            raise DriveEnded(
                f"the rover still drives {controller.now - began:.1f} s after the last setpoint"
            )

    def _run_up(
        self, speed: float, *, stop_time: float, course: float | None = None
    ) -> Steps[float]:
        """Drive straight until the speed is steady; gives it. It turns round where there is room.

        ``stop_time``: s that it may go on at that speed when the run-up is over.
        """
        controller, kind = self._controller, self._own
        if course is None:
            course, _ = self._roomiest()
        end, steady_since = controller.now + RUN_UP, controller.now
        while controller.now < end:
            yield from controller.drive(kind.speeds(speed, course))
            motion = controller.motion
            is_off = abs(wrap(course - motion.pose.yaw)) > ON_COURSE
            if is_off or motion.forward < AT_SPEED * speed:
                steady_since = controller.now
            if controller.now - steady_since >= STEADY:
                return motion.forward
            if not is_off and controller.area.room(motion.pose, course) < speed * (stop_time + 0.5):
                break
        raise DriveEnded(f"the rover does not reach {speed:.2f} m/s within the area")

    def _roomiest(self) -> tuple[float, float]:
        """Return the direction, ahead or where it can turn to by itself, with the most room; m."""
        controller = self._controller
        yaw = controller.motion.pose.yaw
        turns_round = self._own.by_course and not self._is_car
        courses = [yaw, yaw + pi] if turns_round else [yaw]
        return max(
            ((c, controller.area.room(controller.motion.pose, c)) for c in courses),
            key=lambda x: x[1],
        )
