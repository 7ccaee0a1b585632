"""Clients' words at one instant of a record, and how both cores answered each of them."""

from collections import Counter
from collections.abc import Iterator, Sequence
from math import isfinite
from typing import Any, NamedTuple

from .differences import Difference, Kind
from .motion import asks_hold
from .story import Heard, Story
from .wire import Sent

ACK = "COMMAND_ACK"
COMMANDS = ("COMMAND_LONG", "COMMAND_INT")
ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED = range(4)
STALE, NOT_ALLOWED, RATE_LIMITED, VEHICLE_SILENT = 114, 108, 113, 9

STOP, PAUSE_CONTINUE, SET_MODE, ARM = 54003, 193, 176, 400
CANCEL, CLEAR, RELEASE, MISSION_START, REPOSITION = 54010, 54011, 54013, 300, 192
BUSY = TEMPORARILY_REJECTED, RATE_LIMITED
COPIED = 3.5  # s after a copy in which the next one comes: the contract
DOUBLED = 30.0  # s in which the very same packet is a copy: the contract
STILL_READ = 0.5  # s after a stand-still in which what is read may have waited
EPOCH_IN = {PAUSE_CONTINUE: "param2", RELEASE: "param3", MISSION_START: "param3"}
AHEAD = 32  # packets: what seems further ahead may be seconds behind: the contract
RESTARTED = 3.5  # s after the server's start in which a word may be a copy: the contract


class Refusals(NamedTuple):
    """Words of one client and one number that the new core refuses as the old one did not."""

    words: list[Heard]
    did_something: bool  # in the old core: obeyed, or passed on to the rover


def refusals(difference: Difference, result: int, reason: int) -> Iterator[Refusals]:
    """Give what only the new core answers so at this instant, whatever else is in it.

    Both cores may see to the words of an instant in another order: answers are counted.
    """
    moment = difference.moment
    for key in dict.fromkeys(_to(ack) for ack in moment.new if ack.name == ACK):
        old, new = (
            Counter(result_of(ack) for ack in packets if ack.name == ACK and _to(ack) == key)
            for packets in (moment.old, moment.new)
        )
        added = new - old
        if (result, reason) not in added or set(added) - {(result, reason), BUSY}:
            continue
        words = [w for w in moment.story.heard(*COMMANDS, since=difference.now) if _from(w) == key]
        gone = old - new
        obeyed = any(each[0] == ACCEPTED for each in gone)
        if words:
            yield Refusals(words, obeyed or gone.total() < added.total())


def _to(ack: Sent) -> tuple[Any, ...]:
    to = ack.fields.get("target_system"), ack.fields.get("target_component")
    return ack.way, to, ack.fields["command"]


def _from(word: Heard) -> tuple[Any, ...]:
    return word.packet.way, word.packet.source, word.of("command")


def result_of(ack: Sent) -> tuple[int, int]:
    """Give result and reason of an answer."""
    return ack.fields["result"], ack.fields.get("result_param2", 0)


def is_halt(heard: Heard) -> bool:
    """Whether a word of a client is one that makes a rover stand, whatever becomes of it."""
    if heard.name == "SET_MODE":
        return True  # it may be HOLD
    if heard.name not in COMMANDS:
        return False
    number, first = heard.of("command"), heard.of("param1")
    match number:
        case _ if number in (STOP, CANCEL, CLEAR):
            return True
        case _ if number in (PAUSE_CONTINUE, ARM):
            return bool(first == 0.0)
        case _ if number == SET_MODE:
            return asks_hold(heard.packet)
        case _ if number == REPOSITION:
            return True  # without a place it is a pause
        case _:
            return False


def let_go(new: Sequence[Sent], story: Story, *, now: float) -> Iterator[int]:
    """Give the rovers that were let go: by a word that the new core accepts, or a SET_MODE."""
    for ack in new:
        if ack.name == ACK and ack.fields["result"] == ACCEPTED:
            words = story.heard(*COMMANDS, since=now - 1.0)
            if any(_from(word) == _to(ack) and not is_halt(word) for word in words):
                yield ack.source[0]
        elif ack.name == "MISSION_ACK" and ack.fields["type"] == ACCEPTED:
            yield ack.source[0]
    for word in story.heard("SET_MODE", "MISSION_ITEM", "MISSION_ITEM_INT", since=now):
        yield word.of("target_system")


def why_older(word: Heard, story: Story) -> str:
    """Give the rule of the contract by which a word may be older than a halt, "" if none does.

    It looks at what came in only, and not at what either core made of it.
    """
    now = word.at
    if story.is_restart and story.began is not None and now - story.began <= RESTARTED:
        return "restart"
    if word.kind != "packets" or now - story.stood_until <= STILL_READ:
        return "waited"
    if _names_epoch(word):
        return "another epoch"
    if _twin(word, story):
        return "the same packet from elsewhere"
    if any(is_halt(each) and each is not word for each in story.heard(since=now)):
        return "same moment"
    if _is_overtaken(word, story):
        return "overtaken"
    if _copies_before_halt(word, story):
        return "copy"
    return ""


def _names_epoch(word: Heard) -> bool:
    place = EPOCH_IN.get(word.of("command"))
    value = 0.0 if place is None else word.of(place)
    return bool(isfinite(value) and value >= 1.0)


def _twin(word: Heard, story: Story) -> bool:
    """Whether the very same packet came from another socket."""
    same = (each for each in story.heard(word.name, since=word.at - DOUBLED) if each is not word)
    return any(
        each.packet.data == word.packet.data and each.packet.way != word.packet.way for each in same
    )


def _is_overtaken(word: Heard, story: Story) -> bool:
    """Whether later packets of its sender were seen to before it, or it is far ahead of them.

    Of what came at one instant, halts are seen to first.
    """
    heard = [each for each in story.heard() if _same_sender(each, word)]
    at = next((n for n, each in enumerate(heard) if each is word), len(heard))
    before = heard[at + 1 :] + [each for each in heard[:at] if is_halt(each)]
    if not before:
        return True  # its first packet: nothing tells how old it is
    if any(0 < (each.packet.seq - word.packet.seq & 0xFF) < 0x80 for each in before[:64]):
        return True
    return (word.packet.seq - before[0].packet.seq & 0xFF) > AHEAD


def _copies_before_halt(word: Heard, story: Story) -> bool:
    """Whether a copy of it came before a halt; each copy keeps the one before alive."""
    at = word.at
    halts = [each.at for each in story.heard("SET_MODE", *COMMANDS) if is_halt(each)]
    for each in story.heard(*COMMANDS):
        if each is word or not _same_word(each, word):
            continue
        if at - each.at > COPIED:
            break
        at = each.at
        if any(at <= halt <= word.at for halt in halts):
            return True
    return at < word.at  # of a halt that is no word: a takeover, a loss


def _same_sender(one: Heard, other: Heard) -> bool:
    return one.packet.way == other.packet.way and one.packet.source == other.packet.source


def _same_word(one: Heard, other: Heard) -> bool:
    return one.name == other.name and _same_sender(one, other) and _values(one) == _values(other)


def _values(heard: Heard) -> list[tuple[str, Any]]:
    return [(k, repr(v)) for k, v in heard.packet.fields.items() if k != "confirmation"]


def is_about(difference: Difference, word: Heard) -> bool:
    """Whether a difference is the answer to a word, a text beside it, or that it went on."""
    sent = difference.new or difference.old
    if sent is None:
        return False
    if sent.name == ACK:
        return _to(sent) == _from(word)
    if sent.name == "STATUSTEXT":
        return sent.way == word.packet.way
    return difference.kind is Kind.MISSING and sent.source == word.packet.source
