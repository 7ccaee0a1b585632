"""The person's buttons, and what each sends; a hidden button cannot be pressed."""

from collections.abc import Generator, Iterator
from math import nan

from pymavlink.dialects.v20 import all as mavlink

from tests.kit.qgc.commands import ACCEPTED, UNSUPPORTED, Command, CommandQueue
from tests.kit.qgc.core import AUTOPILOT, Core
from tests.kit.qgc.plan_master import PlanMaster
from tests.kit.qgc.plans import MISSION
from tests.kit.qgc.vehicle import APM, GENERIC, Modes, VehicleState

ARM, SET_MODE, REPOSITION, START = 400, 176, 192, 300
SET_ITEM, FORCE_DISARM = 224, 21196
CUSTOM_MODE = 1
COMMAND_INT = 8  # MAV_PROTOCOL_CAPABILITY
LOOK_EACH, LOOKS, MODE_TRIES = 0.1, 13, 3  # [2.5]

NOT_GUIDED = "Guided mode not supported by Vehicle."
NO_ALTITUDE = "Change altitude not supported."
NO_HOME = "Unable to change altitude, home position unknown."
NOT_STARTED = "Unable to start mission: Vehicle not changing to {} flight mode."
NOT_ARMED = "Unable to start mission: Vehicle rejected arming."

Waiting = Generator[float, None, bool]


