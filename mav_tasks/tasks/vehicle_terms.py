"""Values of one vehicle that hold for all its tasks: speed, braking, identity, arming."""

from dataclasses import replace

from mav_tasks.settings import Driving, Settings
from mav_tasks.tasks.driving.limits import safe_braking
from mav_tasks.tasks.events import (
    VehicleArmingSet,
    VehicleIdentified,
    VehicleSpeedSet,
)
from mav_tasks.tasks.executor import Executor
from mav_tasks.tasks.registry import TaskRegistry


class VehicleTerms:
    """Store of one vehicle's values for its tasks."""

    def __init__(
        self,
        vehicle: int,
        registry: TaskRegistry,
        executor: Executor,
        settings: Settings,
    ) -> None:
        self._vehicle = vehicle
        self._registry = registry
        self._executor = executor
        self._settings = settings
        #: the unique id of the vehicle of these tasks, "" until it was heard
        self.uid = ""
        self._speed: float | None = None  # m/s, of goals that name none; None: the settings' one
        self._cruise: float | None = None  # m/s, the vehicle's own cruise speed
        self._stop: tuple[float, float] | None = None  # m/s and m of a measured stop
        #: no person has disarmed it, or one has allowed arming since
        self.may_be_armed = True

    def __repr__(self) -> str:
        return f"VehicleTerms({self._vehicle}, speed={self._speed}, uid={self.uid!r})"

    def restore(self, *, speed: float | None, uid: str, may_be_armed: bool) -> None:
        """Load the values of an earlier run."""
        self._speed, self.uid, self.may_be_armed = speed, uid, may_be_armed
        self._apply_driving()

    def apply(self, settings: Settings) -> None:
        self._settings = settings
        self._apply_driving()

    def _apply_driving(self) -> None:
        self._executor.apply(replace(self._settings, driving=self.driving))
        self._executor.drive.cruise = self._cruise if self._speed is None else None

    @property
    def driving(self) -> Driving:
        """Driving settings, with the speed set by a client, and the measured braking."""
        driving = self._settings.driving
        if self._stop is not None:
            driving = replace(driving, acceleration=safe_braking(driving, *self._stop))
        return driving if self._speed is None else replace(driving, speed=self._speed)

    def cruises(self, speed: float | None) -> None:
        """Note the vehicle's own cruise speed, m/s; None: unknown."""
        if speed != self._cruise:
            self._cruise = speed
            self._apply_driving()

    def brakes(self, stop: tuple[float, float] | None) -> None:
        """Note a measured stop: the speed in m/s and the metres that it took; None: unknown."""
        if stop != self._stop:
            self._stop = stop
            self._apply_driving()

    def let_arm(self, *, may_be_armed: bool, now: float) -> None:
        """Set whether the vehicle may be armed; a person who disarms it forbids that. Store it."""
        if may_be_armed != self.may_be_armed:
            self.may_be_armed = may_be_armed
            self._registry.record(VehicleArmingSet(self._vehicle, may_be_armed, now))

    def is_another(self, uid: str, *, now: float) -> bool:
        """Note the reported unique id. Return whether it is another vehicle than the tasks' own.

        A vehicle that does not know its id reports "", which changes nothing.
        """
        if not uid or uid == self.uid:
            return False
        before, self.uid = self.uid, uid
        self._registry.record(VehicleIdentified(self._vehicle, uid, now))
        return bool(before)

    def forget_which(self) -> None:
        """Forget the unique id: the vehicle reports none, but the vehicle of these tasks did."""
        self.uid = ""

    def set_speed(self, speed: float | None, *, actor: str, now: float) -> None:
        """Set the speed of the active task, and of later goals that name none."""
        if speed != self._speed:
            self._registry.record(VehicleSpeedSet(self._vehicle, speed, actor, now))
        self._speed = speed
        self._apply_driving()
        self._executor.set_speed(speed)
