"""The station of the other test_qgc files: what it sends, and what it complains of when it acts."""

import pytest

from tests.kit.qgc import guided
from tests.kit.qgc.pair import Pair
from tests.kit.qgc.plan_master import RUNS, Plan
from tests.kit.qgc.profile import MASTER, V4, V42, Profile
from tests.kit.qgc.stub import (
    APM_AUTOPILOT,
    GENERIC_AUTOPILOT,
)
from tests.kit.qgc.vehicle import MODES, PX4

HOME = (473977418, 85455938)
PLAN = Plan(HOME, [(473977500, 85455938), (473977600, 85455938), (473977700, 85455938)])
OFFBOARD = 6 << 16


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
        active = pair.now
        pair.party.operator.action(31012)
        pair.run(10)
        shown = pair.popup_at("Vehicle did not respond to command: MAV_CMD(31012)") - active
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
        active = pair.now
        pair.party.operator.go_to(47.3978, 8.5456)
        pair.run(3)
        words = "Vehicle did not respond to mission item communication: Guided Mode Item"
        shown = pair.popup_at(f"Mission transfer failed. Error: {words}") - active
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
        active = pair.now
        pair.party.operator.go_on()
        pair.run(6)
        assert pair.party.qgc.count_sent("SET_MODE") == 3
        assert pair.popup_at(guided.NOT_STARTED.format("Mission")) - active == pytest.approx(
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