class Operator:
    """The buttons of the fly view for one vehicle."""

    def __init__(
        self,
        core: Core,
        vehicle: VehicleState,
        commands: CommandQueue,
        plans: PlanMaster,
    ) -> None:
        self._core = core
        self._vehicle = vehicle
        self._commands = commands
        self._plans = plans
        self._repositions: bool | None = None  # unknown until the first ack

    @property
    def offers(self) -> set[str]:
        """The buttons that are shown now [2.6], [1.5], [11.4]."""
        vehicle, firmware = self._vehicle, self._vehicle.firmware
        shown = {"disarm" if vehicle.armed else "arm"}
        if firmware != GENERIC:
            shown.add("mode")
        if not vehicle.is_flying:
            has_plan = self._plans.has_mission and firmware != GENERIC
            return shown | ({"start"} if has_plan else set())
        shown |= {"emergency stop"} | ({"continue"} if self._plans.has_mission else set())
        if firmware != GENERIC:
            shown |= {"return", "pause"}
        if vehicle.place is not None and vehicle.relative_altitude == vehicle.relative_altitude:
            shown.add("go to")
        return shown

    # all makes

    def arm(self) -> Command:
        """Arm."""
        self._need("arm")
        return self._commands.send_long(ARM, 1)

    def disarm(self) -> Command:
        """Disarm."""
        self._need("disarm")
        return self._commands.send_long(ARM, 0)

    def emergency_stop(self) -> Command:
        """Disarm, in any state."""
        self._need("emergency stop")
        return self._commands.send_long(ARM, 0, FORCE_DISARM)

    def action(self, number: int, *params: float, component: int = AUTOPILOT) -> Command:
        """Press a MAVLink action: any command with seven params [5.2], [11.7]."""
        return self._commands.send_long(number, *params, component=component)

    def set_item(self, seq: int) -> None:
        """Continue with another item of the plan [2.5]; 4.x by message [11.4]."""
        message = mavlink.MAVLink_mission_set_current_message(self._core.system, AUTOPILOT, seq)
        if not self._core.profile.sets_item_by_command:
            self._core.send(message)
            return

        def answered(result: int | None) -> None:
            if result == UNSUPPORTED:
                self._core.send(message)

        self._commands.send_long(SET_ITEM, seq, handler=answered)

    # differs between makes

    def set_mode(self, mode: int) -> None:
        """Choose a mode in the menu."""
        self._need("mode")
        self._send_mode(mode)

    def go_to(self, latitude: float, longitude: float) -> None:
        """Click on the map; degrees."""
        self._need("go to")
        if self._vehicle.firmware == GENERIC:
            self._core.popup(NOT_GUIDED)
        elif self._vehicle.firmware == APM:
            self._core.timers.live(self._go_to_apm(latitude, longitude))
        else:
            self._go_to_px4(latitude, longitude)

    def pause(self) -> None:
        """Press Pause."""
        self._need("pause")
        if self._vehicle.firmware == APM:
            self._core.popup(NO_ALTITUDE)
        elif self._vehicle.home is None:
            self._core.popup(NO_HOME)
        else:
            altitude = self._vehicle.home.altitude + self._vehicle.relative_altitude
            self._commands.send_long(
                *(REPOSITION, -1, CUSTOM_MODE, 0, nan, nan, nan, nan),
                handler=lambda result: self._paused(result, altitude),
            )

    def pause_all(self) -> None:
        """Press Pause in the list of several vehicles."""
        if self._vehicle.firmware == APM:
            self._send_mode(self._modes.hold)
        else:
            self._commands.send_long(REPOSITION, -1, CUSTOM_MODE, 0, nan, nan, nan, nan)

    def start(self) -> None:
        """Start the mission."""
        self._need("start")
        self._core.timers.live(self._start())

    def go_on(self) -> None:
        """Continue the mission: the same as starting it [2.5]."""
        self._need("continue")
        if self._vehicle.firmware == GENERIC:
            self._core.popup(NOT_GUIDED)
        else:
            self._core.timers.live(self._start())

    # internals

    @property
    def _modes(self) -> Modes:
        modes = self._vehicle.modes
        assert modes is not None, "a generic vehicle has no modes that are known"
        return modes

    def _need(self, button: str) -> None:
        assert button in self.offers, f"no button {button!r}: {self._vehicle}"

    def _send_mode(self, mode: int) -> None:
        if self._vehicle.firmware == APM:
            self._commands.send_long(SET_MODE, CUSTOM_MODE, mode)
            return
        base = self._vehicle.base_mode & 0x80 | CUSTOM_MODE
        self._commands.expect_mode_ack()
        self._core.send(mavlink.MAVLink_set_mode_message(self._core.system, base, mode))

    def _change_mode(self, mode: int) -> Waiting:
        """Request up to three times, each followed by 13 checks of the heartbeat, every 0.1 s."""
        if self._vehicle.mode == mode:
            return True
        for _ in range(MODE_TRIES):
            self._send_mode(mode)
            for _ in range(LOOKS):
                yield LOOK_EACH
                if self._vehicle.mode == mode:
                    return True
        return False

    def _arm_and_see(self) -> Waiting:
        for _ in range(MODE_TRIES):
            if self._vehicle.armed:
                return True
            self._commands.send_long(ARM, 1, shows_errors=False)
            for _ in range(LOOKS):
                yield LOOK_EACH
                if self._vehicle.armed:
                    return True
        return False

    def _start(self) -> Iterator[float]:
        if self._vehicle.firmware == APM and not self._vehicle.is_flying:
            if not (yield from self._change_mode(self._modes.guided)):
                self._core.popup(NOT_STARTED.format("Guided"))
            elif not (yield from self._arm_and_see()):
                self._core.popup(NOT_ARMED)
            else:
                self._commands.send_long(START)
        elif not (yield from self._change_mode(self._modes.mission)):
            name = "Auto" if self._vehicle.firmware == APM else "Mission"
            self._core.popup(NOT_STARTED.format(name))
        elif self._vehicle.firmware != APM and not (yield from self._arm_and_see()):
            self._core.popup(NOT_ARMED)

    def _go_to_apm(self, latitude: float, longitude: float) -> Iterator[float]:
        """Send up to three messages, until the vehicle's support is known [2.5], [11.3]."""
        assert self._vehicle.place is not None
        knows = self._repositions
        if knows is not False:
            self._commands.send_int(
                *(REPOSITION, -1, CUSTOM_MODE, 0, nan),
                frame=0,
                x=round(latitude * 1e7),
                y=round(longitude * 1e7),
                z=self._vehicle.place.altitude,
                handler=self._reposition_answered,
            )
        if knows:
            return
        yield from self._change_mode(self._modes.guided)
        altitude = self._vehicle.relative_altitude
        self._plans.managers[MISSION].send_guided(latitude, longitude, altitude)

    def _reposition_answered(self, result: int | None) -> None:
        if result in (ACCEPTED, UNSUPPORTED):
            self._repositions = result == ACCEPTED

    def _go_to_px4(self, latitude: float, longitude: float) -> None:
        assert self._vehicle.place is not None
        altitude = self._vehicle.place.altitude
        params = (-1, CUSTOM_MODE, 0, nan)
        if self._plans.capabilities & COMMAND_INT:
            x, y = round(latitude * 1e7), round(longitude * 1e7)
            self._commands.send_int(REPOSITION, *params, frame=0, x=x, y=y, z=altitude)
        else:
            self._commands.send_long(REPOSITION, *params, latitude, longitude, altitude)

    def _paused(self, result: int | None, altitude: float) -> None:
        if result == ACCEPTED:
            self._commands.send_long(REPOSITION, -1, CUSTOM_MODE, 0, nan, nan, nan, altitude)
