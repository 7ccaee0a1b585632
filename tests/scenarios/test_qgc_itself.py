"""The station of the other test_qgc files: it complains when a vehicle misbehaves, and as told.

Without these its silence in the others would say nothing. Times and texts are those of the real
one, seen at a stub.
"""

from dataclasses import replace
from typing import Any

import pytest

from mav_tasks.in_memory import CLIENT_LINK
from mav_tasks.links.memory import MemoryNet
from rover_sim.virtual import VirtualWorld
from tests.kit.qgc import guided, parameters
from tests.kit.qgc.party import QgcParty
from tests.kit.qgc.plan_master import RUNS, Plan
from tests.kit.qgc.profile import MASTER, V4, V42, Profile
from tests.kit.qgc.stub import (
    APM_AUTOPILOT,
    APM_SET,
    GENERIC_AUTOPILOT,
    PX4_SET,
    Stub,
)
from tests.kit.qgc.vehicle import MODES, PX4

HOME = (473977418, 85455938)
PLAN = Plan(HOME, [(473977500, 85455938), (473977600, 85455938), (473977700, 85455938)])
SILENT = {148, 300, 397, 395}
OFFBOARD = 6 << 16

both = pytest.mark.parametrize("profile", [V4, MASTER], ids=lambda p: p.name)


class Pair(VirtualWorld):
    """A station and a stub."""

    def __init__(self, profile: Profile = V4, **how: Any) -> None:
        super().__init__(MemoryNet())
        if how.get("autopilot") == APM_AUTOPILOT:
            how = {"parameters": dict(APM_SET), "mode": 4} | how
        self.stub = Stub(self.net, CLIENT_LINK, **how)
        self.party = QgcParty(self.net, "qgc", profile)
        self.join(self.stub, self.party)

    def connected(self, within: float = 5.0) -> "Pair":
        assert self.run_until(lambda: self.party.is_connected, within=within)
        return self

    def driving(self) -> "Pair":
        self.connected()
        self.stub.armed, self.stub.landed_state = True, 2
        self.run(1.1)
        return self

    @property
    def popups(self) -> list[str]:
        return self.party.popups

    def popup_at(self, text: str) -> float:
        found = [s.at for s in self.party.qgc.screen.popups if s.text.startswith(text)]
        assert len(found) == 1, self.popups
        return found[0]


