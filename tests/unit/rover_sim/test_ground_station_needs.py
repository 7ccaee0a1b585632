"""The parameters without which an unmodified QGroundControl complains: lists seen on a running one.

Asked for over the link, so that neither a name nor its type or value can go missing unseen.
"""

from mav_tasks.mavlink import messages as m
from rover_sim.personas import PERSONAS
from tests.unit.rover_sim.rig import Rig

#: no complaint when it connects to an ArduPilot rover
ARDUPILOT_AT_CONNECT = """
    SYSID_THISMAV RCMAP_ROLL RCMAP_PITCH RCMAP_THROTTLE RCMAP_YAW RC1_MIN RC1_MAX RC1_TRIM
    RC2_MIN RC2_MAX RC2_TRIM RC3_MIN RC3_MAX RC3_TRIM RC4_MIN RC4_MAX RC4_TRIM
    COMPASS_DEV_ID COMPASS_DEV_ID2 COMPASS_DEV_ID3 INS_ACCOFFS_X INS_ACCOFFS_Y INS_ACCOFFS_Z
    FRAME_CLASS
"""
#: nor when Vehicle Setup is opened: those of version 4 (FLTMODE…) and of 5 (MODE…)
ARDUPILOT_IN_SETUP = """
    FLTMODE1 FLTMODE2 FLTMODE3 FLTMODE4 FLTMODE5 FLTMODE6 MODE1 MODE2 MODE3 MODE4 MODE5
    MODE6 MODE_CH COMPASS_OFS_X COMPASS_OFS_Y COMPASS_OFS_Z COMPASS_OFS2_X COMPASS_OFS2_Y
    COMPASS_OFS2_Z COMPASS_OFS3_X COMPASS_OFS3_Y COMPASS_OFS3_Z COMPASS_DEC BATT_MONITOR
    ARMING_CHECK
"""
#: neither for a PX4 rover: all 33
PX4_AT_CONNECT_AND_IN_SETUP = """
    SYS_AUTOSTART COM_RC_IN_MODE CAL_GYRO0_ID CAL_ACC0_ID SYS_HAS_MAG SYS_AUTOCONFIG
    MAV_SYS_ID CAL_MAG2_ID CAL_MAG1_ID CAL_MAG0_ID RC_MAP_AUX2 RC_MAP_AUX1 RC_MAP_FLAPS
    RC_MAP_THROTTLE RC_MAP_YAW RC_MAP_PITCH RC_MAP_ROLL COM_FLTMODE1 COM_FLTMODE2
    COM_FLTMODE3 COM_FLTMODE4 COM_FLTMODE5 COM_FLTMODE6 BAT1_N_CELLS BAT1_V_EMPTY
    BAT1_V_CHARGED RTL_LAND_DELAY RTL_DESCEND_ALT RTL_RETURN_ALT NAV_DLL_ACT COM_RC_LOSS_T
    NAV_RCL_ACT COM_LOW_BAT_ACT
"""


def parameters_of(name: str) -> dict[str, m.ParamValue]:
    rig = Rig(PERSONAS[name])
    rig.take(m.ParamValue)
    rig.send(m.ParamRequestList(1, 1))
    return {each.param_id.rstrip("\0"): each for each in rig.take(m.ParamValue)}


def test_nothing_that_it_looks_for_is_missing() -> None:
    for persona, needed, count in [
        ("ardupilot", ARDUPILOT_AT_CONNECT, 24),
        ("ardupilot", ARDUPILOT_IN_SETUP, 25),
        ("px4", PX4_AT_CONNECT_AND_IN_SETUP, 33),
        ("generic", PX4_AT_CONNECT_AND_IN_SETUP, 33),
    ]:
        names = set(needed.split())
        assert len(names) == count
        assert names - set(parameters_of(persona)) == set()
