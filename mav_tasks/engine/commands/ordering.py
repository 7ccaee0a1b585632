"""Whether a word that lets a rover go counts: what holds beats every older one.

A word is older than a halt if its first copy came before it, if its sender's numbers show that it
had left before it, if it names another epoch than the present one, or if it waited while the server
stood still. Who is refused may send it anew; that is told.
"""

from math import isfinite

from mav_tasks.engine.commands.command_request import CommandRequest
from mav_tasks.engine.policy import Kind
from mav_tasks.errors import Rejection
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.services.command_receiver import COPIED, DOUBLED, Command
from mav_tasks.tasks.lifecycle import TaskReason

#: where a word names the epoch that its sender was shown: which of the parameters, from 0
EPOCH_IN: dict[int, int] = {
    MavCmd.DO_PAUSE_CONTINUE: 1,
    MavCmd.TASK_RELEASE: 2,
    MavCmd.MISSION_START: 2,
}
REPEATED = 2.0  # s, within which MAVSDK sends again, unmarked, what it has no answer to: 1.5
EPOCHS = 1 << 24  # that a float32 tells apart
AGAIN = "if you still mean it, send it again in 4 s"


def require_newer(asked: CommandRequest, *, now: float) -> None:
    """Raise Rejection (STALE) for a word that lets go and is older than what holds the rover."""
    words = why_older(asked, now=now)
    if words:
        raise Rejection(TaskReason.STALE, words)


def why_older(asked: CommandRequest, *, now: float) -> str:
    """Return in words why a word that lets go does not count, "" if it does; remember it.

    It is older than what holds the rover. Each copy has to be asked about, also one that is known
    for what it is otherwise: by that the next one is known for a copy.
    """
    halts, sender, packet = asked.vehicle.tasks.halts, asked.sender, asked.packet
    is_old = asked.client.is_late
    halts.was_asked_to_go_on()
    number = sender.line.number_of(packet.seq)
    sent_after = sender.line.sent_after(number, now=now)
    named = _epoch_in(asked.command)
    content = (asked.command.target, asked.command.command, repr(asked.command.params))
    copies = asked.command.confirmation
    first = sender.first_epoch(
        content,
        packet,
        is_counted=copies > 0,
        is_anothers=halts.by is not sender,
        now=now,
    )
    elsewhere = asked.vehicle.go_words.first_epoch(packet.raw, sender, now=now)
    if elsewhere is not None:
        first = elsewhere if first is None else min(first, elsewhere)
    if first is None and copies:  # the first one was lost, and had left before this one
        sent_after = min(sent_after, now - min(copies * COPIED, DOUBLED))
    # its sender has said the last halt itself, and before this, which it does not repeat by itself:
    # no stock client has two commands of one number under way; or that halt has been let go since
    follows = halts.by is sender and number > halts.number
    is_over = halts.is_undone or halts.command == asked.command.command
    is_repeated = copies > 0 or sender.has_said(content, packet)
    if follows and not is_repeated and (is_over or now - sender.last_copy_at(content) > REPEATED):
        epoch = halts.epoch
    else:
        epoch = halts.epoch if halts.at < sent_after else halts.epoch - 1
        epoch = epoch if first is None else min(epoch, first)
    # it may be a copy of what only the server before has heard
    if first is None and now - halts.restored_at <= COPIED:
        epoch = halts.epoch - 1
    if named:
        epoch = halts.epoch if named == halts.epoch % EPOCHS else halts.epoch - 1
    if is_old or (sender.line.jumped_to(number) and not named):
        epoch = min(epoch, halts.epoch - 1)
    sender.says(content, packet, epoch=epoch, now=now)
    asked.vehicle.go_words.says(packet.raw, sender, epoch=epoch, now=now)
    if epoch == halts.epoch:
        return ""
    if is_old:
        return f"it waited while the server stood still: {AGAIN}"
    if named:
        return f"{halts.words} came since what you were shown: look again"
    return f"{halts.words} came since: {AGAIN}"


def has_left_before_halt(asked: CommandRequest, *, anybodys: bool = False, now: float) -> bool:
    """Return whether the last halt is the same sender's, and this word had left before it.

    With ``anybodys`` the halt may be anybody's: it is enough that this word may have left before.
    """
    halts, line = asked.vehicle.tasks.halts, asked.sender.line
    number = line.number_of(asked.packet.seq)
    if halts.by is asked.sender and number < halts.number:
        return True
    return anybodys and line.sent_after(number, now=now) <= halts.at


def note_halt(asked: CommandRequest, *, before: int) -> None:
    """Note whose word the last halt was, if there was one since the epoch ``before``."""
    halts = asked.vehicle.tasks.halts
    is_repeated = halts.by is asked.sender and asked.kind is Kind.HALT
    if halts.epoch != before or is_repeated:
        number = asked.sender.line.number_of(asked.packet.seq)
        halts.was_said_by(asked.sender, number, command=asked.command.command)


def _epoch_in(command: Command) -> int:
    """Return the epoch that a command names, 0 if it names none."""
    place = EPOCH_IN.get(command.command)
    value = 0.0 if place is None else command.params[place]
    return int(value) if isfinite(value) and value > 0.0 else 0