class TestConnecting:
    @both
    @pytest.mark.parametrize("autopilot", [APM_AUTOPILOT, 12, GENERIC_AUTOPILOT])
    def test_to_a_good_vehicle_is_quick_and_silent(self, profile: Profile, autopilot: int) -> None:
        pair = Pair(profile, autopilot=autopilot).connected(within=2.5)
        pair.run(20)
        pair.party.check()

    def test_begins_in_mavlink_1_and_goes_on_in_2(self) -> None:
        pair = Pair()
        pair.run(1.5)
        markers = [message.get_msgbuf()[0] for _, _, message in pair.stub.heard]
        first_of_2 = markers.index(0xFD)
        assert markers == [0xFE] * first_of_2 + [0xFD] * (len(markers) - first_of_2)
        assert {name for _, name, _ in pair.stub.heard[:first_of_2]} == {"HEARTBEAT"}

    def test_asks_in_the_order_that_was_seen(self) -> None:
        pair = Pair().connected()
        asked = [(n, int(getattr(m, "param1", 0))) for _, n, m in pair.stub.heard[1:]]
        order = [(n, p) for n, p in asked if n not in ("HEARTBEAT", "MISSION_ACK", "SYSTEM_TIME")]
        requests = [("COMMAND_LONG", number) for number in (148, 300, 397, 395)]
        lists = [("PARAM_REQUEST_LIST", 0), *[("MISSION_REQUEST_LIST", 0)] * 3]
        assert order == [*requests, *lists]

    def test_asks_ardupilot_for_streams_in_five_rounds(self) -> None:
        pair = Pair(autopilot=APM_AUTOPILOT).connected()
        pair.run(30)
        times = [at for at, name, _ in pair.stub.heard if name == "REQUEST_DATA_STREAM"]
        assert len(times) == 35
        assert times[-1] - times[0] == pytest.approx(17.0, abs=0.1)
        assert not any(n == "COMMAND_LONG" and m.param1 == 300 for _, n, m in pair.stub.heard)

    def test_without_a_protocol_version_falls_back_to_mavlink_1(self) -> None:
        pair = Pair(silent_requests={300}).connected(within=10)
        assert pair.popups == []
        assert "fell back" in pair.party.qgc.screen.violations[0].text
        tries = [
            at for at, name, m in pair.stub.heard if name == "COMMAND_LONG" and m.param1 == 300
        ]
        gaps = [at - tries[0] for at in tries]
        assert len(tries) == 3
        assert 3.0 <= gaps[1] <= 3.5
        assert gaps[2] - gaps[1] == pytest.approx(0.5, abs=0.01)
        kinds = [m.mission_type for _, n, m in pair.stub.heard if n == "MISSION_REQUEST_LIST"]
        assert kinds == [0]
        assert pair.stub.heard[-1][2].get_msgbuf()[0] == 0xFE

    @pytest.mark.parametrize(("profile", "least", "most"), [(V4, 16, 20), (MASTER, 20, 62)])
    def test_without_any_message_takes_long_and_goes_on(
        self, profile: Profile, least: float, most: float
    ) -> None:
        pair = Pair(profile, silent_requests=SILENT | {435, 280}).connected(within=90)
        assert pair.popups == []
        (asked,) = (at for at, n, _ in pair.stub.heard if n == "PARAM_REQUEST_LIST")
        assert least <= asked <= most

    @pytest.mark.parametrize("autopilot", [APM_AUTOPILOT, 12])
    def test_without_parameters_complains_after_25_s(self, autopilot: int) -> None:
        pair = Pair(autopilot=autopilot, silent={"PARAM_REQUEST_LIST"})
        pair.run(60)
        assert 25 <= pair.popup_at("Vehicle 1 did not respond to request for parameters") <= 27
        assert sum(n == "PARAM_REQUEST_LIST" for _, n, _ in pair.stub.heard) == 5
        assert not any(n == "MISSION_REQUEST_LIST" for _, n, _ in pair.stub.heard)

    def test_a_generic_one_without_parameters_waits_for_ever_in_silence(self) -> None:
        pair = Pair(autopilot=GENERIC_AUTOPILOT, silent={"PARAM_REQUEST_LIST"})
        pair.run(200)
        assert pair.popups == []
        assert not pair.party.is_connected

    def test_without_missions_complains_three_times(self) -> None:
        pair = Pair(silent={"MISSION_REQUEST_LIST"}).connected(within=60)
        words = "transfer failed. Error: Mission request list failed, maximum retries exceeded."
        assert pair.popups == [f"{n} {words}" for n in ("Mission", "GeoFence", "Rally Point")]
        assert sum(n == "MISSION_REQUEST_LIST" for _, n, _ in pair.stub.heard) == 21
        assert pair.now == pytest.approx(31.5, abs=1.5)

    def test_an_old_px4_is_complained_of(self) -> None:
        pair = Pair(sw_version=1 << 24 | 3 << 16).connected()
        assert [text[:33] for text in pair.popups] == ["QGroundControl supports PX4 Pro fi"[:33]]

    @pytest.mark.parametrize("name", sorted(PX4_SET))
    def test_each_of_the_five_parameters_of_px4_is_missed(self, name: str) -> None:
        pair = Pair(parameters={n: v for n, v in PX4_SET.items() if n != name}).connected()
        pair.run(2)
        assert pair.popups == [parameters.SETUP, parameters.MISSING.format(name)]

    @pytest.mark.parametrize("name", ["RCMAP_YAW", "RC4_TRIM", "COMPASS_DEV_ID3", "FRAME_CLASS"])
    def test_those_of_ardupilot_are_missed(self, name: str) -> None:
        rest = {n: v for n, v in APM_SET.items() if n != name}
        pair = Pair(autopilot=APM_AUTOPILOT, parameters=rest).connected()
        pair.run(2)
        assert pair.popups == [parameters.SETUP, parameters.MISSING.format(name)]

    def test_nothing_is_asked_for_again_after_a_silence(self) -> None:
        pair = Pair().connected()
        pair.stub.talks = False
        pair.run(5)
        pair.stub.talks = True
        before = len(pair.stub.heard)
        pair.run(5)
        assert [each.text[:18] for each in pair.party.qgc.screen.notices] == [
            "Communication lost",
            "Communication rega",
        ]
        assert {name for _, name, _ in pair.stub.heard[before:]} == {"HEARTBEAT"}
        pair.party.check()


class TestSequenceNumbers:
    @pytest.mark.parametrize("each", [5, 10])
    def test_left_out_ones_are_a_loss(self, each: int) -> None:
        pair = Pair(leaves_out_each=each).connected()
        pair.run(60)
        lost, received = pair.party.qgc.lost[1, 1], pair.party.qgc.wire.received[1, 1]
        assert lost / (lost + received) == pytest.approx(1 / each, rel=0.4)
        with pytest.raises(AssertionError, match="seems to have lost"):
            pair.party.check()

    def test_one_counter_for_two_components_is_a_loss(self) -> None:
        pair = Pair(counts_together=True).connected()
        pair.run(10)
        assert set(pair.party.qgc.lost) == {(1, 1), (1, 191)}


