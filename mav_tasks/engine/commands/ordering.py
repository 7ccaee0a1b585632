"""Refuses a command that lets a rover go if it is older than the rover's last halt.

It is older if its first copy arrived before the server had handled the halt, if its number shows
that it was sent before the halt, if it names another halt epoch than the present one, or if it
waited while the server was stalled. The refusal tells the client to send it again.

A packet arrives when the kernel gets it, on whatever link. When the server reads it says nothing:
it may read old packets of one link after newer ones of another.
"""

from math import inf, isfinite

from mav_tasks.basics.errors import Rejection
from mav_tasks.engine.clients.rights import SUBMITTER
from mav_tasks.engine.commands.command_request import OF_ONE_TASK, CommandRequest
from mav_tasks.engine.policy import Kind
from mav_tasks.engine.services.commands import COPIED, DOUBLED, Command
from mav_tasks.mavlink.enums import MavCmd
from mav_tasks.mavlink.special_values import EPOCHS
from mav_tasks.tasks.lifecycle import TaskReason

#: index of the parameter with the halt epoch that the sender was shown, by command
EPOCH_IN: dict[int, int] = {
    MavCmd.DO_PAUSE_CONTINUE: 1,
    MavCmd.TASK_RELEASE: 2,
    MavCmd.MISSION_START: 2,
}
REPEATED = 2.0  # s, within which MAVSDK repeats an unanswered command, unmarked: at 1.5 s
AGAIN = "wait 4 s and repeat it if you mean it"


def require_newer(asked: CommandRequest, *, now: float) -> None:
    """Raise Rejection (STALE) for a command that is older than the rover's last halt."""
    if words := why_older(asked, now=now):
        raise Rejection(TaskReason.STALE, words)


def why_older(asked: CommandRequest, *, now: float) -> str:
    """Return why a command is older than the last halt, "" if it is newer; remember it.

    Call this for each copy, even one recognised in another way: the next copy is recognised by it.
    A command of an observer is not remembered: it is refused by its role, however new it is.
    """
    if not asked.rights.reach(SUBMITTER):
        return ""
    halts, sender, packet, said = asked.vehicle.tasks.halts, asked.sender, asked.packet, asked.said
    is_old = asked.client.is_late
    halts.was_asked = True
    number = sender.line.number_of(packet.seq)
    sent_after = sender.line.sent_after(number, now=asked.arrived)
    named = _epoch_in(asked.command)
    earlier = sender.earlier(said, now=now)
    before = next((each for each in earlier if each.epoch is not None), None)
    is_of_this_life = before is not None and before.life == said.life
    is_same = now - said.twin_at <= DOUBLED  # numbers go round after 256 packets
    copies = asked.command.confirmation
    window = min(copies * COPIED, DOUBLED)
    # It says that it is a copy if the last one says another number: it may be late. Otherwise the
    # first may be lost, unless each of the sender's packets in that time came: mavros always says 1
    is_counted = copies > 0
    if before is None or not is_of_this_life or copies == before.command.confirmation:
        is_counted = is_counted and not sender.line.has_all(packet.seq, within=window)
    # If another sender has halted the vehicle, an identical packet is a copy even if its sender
    # seems to have restarted: the network may deliver all its packets a second time.
    may_be_copy = is_of_this_life or (is_same and halts.by is not sender)
    within = DOUBLED if is_counted or is_same else COPIED
    is_copy = before is not None and may_be_copy and now - before.at <= within
    first = before.epoch if before is not None and is_copy else None
    elsewhere = asked.vehicle.go_words.first_epoch(packet.raw, sender, now=now)
    if elsewhere is not None:
        first = elsewhere if first is None else min(first, elsewhere)
    if first is None and is_counted:  # the first copy was lost; it was sent before this one
        sent_after = min(sent_after, asked.arrived - window)
    # The sender of the last halt sent this after it. It is no repeat of an older command if that
    # halt was undone since, if the halt has the same command number (no stock client has two of one
    # number under way), or if no copy came for REPEATED s.
    follows = halts.by is sender and number > halts.number
    is_over = halts.is_undone or halts.command == asked.command.command
    is_repeated = is_counted or (is_of_this_life and is_same)
    last_at = before.at if before is not None and is_of_this_life else -inf
    if follows and not is_repeated and (is_over or now - last_at > REPEATED):
        epoch = halts.epoch
    else:
        epoch = halts.epoch if halts.at < sent_after else halts.epoch - 1
        epoch = epoch if first is None else min(epoch, first)
    # it may be a copy of a command that only the server's run before this one heard
    if first is None and now - halts.restored_at <= COPIED:
        epoch = halts.epoch - 1
    if named:
        epoch = halts.epoch if named == halts.epoch % EPOCHS else halts.epoch - 1
    if is_old or (sender.line.jumped_to(number) and not named):
        epoch = min(epoch, halts.epoch - 1)
    said.epoch = epoch
    asked.vehicle.go_words.says(packet.raw, sender, epoch=epoch, now=now)
    if epoch == halts.epoch:
        return ""
    if is_old:
        return f"delayed by the server: {AGAIN}"
    if named:
        return f"{halts.words} came since you read the status: read it again"
    return f"{halts.words} came later: {AGAIN}"


def has_left_before_halt(asked: CommandRequest, *, anybodys: bool = False) -> bool:
    """Return whether this command's sender sent it before its own last halt.

    With ``anybodys`` also whether it may have been sent before the last halt of any sender.
    """
    halts, line = asked.vehicle.tasks.halts, asked.sender.line
    number = line.number_of(asked.packet.seq)
    if halts.by is asked.sender and number != halts.number:
        return number < halts.number
    return anybodys and line.sent_after(number, now=asked.arrived) <= halts.at


def note_halt(asked: CommandRequest, *, before: int) -> None:
    """Note this command as the last halt if the epoch is not ``before``, or if it repeats it."""
    halts = asked.vehicle.tasks.halts
    if halts.epoch != before or (halts.by is asked.sender and asked.kind is Kind.HALT):
        number = asked.sender.line.number_of(asked.packet.seq)
        command = asked.command.command
        halts.was_said_by(asked.sender, number, command=command, holds=command not in OF_ONE_TASK)


def _epoch_in(command: Command) -> int:
    """Return the halt epoch that a command names, 0 if it names none."""
    place = EPOCH_IN.get(command.command)
    value = 0.0 if place is None else command.params[place]
    return int(value) if isfinite(value) and value > 0.0 else 0
