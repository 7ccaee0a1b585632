"""What the rover tells about itself, and how often."""

from collections import Counter

from mav_tasks.mavlink import messages as m
from mav_tasks.mavlink.messages import Message
from rover_sim.personas import ARDUPILOT, PERSONAS
from tests.unit.rover_sim.rig import RealRig, Rig

ONCE = (m.Heartbeat, m.SystemTime, m.MissionCurrent)
#: messages a second, by what sends them unasked
RATES: dict[str, dict[type[Message], float]] = {
    "ardupilot": {
        **dict.fromkeys(ONCE, 1),
        **dict.fromkeys((m.SysStatus, m.ExtendedSysState, m.HomePosition, m.Attitude), 1),
        **dict.fromkeys((m.LocalPositionNed, m.GlobalPositionInt, m.GpsRawInt, m.VfrHud), 1),
        **dict.fromkeys((m.BatteryStatus, m.RcChannels), 1),
    },
    "px4": {
        **dict.fromkeys(ONCE, 1),
        **dict.fromkeys((m.HomePosition, m.BatteryStatus, m.CurrentMode), 0.5),
        **dict.fromkeys((m.GpsRawInt, m.SysStatus, m.ExtendedSysState), 5),
        **dict.fromkeys((m.GlobalPositionInt, m.VfrHud), 10),
        m.LocalPositionNed: 20,
        m.Attitude: 40,
    },
}


def test_what_each_make_streams_unasked() -> None:
    for name, rates in RATES.items():
        rig = Rig(PERSONAS[name], wait=2.01)
        rig.heard.clear()
        rig.run(4.0)
        counts = Counter(type(message) for message in rig.heard)
        assert counts == {kind: rate * 4 for kind, rate in rates.items()}


def test_ardupilot_sends_a_parameter_unasked_that_has_no_number() -> None:
    rig = RealRig(ARDUPILOT)
    rig.run(61.0)
    values = [(v.param_id, v.param_value, v.param_index) for v in rig.take(m.ParamValue)]
    assert values == [("STAT_RUNTIME", seconds, 65535) for seconds in (30.0, 60.0)]
    rig.send(m.ParamRequestList(1, 1))
    listed = rig.take(m.ParamValue)
    assert [v.param_index for v in listed] == list(range(listed[0].param_count))
    assert listed[-1].param_id == "STAT_RUNTIME"
