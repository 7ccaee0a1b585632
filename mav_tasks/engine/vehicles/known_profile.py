"""The measured profile of a vehicle, if it belongs to this very vehicle.

A profile is valid for one unique id and one firmware. A profile that does not match is reported,
and not used.
"""

from mav_tasks.services.identity import VehicleIdentity
from mav_tasks.services.persona import Persona, with_turning, with_yaw_rate
from mav_tasks.settings import Turning, VehicleProfile


class KnownProfile:
    """Chooses among the profiles for one system id."""

    def __init__(self, persona: Persona) -> None:
        self._by_default = persona
        self._profiles: tuple[VehicleProfile, ...] = ()
        #: what it has reported last
        self.identity: VehicleIdentity | None = None
        #: the profile of this vehicle, or None
        self.chosen: VehicleProfile | None = None
        self._told = ""
        self._said: tuple[Turning | None, float | None] = None, None  # from its parameters

    def __repr__(self) -> str:
        return f"KnownProfile({self.chosen})"

    @property
    def persona(self) -> Persona:
        """The persona, as far as the profile and parameters refine it."""
        return self._turning_as_known(self._read_as_known())

    @property
    def stop(self) -> tuple[float, float] | None:
        """A measured stop: speed in m/s, and stopping distance in m."""
        if self.chosen is None or self.chosen.speed is None:
            return None
        if self.chosen.stopping_distance is None:
            return None
        return self.chosen.speed, self.chosen.stopping_distance

    @property
    def why_drives_on(self) -> str:
        """Why it would not stop when setpoints end, in words; "" if it stops or is unknown."""
        is_off = self.chosen is not None and self.chosen.loss_stop == "no"
        return "its profile says that it does not stop without setpoints" if is_off else ""

    def identify(self, identity: VehicleIdentity) -> None:
        self.identity = identity
        self._choose()

    def apply(self, profiles: tuple[VehicleProfile, ...], system_id: int) -> None:
        self._profiles = tuple(each for each in profiles if each.system_id == system_id)
        self._choose()

    def take_news(self) -> str:
        """Return which profile is used, or why none is, in words; "" if that has not changed."""
        words = self._words()
        if words == self._told:
            return ""
        self._told = words
        return words or "uses no profile any more"

    def _read_as_known(self) -> Persona:
        known = "" if self.chosen is None else self.chosen.yaw_rate
        if not known or (known == "honoured") == self._by_default.honours_yaw_rate:
            return self._by_default
        return with_yaw_rate(self._by_default, is_honoured=known == "honoured")

    def turns(self, turning: Turning | None, radius: float | None) -> None:
        """Note how the vehicle turns by its parameters; None if they do not say."""
        self._said = turning, radius

    def _turning_as_known(self, persona: Persona) -> Persona:
        """Prefer the profile, which was measured, to the parameters."""
        if self.chosen is None or not self.chosen.turning:
            turning, said = self._said
            return persona if turning is None else with_turning(persona, turning, radius=said)
        radius = self.chosen.turning_radius
        return with_turning(persona, Turning(self.chosen.turning), radius=radius)

    def _choose(self) -> None:
        fitting = [each for each in self._profiles if not self._why_not(each)]
        self.chosen = max(fitting, key=lambda each: each.probed, default=None)

    def _words(self) -> str:
        if self.chosen is not None:
            words = f"uses the profile of {self.chosen.probed[:10]}"
            return f"{words}: does not stop without setpoints" if self.why_drives_on else words
        if self.identity is None or not self._profiles:
            return ""
        latest = max(self._profiles, key=lambda each: each.probed)
        return f"ignores the profile: it is {self._why_not(latest)}"

    def _why_not(self, profile: VehicleProfile) -> str:
        identity = self.identity
        if identity is None:
            return "of a rover that has not reported its identity"
        if profile.autopilot != self._by_default.name:
            return f"of {profile.autopilot or 'no autopilot'}"
        if profile.uid != identity.uid:
            return "of another rover"
        if profile.firmware != identity.firmware:
            return f"of firmware {profile.firmware}"
        return ""
