"""What the real ones say that a tidy simulator would not."""

from mav_tasks.mavlink import messages as m
from rover_sim.personas import ARDUPILOT
from tests.unit.rover_sim.rig import RealRig

UNNUMBERED = 65535


def test_ardupilot_sends_a_parameter_unasked_that_has_no_number() -> None:
    rig = RealRig(ARDUPILOT)
    rig.run(61.0)
    values = rig.take(m.ParamValue)
    assert [(v.param_id, v.param_value, v.param_index) for v in values] == [
        ("STAT_RUNTIME", 30.0, UNNUMBERED),
        ("STAT_RUNTIME", 60.0, UNNUMBERED),
    ]
    rig.send(m.ParamRequestList(1, 1))
    listed = rig.take(m.ParamValue)
    assert [v.param_index for v in listed] == list(range(listed[0].param_count))
    assert listed[-1].param_id == "STAT_RUNTIME"