class TestCommands:
    @pytest.mark.parametrize(
        ("result", "words"),
        [
            (0, []),
            (1, ["MAV_CMD(31012) command temporarily rejected"]),
            (2, ["MAV_CMD(31012) command denied"]),
            (3, ["MAV_CMD(31012) command not supported"]),
            (4, ["MAV_CMD(31012) command failed"]),
            *((number, []) for number in (6, 7, 8, 9)),
        ],
    )
    def test_results_are_shown(self, result: int, words: list[str]) -> None:
        pair = Pair(answers={31012: [(0.0, result, 1)]}).connected()
        pair.party.operator.action(31012)
        pair.run(1)
        assert pair.popups == words

    @pytest.mark.parametrize(("profile", "least", "most"), [(V4, 3.0, 3.5), (MASTER, 1.2, 1.7)])
    def test_no_ack_is_shown_and_nothing_is_sent_again(
        self, profile: Profile, least: float, most: float
    ) -> None:
        pair = Pair(profile, answers={31012: []}).connected()
        begun = pair.now
        pair.party.operator.action(31012)
        pair.run(10)
        shown = pair.popup_at("Vehicle did not respond to command: MAV_CMD(31012)") - begun
        assert least <= shown <= most
        assert sum(getattr(m, "command", 0) == 31012 for _, _, m in pair.stub.heard) == 1

    def test_an_ack_of_another_component_is_none(self) -> None:
        pair = Pair(answers={31012: [(0.0, 0, 191)]}).connected()
        pair.party.operator.action(31012)
        pair.run(5)
        assert pair.popups == ["Vehicle did not respond to command: MAV_CMD(31012)"]
        assert len(pair.party.vehicle.commands.strays) == 1

    def test_an_ack_from_191_is_needed_where_that_was_asked(self) -> None:
        pair = Pair(answers={31012: [(0.0, 0, 191)]}).connected()
        pair.party.operator.action(31012, component=191)
        pair.run(5)
        pair.party.check()

    def test_a_second_press_sends_nothing(self) -> None:
        pair = Pair(answers={31012: [(2.0, 0, 1)]}).connected()
        pair.party.operator.action(31012)
        pair.run(0.5)
        assert pair.party.operator.action(31012).is_refused_here
        pair.run(5)
        assert pair.popups == [
            "Unable to send command: Waiting on previous response to same command."
        ]

    @pytest.mark.parametrize(
        ("profile", "acks", "is_silent"),
        [
            (V4, [(0.0, 5, 1), (2.0, 0, 1)], False),
            (V4, [(0.0, 5, 1), (4.0, 0, 1)], True),
            (V4, [*((float(n), 5, 1) for n in range(6)), (6.0, 0, 1)], True),
            (MASTER, [*((float(n), 5, 1) for n in range(6)), (6.0, 0, 1)], False),
            (MASTER, [(0.0, 5, 1), (2.0, 0, 1)], True),
        ],
    )
    def test_in_progress(
        self, profile: Profile, acks: list[tuple[float, int, int]], is_silent: bool
    ) -> None:
        pair = Pair(profile, answers={31012: acks}).connected()
        pair.party.operator.action(31012)
        pair.run(10)
        words = ["Vehicle did not respond to command: MAV_CMD(31012)"] if is_silent else []
        assert pair.popups == words

    def test_in_progress_was_final_once(self) -> None:
        pair = Pair(V42, answers={31012: [(0.0, 5, 1)]}).connected()
        sent = pair.party.operator.action(31012)
        pair.run(10)
        assert (sent.result, pair.popups) == (5, [])

    def test_a_second_ack_is_a_stray(self) -> None:
        pair = Pair(answers={31012: [(0.0, 0, 1), (1.0, 4, 1)]}).connected()
        pair.party.operator.action(31012)
        pair.run(3)
        assert pair.popups == []
        with pytest.raises(AssertionError, match="nothing waits for"):
            pair.party.check()


