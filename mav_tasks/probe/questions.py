"""What a rover is asked without moving it, and without changing anything for good."""

from collections.abc import Mapping

from mav_tasks.engine.services.interval_requester import WANTED
from mav_tasks.engine.services.persona import persona_of
from mav_tasks.engine.services.vehicle_status import identity_of, passes_checks
from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.enums import MavCmd, MavMissionResult, MavMissionType, MavResult
from mav_tasks.probe.conversation import NO_ANSWER, Conversation
from mav_tasks.probe.findings import Findings, Rate
from mav_tasks.probe.parameters import ask_parameters
from mav_tasks.probe.steps import Steps, Wait, pause

LISTEN = 3.0  # s, in which what comes by itself is counted
ASK_AGAIN = 0.5  # s
ASKS = 3
PREARM_TIME = 1.5  # s in which the texts of the checks come
DEFAULT_RATE = 0  # of SET_MESSAGE_INTERVAL
RATES: Mapping[str, int] = {
    "LOCAL_POSITION_NED": m.LocalPositionNed.id,
    "ATTITUDE": m.Attitude.id,
    "GLOBAL_POSITION_INT": m.GlobalPositionInt.id,
    "SYS_STATUS": m.SysStatus.id,
}


def meet(talk: Conversation, findings: Findings) -> None:
    """Note what its heartbeat says of it."""
    findings.system_id = talk.target.system_id
    assert talk.monitor is not None
    heartbeat = talk.monitor.latest
    talk.persona = persona_of(heartbeat)
    findings.autopilot = "" if talk.persona is None else talk.persona.name
    findings.vehicle_type = heartbeat.type


def listen(talk: Conversation, findings: Findings) -> Steps[None]:
    """Count what comes by itself, and notice who else is there."""
    meet(talk, findings)
    assert talk.monitor is not None
    talk.counts.clear()
    first_at = talk.monitor.heard_at
    yield pause(LISTEN)
    beats, lasted = talk.counts[m.Heartbeat.id], talk.monitor.heard_at - first_at
    findings.heartbeat_rate = beats / lasted if beats else 0.0
    for computer in talk.others.own_computers:
        yield from talk.ask(
            MavCmd.REQUEST_MESSAGE, m.TaskQueueStatus.id, component=computer.component_id
        )
    findings.others = talk.others.in_words()
    findings.rates = [
        Rate(name, 1 / WANTED[message_id], talk.counts[message_id] / LISTEN)
        for name, message_id in RATES.items()
    ]
    findings.armed = talk.armed
    if talk.persona is not None:
        findings.mode = talk.persona.mode_name(talk.mode)


def identify(talk: Conversation, findings: Findings) -> Steps[None]:
    """Ask which rover this is, and with which firmware."""
    yield from talk.ask(MavCmd.REQUEST_MESSAGE, m.AutopilotVersion.id)
    yield Wait(lambda: m.AutopilotVersion.id in talk.latest, ASK_AGAIN)
    version = talk.latest.get(m.AutopilotVersion.id)
    if isinstance(version, m.AutopilotVersion):
        identity = identity_of(version)
        findings.uid, findings.firmware = identity.uid, identity.firmware
        findings.capabilities = version.capabilities


def count_mission(talk: Conversation, findings: Findings) -> Steps[None]:
    """Ask how long the mission on board is, and read none of it."""
    for _ in range(ASKS):
        talk.send(m.MissionRequestList(*talk.target, MavMissionType.MISSION))
        came = yield Wait(lambda: m.MissionCount.id in talk.latest, ASK_AGAIN)
        if came:
            break
    answer = talk.latest.get(m.MissionCount.id)
    if not isinstance(answer, m.MissionCount):
        return
    cancelled = MavMissionResult.OPERATION_CANCELLED
    talk.send(m.MissionAck(*talk.target, cancelled, MavMissionType.MISSION))
    has_home = talk.persona is not None and talk.persona.has_home_item
    findings.mission_items = max(answer.count - has_home, 0)


def ask_prearm(talk: Conversation, findings: Findings) -> Steps[None]:
    """Ask whether it could be armed, and why not: it is not armed for that."""
    mark = len(talk.texts)
    answer = yield from talk.ask(MavCmd.RUN_PREARM_CHECKS)
    if answer == MavResult.ACCEPTED.name:
        yield pause(PREARM_TIME)
    findings.prearm_texts = list(dict.fromkeys(talk.texts[mark:]))
    status = talk.latest.get(m.SysStatus.id)
    is_healthy = passes_checks(status) if isinstance(status, m.SysStatus) else None
    if is_healthy is not None:
        findings.prearm = "ok" if is_healthy else "not ok"


def ask_rates(talk: Conversation, findings: Findings) -> Steps[None]:
    """Ask for the rates that the server asks for, and count what comes."""
    for rate in findings.rates:
        message_id = RATES[rate.name]
        yield from _ask_interval(talk, message_id)
        rate.answer = yield from talk.ask(
            MavCmd.SET_MESSAGE_INTERVAL, message_id, round(WANTED[message_id] * 1e6)
        )
    talk.counts.clear()
    yield pause(LISTEN)
    for rate in findings.rates:
        rate.granted = talk.counts[RATES[rate.name]] / LISTEN


def _ask_interval(talk: Conversation, message_id: int) -> Steps[None]:
    """Ask how often it comes now; the answer comes beside the ack, and either may be lost."""
    for _ in range(ASKS):
        answer = yield from talk.ask(MavCmd.GET_MESSAGE_INTERVAL, message_id)
        if answer not in (MavResult.ACCEPTED.name, NO_ANSWER):
            return
        came = yield Wait(lambda: message_id in talk.intervals, ASK_AGAIN)
        if came:
            return


def give_rates_back(talk: Conversation, findings: Findings) -> Steps[None]:
    """Have the messages come as often as before; where it did not say, as by default."""
    failed: list[str] = []
    unsaid: list[str] = []
    for rate in findings.rates:
        if rate.answer != MavResult.ACCEPTED.name:
            continue
        message_id = RATES[rate.name]
        before = talk.intervals.get(message_id)
        if before is None:
            unsaid.append(rate.name)
        wanted = DEFAULT_RATE if before is None else before
        answer = yield from talk.ask(MavCmd.SET_MESSAGE_INTERVAL, message_id, wanted)
        if answer != MavResult.ACCEPTED.name:
            failed.append(rate.name)
    words = "as before"
    if unsaid:
        words = f"to the default, because the rover did not report the rate: {', '.join(unsaid)}"
    findings.rates_given_back = f"no: {', '.join(failed)}" if failed else words


def ask_everything(talk: Conversation, findings: Findings) -> Steps[None]:
    """All of it but the rates, in an order in which later questions can use earlier answers."""
    yield from identify(talk, findings)
    yield from ask_parameters(talk, findings)
    yield from count_mission(talk, findings)
    yield from ask_prearm(talk, findings)
