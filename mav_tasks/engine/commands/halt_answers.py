"""Holds the answers to commands that halt a rover until a restart of the server would know that.

The rover is halted at once; only the answer waits. If the halt cannot be kept within the time limit
of the commit gate, the answer is FAILED, and a text says so: the halt is in force nevertheless.
"""

from typing import NamedTuple

from mav_tasks.engine.clients.gcs_client import GcsClient
from mav_tasks.engine.commit_gate import CommitGate
from mav_tasks.mavlink.enums import MavCmd, MavResult, MavSeverity
from mav_tasks.mavlink.packet import Packet
from mav_tasks.services.command_receiver import Answer, Pending
from mav_tasks.tasks.lifecycle import TaskReason

#: what people call a command that halts; of a pause there are two
WORDS = {
    MavCmd.TASK_STOP: "STOP",
    MavCmd.DO_SET_MODE: "HOLD",
    MavCmd.COMPONENT_ARM_DISARM: "disarming",
    MavCmd.TASK_CANCEL: "cancel",
    MavCmd.TASK_CLEAR: "clear",
}
#: results of a halt that is in force; FAILED: but the rover is silent
IN_FORCE = (MavResult.ACCEPTED, MavResult.FAILED)


class _Held(NamedTuple):
    client: GcsClient
    packet: Packet
    pending: Pending
    answer: Answer


class HaltAnswers:
    """The answers that wait for their halts."""

    def __init__(self, gate: CommitGate) -> None:
        self._gate = gate
        self._waiting: set[tuple[GcsClient, bytes]] = set()  # with the packet that asked
        gate.knows(_Held, self._send, self._give_up)

    def __repr__(self) -> str:
        return f"HaltAnswers({len(self._waiting)} wait)"

    def hold(self, client: GcsClient, packet: Packet, pending: Pending, *, now: float) -> None:
        """Answer a command once its halt is kept; one answer is for all copies of a packet."""
        assert pending.answer is not None, "not decided"
        if (client, packet.raw) in self._waiting:
            return
        self._waiting.add((client, packet.raw))
        held = _Held(client, packet, pending, pending.answer)
        number, first = pending.command.command, pending.command.params[0]
        clears = number == MavCmd.TASK_STOP and first == 1.0
        if clears or number in (MavCmd.TASK_CANCEL, MavCmd.TASK_CLEAR):
            self._gate.hold(held, now=now)  # a task that comes back would drive
        else:
            self._gate.hold_halt(held, now=now)

    def repeat(self, client: GcsClient, packet: Packet, answer: Answer) -> None:
        """Give a copy of a packet the answer of the first, unless that one waits still."""
        if (client, packet.raw) not in self._waiting:
            client.answer(answer, packet.source)

    def _send(self, held: _Held, *, now: float) -> None:  # noqa: ARG002
        self._waiting.discard((held.client, held.packet.raw))
        held.client.answer(held.answer, held.packet.source)

    def _give_up(self, held: _Held, *, now: float) -> None:
        client, _, pending, answer = held
        if answer.result in IN_FORCE:
            reason = int(TaskReason.STORE_UNAVAILABLE)
            answer = answer._replace(result=MavResult.FAILED, result_param2=reason)
            what = WORDS.get(MavCmd(answer.command), "pause")
            words = f"{what} in force, but not kept: a restart of the server would undo it"
            client.tell(words, MavSeverity.ERROR, answer.source, now=now)
        pending.answer = answer
        self._send(held._replace(answer=answer), now=now)
