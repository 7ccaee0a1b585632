"""A simulated rover as unkind as a real one, and a client that notes when it hears what."""

from dataclasses import dataclass, replace

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavResult
from mav_tasks.mavlink.messages import Message
from rover_sim.body import Pose
from rover_sim.personas import ARDUPILOT, PX4, Persona
from rover_sim.realism import Realism
from tests.unit.rover_sim.rig import Rig

START = 1000.0  # of Rig
ANSWERED = 0.1  # s after which every answer is there


@dataclass(frozen=True, slots=True)
class Refusal:
    """A refused command."""

    result: int
    texts: tuple[str, ...]


class RealRig(Rig):
    """A rig of an unkind rover."""

    def __init__(
        self,
        persona: Persona = ARDUPILOT,
        *,
        realism: Realism | None = None,
        seed: int = 1,
        wait: float = 0.0,
        start: Pose = Pose(),  # noqa: B008  # frozen
    ) -> None:
        self.persona = persona
        self.arrivals: list[tuple[float, Message]] = []
        super().__init__(
            persona=persona,
            realism=persona.realism if realism is None else realism,
            seed=seed,
            wait=wait,
            start=start,
        )

    def _listen(self) -> None:
        before = len(self.heard)
        super()._listen()
        self.arrivals += [(self.now, message) for message in self.heard[before:]]

    def first(self, kind: type[Message]) -> float:
        """When, s after switching on, the first of a kind was heard."""
        return next(at for at, message in self.arrivals if isinstance(message, kind)) - START

    def times(self, kind: type[Message]) -> list[float]:
        """When those of a kind were heard."""
        return [at for at, message in self.arrivals if isinstance(message, kind)]

    def ask(self, number: int, *params: float) -> Refusal:
        """Send a command; give what came of it."""
        self.heard.clear()
        padded = (*params, *(0.0,) * (7 - len(params)))
        self.send(m.CommandLong(1, 1, number, 0, *padded))
        self.run(ANSWERED)
        acks = [each for each in self.heard if isinstance(each, m.CommandAck)]
        (ack,) = [each for each in acks if each.command == number]
        return Refusal(ack.result, tuple(self.whole_texts()))

    def whole_texts(self) -> list[str]:
        """Every text since the last ``take``, the pieces of long ones joined."""
        joined: list[str] = []
        for each in [e for e in self.heard if isinstance(e, m.Statustext)]:
            text = each.text.rstrip("\0")
            if each.chunk_seq:
                joined[-1] += text
            else:
                joined.append(text)
        return joined

    def try_to_arm(self) -> Refusal:
        return self.ask(MavCmd.COMPONENT_ARM_DISARM, 1)

    def set_mode_by(self, custom_mode: int) -> int:
        if self.persona is PX4:
            main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24
            return self.ask(MavCmd.DO_SET_MODE, 1, main, sub).result
        return self.ask(MavCmd.DO_SET_MODE, 1, custom_mode).result

    def get_ready(self) -> None:
        """Past its boot, armed and in the mode that follows setpoints (ArduPilot)."""
        self.run(3.0)
        assert self.set_mode_by(15) == MavResult.ACCEPTED
        assert self.try_to_arm().result == MavResult.ACCEPTED


def really_booting(persona: Persona) -> Realism:
    """As unkind as its make, with the real times of its boot."""
    return replace(persona.realism, boot=persona.boot)