class TestGuided:
    def test_buttons_need_flying(self) -> None:
        pair = Pair().connected()
        assert not pair.party.operator.offers & {"go to", "pause", "return", "emergency stop"}
        pair.stub.armed = True
        pair.run(1.1)
        assert "go to" not in pair.party.operator.offers  # armed, and says that it has landed
        pair.stub.landed_state = 2
        pair.run(1.1)
        assert pair.party.operator.offers >= {"go to", "pause", "return", "emergency stop"}
        with pytest.raises(AssertionError, match="no button"):
            pair.party.operator.arm()

    def test_a_go_to_of_ardupilot_comes_twice_the_first_time(self) -> None:
        pair = Pair(autopilot=APM_AUTOPILOT, mode=15).driving()
        pair.party.operator.go_to(47.3978, 8.5456)
        pair.run(0.1)
        pair.party.operator.go_to(47.3979, 8.5456)
        pair.run(3)
        sent = [
            (name, m.command)
            for _, name, m in pair.stub.heard
            if name in ("COMMAND_INT", "MISSION_ITEM")
        ]
        assert sent == [("COMMAND_INT", 192), ("MISSION_ITEM", 16), ("COMMAND_INT", 192)]
        pair.party.check()

    def test_and_from_another_mode_asks_for_guided_between(self) -> None:
        pair = Pair(autopilot=APM_AUTOPILOT, mode=10).driving()
        pair.party.operator.go_to(47.3978, 8.5456)
        pair.run(3)
        names = [name for _, name, m in pair.stub.heard if getattr(m, "command", 0) in (192, 176)]
        assert names == ["COMMAND_INT", "COMMAND_LONG"]
        assert pair.party.qgc.count_sent("MISSION_ITEM") == 1
        pair.party.check()

    def test_without_an_ack_for_the_item_complains(self) -> None:
        pair = Pair(autopilot=APM_AUTOPILOT, mode=15, silent={"MISSION_ITEM"}).driving()
        begun = pair.now
        pair.party.operator.go_to(47.3978, 8.5456)
        pair.run(3)
        words = "Vehicle did not respond to mission item communication: Guided Mode Item"
        shown = pair.popup_at(f"Mission transfer failed. Error: {words}") - begun
        assert 1.5 <= shown <= 1.8

    def test_after_unsupported_only_the_item_is_sent(self) -> None:
        pair = Pair(autopilot=APM_AUTOPILOT, mode=15, answers={192: [(0.0, 3, 1)]}).driving()
        for latitude in (47.3978, 47.3979):
            pair.party.operator.go_to(latitude, 8.5456)
            pair.run(2)
        assert pair.popups == []
        assert pair.party.qgc.count_sent("COMMAND_INT") == 1
        assert pair.party.qgc.count_sent("MISSION_ITEM") == 2

    @pytest.mark.parametrize(("capabilities", "name"), [(8, "COMMAND_INT"), (0, "COMMAND_LONG")])
    def test_the_form_of_px4s_go_to_hangs_on_its_capabilities(
        self, capabilities: int, name: str
    ) -> None:
        pair = Pair(capabilities=0x2000 | capabilities).driving()
        pair.party.operator.go_to(47.3978, 8.5456)
        pair.run(1)
        assert [n for _, n, m in pair.stub.heard if getattr(m, "command", 0) == 192] == [name]

    def test_a_pause_of_px4_is_two_commands(self) -> None:
        pair = Pair().driving()
        pair.party.operator.pause()
        pair.run(1)
        heights = [m.param7 for _, n, m in pair.stub.heard if getattr(m, "command", 0) == 192]
        assert len(heights) == 2
        assert heights[0] != heights[0]
        assert heights[1] == 488.0

    def test_a_pause_of_ardupilot_is_a_popup_and_nothing_else(self) -> None:
        pair = Pair(autopilot=APM_AUTOPILOT, mode=15).driving()
        before = len(pair.party.qgc.sent)
        pair.party.operator.pause()
        assert (pair.popups, len(pair.party.qgc.sent)) == ([guided.NO_ALTITUDE], before)

    def test_a_generic_one_is_not_guided(self) -> None:
        pair = Pair(autopilot=GENERIC_AUTOPILOT).driving()
        assert not pair.party.operator.offers & {"pause", "return", "mode"}
        pair.party.operator.go_to(47.3978, 8.5456)
        assert pair.popups == [guided.NOT_GUIDED]

    def test_a_mode_that_is_not_shown_is_asked_for_three_times(self) -> None:
        pair = Pair(takes_modes=False).driving()
        pair.party.plans.upload(PLAN)
        pair.run(1)
        begun = pair.now
        pair.party.operator.go_on()
        pair.run(6)
        assert pair.party.qgc.count_sent("SET_MODE") == 3
        assert pair.popup_at(guided.NOT_STARTED.format("Mission")) - begun == pytest.approx(
            3.9, abs=0.2
        )

    def test_a_mission_that_ends_opens_a_dialog(self) -> None:
        pair = Pair().driving()
        pair.stub.mode = MODES[PX4].mission
        pair.run(1.1)
        pair.stub.armed = False
        pair.run(1.1)
        assert [each.text for each in pair.party.qgc.screen.dialogs] == ["Flight Plan complete"]
        pair.party.check()


