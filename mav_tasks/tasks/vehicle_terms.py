"""What the tasks of one vehicle go by beside their own terms: speed, brakes, home, identity."""

from dataclasses import replace

from mav_tasks.settings import Driving, Settings
from mav_tasks.tasks.driving.bounds import Bounds
from mav_tasks.tasks.driving.limits import safe_braking
from mav_tasks.tasks.events import (
    VehicleArmingSet,
    VehicleHomeSet,
    VehicleIdentified,
    VehicleSpeedSet,
)
from mav_tasks.tasks.executor import Executor
from mav_tasks.tasks.goal import GlobalPlace
from mav_tasks.tasks.registry import TaskRegistry
from mav_tasks.tasks.task import Frame


class VehicleTerms:
    """What is kept of one vehicle."""

    def __init__(
        self,
        vehicle: int,
        registry: TaskRegistry,
        executor: Executor,
        bounds: Bounds,
        settings: Settings,
    ) -> None:
        self._vehicle = vehicle
        self._registry = registry
        self._executor = executor
        self._bounds = bounds
        self._settings = settings
        self._uid = ""  # of the vehicle, as far as it was heard
        self._speed: float | None = None  # of what names none; None: the settings' one
        self._cruise: float | None = None  # m/s, at which the vehicle itself would drive
        self._stop: tuple[float, float] | None = None  # m/s and m of one that was measured
        #: nobody has disarmed it, or somebody has let go since
        self.may_be_armed = True

    def __repr__(self) -> str:
        return f"VehicleTerms({self._vehicle}, speed={self._speed}, uid={self._uid!r})"

    @property
    def has_uid(self) -> bool:
        """Whether it is known by its unique id whose tasks these are."""
        return bool(self._uid)

    def restore(self, *, speed: float | None, uid: str, may_be_armed: bool) -> None:
        """Take on what was kept by an earlier run."""
        self._speed, self._uid, self.may_be_armed = speed, uid, may_be_armed
        self._apply_driving()

    def apply(self, settings: Settings) -> None:
        """Take new settings."""
        self._settings = settings
        self._apply_driving()

    def _apply_driving(self) -> None:
        self._executor.apply(replace(self._settings, driving=self.driving))
        self._executor.drive.cruise = self._cruise if self._speed is None else None

    @property
    def driving(self) -> Driving:
        """The settings for driving, with the speed that a client has set, and known brakes."""
        driving = self._settings.driving
        if self._stop is not None:
            driving = replace(driving, acceleration=safe_braking(driving, *self._stop))
        return driving if self._speed is None else replace(driving, speed=self._speed)

    def cruises(self, speed: float | None) -> None:
        """Note at what speed the vehicle itself drives, m/s, where none is named; None: unknown."""
        if speed != self._cruise:
            self._cruise = speed
            self._apply_driving()

    def brakes(self, stop: tuple[float, float] | None) -> None:
        """Note how it was seen to stop, m/s and the metres that it took; None: that is unknown."""
        if stop != self._stop:
            self._stop = stop
            self._apply_driving()

    def let_arm(self, *, may_be_armed: bool, now: float) -> None:
        """Keep, over a restart too, whether somebody has disarmed it."""
        if may_be_armed != self.may_be_armed:
            self.may_be_armed = may_be_armed
            self._registry.record(VehicleArmingSet(self._vehicle, may_be_armed, now))

    def is_another(self, uid: str, *, now: float) -> bool:
        """Take in which vehicle it says it is; whether that is not the one whose tasks these are.

        "" is what a vehicle says that does not know.
        """
        if not uid or uid == self._uid:
            return False
        before, self._uid = self._uid, uid
        self._registry.record(VehicleIdentified(self._vehicle, uid, now))
        return bool(before)

    def forget_which(self) -> None:
        """It does not say which one it is, though the one of these tasks has."""
        self._uid = ""

    def set_home(self, place: GlobalPlace, frame: Frame, *, actor: str, now: float) -> None:
        """Keep where the vehicle returns to, as long as it does not boot again."""
        latitude, longitude = place.latitude_degE7, place.longitude_degE7
        home = VehicleHomeSet(self._vehicle, latitude, longitude, frame, actor, now)
        self._bounds.home = home
        self._registry.record(home)

    def set_speed(self, speed: float | None, *, actor: str, now: float) -> None:
        """Set the speed of the task that runs, and of those to come that name none."""
        self._speed = speed
        self._apply_driving()
        self._executor.set_speed(speed)
        self._registry.record(VehicleSpeedSet(self._vehicle, speed, actor, now))
