"""What a record shows of a rover up to a moment, and what both cores have asked of it."""

from collections.abc import Iterator
from itertools import pairwise
from math import inf

from .motion import asks_hold, stands
from .story import Heard, Story
from .wire import Sent

OURS = (250, 191)
AUTOPILOT, TASK_SERVER = 1, 191
ARMED = 128  # in base_mode
ARM, SET_MODE, REQUEST_MESSAGE = 400, 176, 512
MEASURES = ("ATTITUDE", "LOCAL_POSITION_NED", "GLOBAL_POSITION_INT")
AUTOPILOT_VERSION = 148
LATE = 0.3  # s: what is older steers nothing
PX4 = 12  # autopilot of a heartbeat
AHEAD = 5.0  # s
RESTART = 1.0  # s by which its clock goes back
JITTER = 0.005  # s: whole ms, and several messages of one moment


def is_to_rover(sent: Sent | None) -> bool:
    """Whether the server itself says this to a rover."""
    return sent is not None and sent.source == OURS


def is_of_rover(sent: Sent) -> bool:
    """Whether a rover, or the task server as a part of it, says this to a client."""
    return sent.source != OURS and sent.source[1] in (AUTOPILOT, TASK_SERVER)


def heartbeat(sent: Sent, story: Story) -> Heard | None:
    """Give the last heartbeat of the rover to which a packet goes."""
    return next(heartbeats(sent, story), None)


def heartbeats(sent: Sent, story: Story, *, since: float = -inf) -> Iterator[Heard]:
    """Give those of the rover to which a packet goes, and not of another one of its number."""
    source = sent.fields["target_system"], AUTOPILOT
    for each in story.heard("HEARTBEAT", since=since):
        if each.packet.source == source and each.packet.way == sent.way:
            yield each


def is_armed(beat: Heard | None) -> bool:
    """Whether a heartbeat shows that a rover is armed."""
    return beat is not None and bool(beat.of("base_mode") & ARMED)


def is_hold(sent: Sent) -> bool:
    """Whether it lets a rover stand, or asks for the heartbeat that shows it."""
    return stands(sent) or asks_heartbeat(sent)


def asks_identity(sent: Sent) -> bool:
    """Whether it asks a rover which one it is, as after a restart."""
    return bool(
        sent.fields["command"] == REQUEST_MESSAGE and sent.fields["param1"] == AUTOPILOT_VERSION
    )


def asks_heartbeat(sent: Sent) -> bool:
    """Whether it asks a rover to show its mode and arming."""
    if sent.name != "COMMAND_LONG" or sent.fields["command"] != REQUEST_MESSAGE:
        return False
    return sent.source == OURS and sent.fields["param1"] == 0.0


def arms_or_takes(sent: Sent) -> bool:
    """Whether the server arms a rover, or asks for the mode in which it drives it."""
    if sent.name != "COMMAND_LONG" or sent.source != OURS:
        return False
    number = sent.fields["command"]
    return bool(
        (number == ARM and sent.fields["param1"] == 1.0)
        or (number == SET_MODE and not asks_hold(sent))
    )


def boots(system: int, story: Story, *, since: float = -inf) -> list[tuple[float, float]]:
    """Give of each measure when it came, and when it was made by the rover's clock, last first."""
    return [
        (each.at, each.of("time_boot_ms") / 1000)
        for each in story.heard(*MEASURES, since=since)
        if each.packet.source == (system, AUTOPILOT)
    ]


def has_restarted(system: int, story: Story, *, since: float) -> bool:
    """Whether a rover's clock has gone back."""
    times = [boot for _, boot in boots(system, story, since=since)]
    return any(later < earlier - RESTART for later, earlier in pairwise(times))


def is_ahead(system: int, story: Story) -> bool:
    """Whether a measure came that seemed to be made later than now: the next seem to be old."""
    times = boots(system, story)
    return any(
        boot - before > at - at_before + AHEAD
        for (at, boot), (at_before, before) in pairwise(times)
    )


def is_silent(system: int, story: Story, *, now: float, for_: float) -> bool:
    """Whether nothing that was measured has come for so long, of a rover that measures."""
    times = boots(system, story)
    return bool(times) and now - times[0][0] > for_


def delays(system: int, story: Story, *, since: float = -inf) -> list[float]:
    """Give by how much measures were late, the last first, besides what all of them are."""
    found: list[float] = []
    later = inf
    for at, boot in boots(system, story, since=since):
        if boot > later + RESTART:
            break  # it has restarted since
        later = min(later, boot)
        found.append(at - boot)
    least = min(found, default=0.0)
    return [each - least for each in found]
