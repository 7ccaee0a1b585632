"""What entries of the table of intended differences go by: words, what is owed, what moves."""

from binascii import b2a_base64
from importlib import import_module
from struct import pack
from typing import Any

import pytest

from mav_tasks.mavlink import messages as m


def part(name: str) -> Any:
    """Give a module of the tool, which mypy checks under another name."""
    return import_module(f"tools.compare_cores.{name}")


differences, entries_texts = part("differences"), part("intended_texts")
motion, words = part("motion"), part("words")
Difference, Kind = differences.Difference, differences.Kind
INTENDED, Ledger = part("intended").INTENDED, part("ledger").Ledger
Sent, Story = part("wire").Sent, part("story").Story
asks_hold, moves, stands = motion.asks_hold, motion.moves, motion.stands
REWORDED, reworded, texts = entries_texts.REWORDED, entries_texts.reworded, entries_texts.texts
LAYOUTS = part("inside.expand").layouts()
CONTINUE = (193, 1.0)
PAUSE = (193, 0.0)
BOTH = (Kind.MISSING, Kind.ADDED)


def packet(message: Any, *, seq: int = 0, source: tuple[int, int] = (255, 190)) -> Any:
    """Give a packet as if a core sent it."""
    payload = _payload(message)
    head = bytes((0xFD, len(payload), 0, 0, seq, *source)) + type(message).id.to_bytes(3, "little")
    return Sent("clients", "a", head + payload + b"\0\0", False, LAYOUTS)


def _payload(message: Any) -> bytes:
    _, form, names, counts = LAYOUTS[type(message).id]  # a text has a field of that name
    values: list[Any] = []
    for name, count in zip(names, counts, strict=True):
        value = getattr(message, name)
        values += [value] if count == 1 else list(value)
    values = [v.encode() if isinstance(v, str) else v for v in values]
    return pack(form, *values)


def command(number: int, first: float, *, second: float = 0.0, third: float = 0.0) -> Any:
    """Give a COMMAND_LONG to rover 1."""
    return m.CommandLong(1, 1, number, 0, first, second, third, 0, 0, 0, 0)


def told(story: Any, at: float, sent: Any, *, peer: str = "a", kind: str = "packets") -> None:
    """Let a packet come in."""
    data = b2a_base64(sent.data, newline=False).decode()
    group = ["clients", [[peer, data]]]
    story.took_in([kind, at, *group] if kind == "packets" else [kind, at, group], now=at)


def story_of(*said: tuple[float, int, tuple[int, float]], restart: bool = False) -> Any:
    """Give a story in which these words came: when, number of the packet, command."""
    story = Story(LAYOUTS, is_restart=restart)
    told(story, 0.0, packet(command(512, 1.0)))
    for at, seq, word in said:
        told(story, at, packet(command(*word), seq=seq))
    return story


def last_of(story: Any) -> str:
    return str(words.why_older(next(story.heard("COMMAND_LONG")), story))


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ([(10.0, 1, CONTINUE)], ""),
        ([(10.0, 1, PAUSE), (10.4, 2, CONTINUE)], ""),
        ([(10.0, 1, CONTINUE), (10.4, 2, PAUSE), (10.8, 3, CONTINUE)], "copy"),
        ([(10.0, 1, CONTINUE), (10.4, 2, PAUSE), (14.0, 3, CONTINUE)], ""),
        ([(10.0, 9, PAUSE), (10.4, 7, CONTINUE)], "overtaken"),
        ([(10.0, 1, PAUSE), (10.4, 44, CONTINUE)], "overtaken"),
    ],
)
def test_a_word_is_older_by_a_rule_of_the_contract_only(
    words: list[tuple[float, int, tuple[int, float]]], why: str
) -> None:
    quiet = [(at / 100, seq, word) for at, seq, word in [(40.0, 0, (512, 1.0))]]
    story = story_of(*quiet, *[(9.6 + n / 10, 0, (512, 1.0)) for n in range(4)], *words)
    story.stood_until = -1.0  # it was quiet, and nothing waited
    assert last_of(story) == why


def test_after_a_restart_each_word_may_be_a_copy() -> None:
    assert last_of(story_of((1.0, 1, CONTINUE), restart=True)) == "restart"


@pytest.mark.parametrize(
    ("word", "halts"), [(PAUSE, True), (CONTINUE, False), ((400, 0.0), True), ((400, 1.0), False)]
)
def test_what_halts(word: tuple[int, float], halts: bool) -> None:
    story = story_of((1.0, 1, word))
    assert words.is_halt(next(story.heard("COMMAND_LONG"))) is halts


