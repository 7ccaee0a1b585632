"""What a vehicle reports about itself: its identity, how it stops, turns and drives, its mission.

From this follow the persona that is used, and whether it would stop when setpoints end.
"""

from mav_tasks.engine.vehicles.known_profile import KnownProfile
from mav_tasks.engine.vehicles.parts import Parts
from mav_tasks.mavlink import messages as m
from mav_tasks.services.identity import VehicleIdentity
from mav_tasks.settings import SET_FAILSAFE, Settings, Turning
from mav_tasks.tasks.events import VehicleSeen

NO_MISSION = (0, 0xFFFF)  # MISSION_CURRENT.total: it does not say; there is none


class SelfDescription:
    """What one vehicle has reported about itself so far."""

    def __init__(self, parts: Parts) -> None:
        self._parts = parts
        self._known = KnownProfile(parts.persona)  # from measurements by ``mav-tasks probe``
        self._own_items = 0  # of the mission stored on board
        self.apply(parts.settings)

    def __repr__(self) -> str:
        return f"SelfDescription({self._known!r})"

    def apply(self, settings: Settings) -> None:
        """Apply new settings; a profile is used from the next heartbeat on."""
        self._known.apply(settings.profiles, self._parts.system_id)

    @property
    def may_drive_on(self) -> bool:
        """Whether it might not stop when setpoints end, as it must; False if it never answers."""
        if self._parts.settings.loss_failsafe != "must_stand":
            return False
        failsafe = self._parts.requests.loss_failsafe
        return bool(failsafe.awaits_answer or failsafe.why_off or self._known.why_drives_on)

    def receive_identity(self, identity: VehicleIdentity, *, now: float) -> None:
        self._parts.requests.is_identified = True
        if self._known.identity not in (None, identity):  # new firmware: what it did is asked again
            self._parts.forget_firmware()
        self._known.identify(identity)
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
        self._parts.requests.loss_failsafe.receive(message)
        self._parts.requests.cruise.receive(message)
        self._parts.tasks.cruises(self._parts.requests.cruise.speed)
        self._note_failsafe(now=now)
        turning = self._parts.requests.turning
        before = turning.turning
        turning.receive(message)
        self._known.turns(turning.turning, turning.radius)
        if turning.turning is not before:
            self._use_profile(now=now)
        if turning.turning is Turning.STEERED is not before:
            self._parts.registry.record(
                VehicleSeen(self._parts.system_id, "steers like a car", now)
            )

    def look(self, *, now: float) -> None:
        """Report and apply what has changed; called with each heartbeat."""
        self._note_failsafe(now=now)
        self._use_profile(now=now)

    def _note_failsafe(self, *, now: float) -> None:
        failsafe = self._parts.requests.loss_failsafe
        news = failsafe.take_news()
        if news and failsafe.why_off:
            news = f"{news}. To make it stop: {SET_FAILSAFE}"
        if news and (failsafe.is_unknown or failsafe.why_off):
            self._parts.note(news, now=now)
        elif news:
            self._parts.registry.record(VehicleSeen(self._parts.system_id, news, now))

    def _use_profile(self, *, now: float) -> None:
        """Use its measured profile; the kind of setpoint does not change while it is driven."""
        news = self._known.take_news()
        if news and self._known.chosen is None:
            self._parts.note(news, now=now)
        elif news:
            self._parts.registry.record(VehicleSeen(self._parts.system_id, news, now))
        self._parts.tasks.brakes(self._known.stop)
        persona = self._known.persona
        speaks_alike = (persona.setpoint_mask, persona.setpoint_frame) == (
            self._parts.persona.setpoint_mask,
            self._parts.persona.setpoint_frame,
        )
        if persona != self._parts.persona and (speaks_alike or not self._parts.control.is_engaged):
            self._parts.persona = persona
            self._parts.requests.adopt(persona)
