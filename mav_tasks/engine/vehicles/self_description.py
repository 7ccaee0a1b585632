"""What a vehicle reports about itself: its identity, how it stops, turns and drives, its mission.

From this, and from its measured profile, follow the persona that is used, and whether it would stop
when setpoints end. A profile (``mav-tasks probe``) is valid for one unique id and one firmware; one
that does not match is reported, and not used.
"""

from mav_tasks.config.settings import SET_FAILSAFE, Settings, Turning, VehicleProfile
from mav_tasks.engine.services import loss_failsafe as loss
from mav_tasks.engine.services.persona import Persona, with_turning, with_yaw_rate
from mav_tasks.engine.services.vehicle_status import VehicleIdentity
from mav_tasks.engine.vehicles.parts import Parts
from mav_tasks.mavlink import messages as m

NO_MISSION = (0, 0xFFFF)  # MISSION_CURRENT.total: it does not say; there is none


class SelfDescription:
    """What one vehicle has reported about itself so far."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._by_default = parts.persona
        self._says = parts.requests.parameters
        self._identity: VehicleIdentity | None = None
        self._chosen: VehicleProfile | None = None  # its profile
        self._told_profile = ""
        self._told_failsafe = "", False  # why it drives on; whether it hides that
        self._own_items = 0  # of the mission stored on board
        self.apply(parts.settings)

    def __repr__(self) -> str:
        return f"SelfDescription({self._identity}, {self._chosen})"

    def apply(self, settings: Settings) -> None:
        """Apply new settings; a profile is used from the next heartbeat on."""
        system_id = self._parts.system_id
        self._profiles = [each for each in settings.profiles if each.system_id == system_id]
        fitting = [each for each in self._profiles if not self._why_not(each)]
        self._chosen = max(fitting, key=_probed, default=None)

    @property
    def may_drive_on(self) -> bool:
        """Whether it might not stop when setpoints end, as it must; False if it never answers."""
        if self._parts.settings.loss_failsafe != "must_stand":
            return False
        says = self._says
        return says.awaits_failsafe or bool(says.fault[1]) or self._is_known_to_drive_on

    @property
    def _is_known_to_drive_on(self) -> bool:
        return self._chosen is not None and self._chosen.loss_stop == "no"

    def receive_identity(self, identity: VehicleIdentity, *, now: float) -> None:
        self._parts.requests.is_identified = True
        if self._identity not in (None, identity):  # new firmware: what it did is asked again
            self._parts.forget_firmware()
        self._identity = identity
        self.apply(self._parts.settings)
        self._use_profile(now=now)

    def receive_own_mission(self, total: int, *, now: float) -> None:
        """Report a mission stored on board: clients cannot see it, but its mode would drive it."""
        items = total if total not in NO_MISSION else 0
        if items and items != self._own_items and self._parts.settings.claim:
            words = f"has its own mission on board ({items} items): its mission mode runs that"
            self._parts.note(words, now=now)
        self._own_items = items

    def receive_parameter(self, message: m.ParamValue, *, now: float) -> None:
        """Process any parameter of the vehicle."""
        before = self._says.turning
        self._says.receive(message)
        self._parts.tasks.cruises(self._says.cruise_speed)
        self.look(now=now)
        if self._says.turning is Turning.STEERED is not before:
            self._parts.tell("steers like a car", now=now)

    def look(self, *, now: float) -> None:
        """Report and apply what has changed; called with each heartbeat."""
        why_off, is_hidden = told = self._says.fault[1], self._says.hides_failsafe
        before, self._told_failsafe = self._told_failsafe, told
        if is_hidden and not before[1]:
            self._parts.note("does not report whether it stops when setpoints stop", now=now)
        elif why_off != before[0]:
            words = loss.what_it_does(self._says.values) or loss.STOPS
            if why_off:
                self._parts.note(f"{words}. To make it stop: {SET_FAILSAFE}", now=now)
            else:
                self._parts.tell(words, now=now)
        self._use_profile(now=now)

    def _use_profile(self, *, now: float) -> None:
        """Use its measured profile; the kind of setpoint does not change while it is driven."""
        parts, chosen, words = self._parts, self._chosen, self._words_of_profile()
        if words != self._told_profile:
            self._told_profile = words
            report = parts.note if chosen is None else parts.tell
            report(words or "uses no profile any more", now=now)
        speed, way = (None, None) if chosen is None else (chosen.speed, chosen.stopping_distance)
        parts.tasks.brakes(None if speed is None or way is None else (speed, way))
        new, old = self._persona(), parts.persona
        # the mask goes with the frame
        is_alike = new.setpoint_frame == old.setpoint_frame
        if new != old and (is_alike or not parts.control.is_engaged):
            parts.persona = new
            parts.requests.adopt(new)

    def _persona(self) -> Persona:
        """Return the persona, as profile or parameters refine it: what was measured comes first."""
        persona, chosen = self._by_default, self._chosen
        is_honoured = chosen is not None and chosen.yaw_rate == "honoured"
        if chosen is not None and chosen.yaw_rate and is_honoured != persona.honours_yaw_rate:
            persona = with_yaw_rate(persona, is_honoured=is_honoured)
        if chosen is not None and chosen.turning:
            radius = chosen.turning_radius
            return with_turning(persona, Turning(chosen.turning), radius=radius)
        turning = self._says.turning
        if turning is None:
            return persona
        return with_turning(persona, turning, radius=self._says.turning_radius)

    def _words_of_profile(self) -> str:
        """Return which profile is used, or why it is ignored; "" if there is no profile."""
        if self._chosen is not None:
            words = f"uses the profile of {self._chosen.probed[:10]}"
            return words + ": does not stop without setpoints" * self._is_known_to_drive_on
        if self._identity is None or not self._profiles:
            return ""
        return f"ignores the profile: it is {self._why_not(max(self._profiles, key=_probed))}"

    def _why_not(self, profile: VehicleProfile) -> str:
        identity = self._identity
        if identity is None:
            return "of a rover that has not reported its identity"
        if profile.autopilot != self._by_default.name:
            return f"of {profile.autopilot or 'no autopilot'}"
        if profile.uid != identity.uid:
            return "of another rover"
        return f"of firmware {profile.firmware}" * (profile.firmware != identity.firmware)


def _probed(profile: VehicleProfile) -> str:
    return profile.probed
