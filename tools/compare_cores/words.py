"""Clients' words at one instant of a record, and how both cores answered each of them."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from .differences import Difference, Kind
from .story import Heard, Story
from .wire import Sent

ACK = "COMMAND_ACK"
COMMANDS = ("COMMAND_LONG", "COMMAND_INT")
ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED = range(4)
STALE, NOT_ALLOWED, RATE_LIMITED, VEHICLE_SILENT = 114, 108, 113, 9

STOP, PAUSE_CONTINUE, SET_MODE, ARM = 54003, 193, 176, 400
CANCEL, CLEAR, RELEASE, MISSION_START, REPOSITION = 54010, 54011, 54013, 300, 192
COPIED = 3.5  # s after a copy in which the next one comes: the contract
RESTARTED = 3.5  # s after the server's start in which a word may be a copy: the contract


@dataclass(frozen=True, slots=True)
class Answered:
    """A word, and the answers of both cores to it at the instant at which it came."""

    word: Heard
    old: Sent | None
    new: Sent | None

    @property
    def command(self) -> int:
        """Give its number."""
        return int(self.word.of("command"))


def answered(difference: Difference) -> Iterator[Answered]:
    """Give each command that the new core answers at this instant, if it came at it, too."""
    moment = difference.moment
    words = [heard for heard in moment.story.heard(*COMMANDS, since=difference.now)]
    for ack in moment.new:
        if ack.name != ACK:
            continue
        word = next((each for each in words if _is_of(ack, each)), None)
        if word is None:
            continue
        old = (each for each in moment.old if each.name == ACK and _is_of(each, word))
        yield Answered(word, next(old, None), ack)


def _is_of(ack: Sent, word: Heard) -> bool:
    to = ack.fields.get("target_system"), ack.fields.get("target_component")
    return (
        ack.way == word.packet.way
        and to == word.packet.source
        and ack.fields["command"] == word.of("command")
    )


def result_of(ack: Sent | None) -> tuple[int, int] | None:
    """Give result and reason of an answer."""
    return None if ack is None else (ack.fields["result"], ack.fields.get("result_param2", 0))


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
            return (heard.of("param2"), heard.of("param3")) in ((4.0, 0.0), (4.0, 3.0))
        case _ if number == REPOSITION:
            return True  # without a place it is a pause
        case _:
            return False


def why_older(word: Heard, story: Story) -> str:
    """Give the rule of the contract by which a word may be older than a halt, "" if none does.

    It looks at what came in only, and not at what either core made of it.
    """
    now = word.at
    if story.is_restart and story.began is not None and now - story.began <= RESTARTED:
        return "restart"
    if word.kind != "packets":
        return "waited"
    if any(is_halt(each) and each is not word for each in story.heard(since=now)):
        return "same moment"
    if _is_overtaken(word, story):
        return "overtaken"
    if _copies_before_halt(word, story):
        return "copy"
    return ""


def _is_overtaken(word: Heard, story: Story) -> bool:
    """Whether later packets of its sender came before it, or it is far ahead of those heard."""
    line = [each for each in story.heard() if _same_sender(each, word) and each is not word]
    if not line:
        return True  # its first packet: nothing tells how old it is
    ahead = max(each.packet.seq - word.packet.seq & 0xFF for each in line[:1])
    behind = word.packet.seq - line[0].packet.seq & 0xFF
    return 0 < ahead < 0x80 or behind > 32


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


def rejected_as(difference: Difference, result: int, reason: int) -> list[Answered]:
    """Give the words of this instant that the new core refuses so, and the old one did not."""
    wanted = result, reason
    found = list(answered(difference))
    return [e for e in found if result_of(e.new) == wanted and result_of(e.old) != wanted]


def is_about(difference: Difference, each: Answered) -> bool:
    """Whether a difference is the answer to a word, the text beside it, or that it went on."""
    sent = difference.new or difference.old
    if sent is None:
        return False
    if difference.name == ACK:
        return sent in (each.old, each.new)
    if difference.name == "STATUSTEXT":
        return sent.way == each.word.packet.way
    went_on = difference.kind is Kind.MISSING and sent.source == each.word.packet.source
    return went_on and sent.content[2] == each.word.packet.payload