class TestPlans:
    def test_fence_and_rally_points_go_with_it_also_when_empty(self) -> None:
        pair = Pair().connected()
        pair.party.plans.upload(PLAN)
        pair.run(1)
        counts = [(m.mission_type, m.count) for _, n, m in pair.stub.heard if n == "MISSION_COUNT"]
        assert counts == [(0, 3), (1, 0), (2, 0)]
        pair.party.check()

    def test_home_is_the_first_item_of_ardupilots(self) -> None:
        pair = Pair(autopilot=APM_AUTOPILOT).connected()
        pair.party.plans.upload(PLAN)
        pair.run(1)
        items = [m for _, n, m in pair.stub.heard if n == "MISSION_ITEM_INT"]
        assert [(m.frame, m.current) for m in items] == [(0, 1), (3, 0), (3, 0), (3, 0)]

    @pytest.mark.parametrize(
        ("after", "result", "words"),
        [
            (1, 3, "Command is not supported. Item #1 Command: 16"),
            (2, 4, "Mission item exceeds storage space. Item #2 Command: 16"),
            (-1, 14, "Not accepting any mission commands"),
            (2, 15, "Unknown error: 15. Item #2 Command: 16"),
            (0, 0, "Vehicle did not request all items from ground station, missing count 2"),
            (2, None, "Mission write failed, vehicle failed to send final ack."),
            (1, None, "Vehicle did not request all items from ground station"),
            (-1, None, "Mission write mission count failed, maximum retries exceeded."),
        ],
    )
    def test_what_goes_wrong_is_shown(self, after: int, result: int | None, words: str) -> None:
        pair = Pair(upload_results={after: result}).connected()
        pair.party.plans.upload(PLAN)
        pair.run(15)
        assert pair.popups == [f"Mission transfer failed. Error: {words}"]
        assert pair.party.plans.outcome == {0: False, 1: True, 2: True}

    def test_removing_is_three_messages(self) -> None:
        pair = Pair().connected()
        pair.party.plans.remove()
        pair.run(1)
        kinds = [m.mission_type for _, n, m in pair.stub.heard if n == "MISSION_CLEAR_ALL"]
        assert kinds == [0, 1, 2]
        pair.party.check()

    def test_not_while_it_drives_one_in_its_own_mode(self) -> None:
        pair = Pair().driving()
        pair.stub.mode = MODES[PX4].mission
        pair.run(1.1)
        pair.party.plans.upload(PLAN)
        assert pair.popups == [RUNS]
        pair.stub.mode = OFFBOARD
        pair.run(1.1)
        pair.party.plans.upload(PLAN)
        pair.run(1)
        assert pair.popups == [RUNS]
        assert pair.party.plans.outcome == {0: True, 1: True, 2: True}

    def test_an_answer_for_somebody_else_is_noticed(self) -> None:
        pair = Pair().connected()
        pair.stub._mission_ack(0, 0)
        pair.run(0.1)
        with pytest.raises(AssertionError, match="unasked for"):
            pair.party.check()


class TestTexts:
    @pytest.mark.parametrize(
        ("severity", "text", "is_popup"),
        [(3, "broken", True), (4, "careful", False), (6, "news", False), (2, "old\t", False)],
    )
    def test_errors_are_popups_and_doubles_of_events_are_dropped(
        self, severity: int, text: str, is_popup: bool
    ) -> None:
        pair = Pair().connected()
        pair.stub.say(severity, text, component=191)
        pair.run(0.1)
        assert pair.popups == ([text] if is_popup else [])

    @pytest.mark.parametrize("length", [51, 74, 99, 100, 149])
    def test_pieces_are_joined(self, length: int) -> None:
        pair = Pair().connected()
        text = ("The mission leads over the fence at item 3. " * 4)[:length].strip()
        pair.stub.say(3, text)
        pair.run(1.1)
        assert pair.popups == [text]


def test_what_is_no_packet_is_noticed() -> None:
    pair = Pair().connected()
    pair.net.send(CLIENT_LINK, "qgc", b"\xfd\x01\x00\x00no packet at all")
    pair.run(0.1)
    with pytest.raises(AssertionError):
        pair.party.check()


def test_a_version_that_hears_only_heartbeats_in_mavlink_1() -> None:
    assert not MASTER.hears_mavlink1
    pair = Pair(replace(V4, hears_mavlink1=False)).connected()
    pair.party.check()