def setpoint(speed: float) -> Any:
    """Give a velocity of the server's for rover 1."""
    message = m.SetPositionTargetLocalNed(0, 1, 1, 8, 1479, 0, 0, 0, speed, 0, 0, 0, 0, 0, 0, 0)
    return packet(message, source=(250, 191))


def test_what_moves_and_what_stands() -> None:
    assert moves(setpoint(0.3))
    assert stands(setpoint(0.0))
    assert stands(setpoint(0.001))
    hold, drive = command(176, 1.0, second=4.0), command(176, 1.0, second=15.0)
    assert asks_hold(packet(hold))
    assert moves(packet(drive))


def test_the_new_core_may_move_only_what_the_old_one_has_just_moved() -> None:
    watch = motion.MotionWatch()
    assert list(watch.unmatched([setpoint(0.3)], now=1.0)) != []
    watch.old([setpoint(0.3)], now=1.0)
    assert list(watch.unmatched([setpoint(0.5)], now=1.0 + motion.LATER)) == []
    assert list(watch.unmatched([setpoint(0.5)], now=1.1 + motion.LATER)) != []


def test_a_rover_that_somebody_lets_go_is_watched_no_more() -> None:
    watch = motion.MotionWatch()
    story = story_of((1.0, 1, PAUSE), (2.0, 2, CONTINUE))
    accepted = packet(m.CommandAck(193, 0, 0, 0, 255, 190), source=(1, 191))
    assert list(words.let_go([accepted], story, now=2.0)) == [1]
    watch.let_go(1)
    assert list(watch.unmatched([setpoint(0.3)], now=2.0)) == []


def test_who_pauses_lets_no_rover_go() -> None:
    story = story_of((1.0, 1, PAUSE))
    accepted = packet(m.CommandAck(193, 0, 0, 0, 255, 190), source=(1, 191))
    assert list(words.let_go([accepted], story, now=1.0)) == []


def test_what_is_owed_is_found_again_or_overdue() -> None:
    ledger, sent = Ledger(), setpoint(0.0)
    missing = Difference(Kind.MISSING, 1.0, sent, None)
    ledger.note(missing, by="x", within=2.0, owes=BOTH)
    assert [each.now for each in ledger.overdue(3.1)] == [1.0]
    ledger.note(Difference(Kind.ADDED, 2.0, None, sent), by="y", within=2.0, owes=BOTH)
    assert [each.now for each in ledger.overdue(3.1)] == [1.0]
    ledger.note(Difference(Kind.ADDED, 2.0, None, sent), by="x", within=2.0, owes=BOTH)
    assert list(ledger.overdue(3.1)) == []


def text(words: str, *, number: int = 0, piece: int = 0, seq: int = 0) -> Any:
    """Give a piece of a text of the task server's."""
    said = m.Statustext(4, words.encode().ljust(50, b"\0"), number, piece)
    return packet(said, seq=seq, source=(1, 191))


def test_texts_are_put_together_and_all_of_an_instant_must_be_in_other_words() -> None:
    old = [text("role observer may not submit tasks, submitter may")]
    new = [
        text("role observer may not send TASK_DRIVE, submitter m", number=7),
        text("ay", number=7, piece=1),
    ]
    assert texts(new, new[0].way) == ["role observer may not send TASK_DRIVE, submitter may"]
    matches = reworded(*REWORDED)
    found = differences.differences(old, new, now=1.0, counts_numbers=False)
    assert found
    assert all(map(matches, found))
    others = differences.differences([*old, text("STOP")], new, now=1.0, counts_numbers=False)
    assert not any(map(matches, others))


def test_who_may_do_it_is_no_matter_of_words() -> None:
    old, new = (
        text("role observer may not clear, operator may"),
        text("role observer may not x, submitter may"),
    )
    found = differences.differences([old], [new], now=1.0, counts_numbers=False)
    assert not any(map(reworded(*REWORDED), found))


def test_no_entry_explains_a_velocity_or_an_arming_that_only_the_new_core_sends() -> None:
    story = story_of((1.0, 1, CONTINUE))
    for sent in (setpoint(0.3), packet(command(400, 1.0), source=(250, 191))):
        found = differences.differences([], [sent], now=2.0, counts_numbers=False, story=story)
        assert not [entry.name for entry in INTENDED if any(map(entry.matches, found))]
