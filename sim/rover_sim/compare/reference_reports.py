"""The real figures of start, standing, estimate, timing and places: the messages of a rover."""

from collections.abc import Mapping

from rover_sim.compare.reference_row import NOT_DRIVEN, Row

YES, NO = "yes", "no"
FAILED = "failed"
REJECTED = "temporarily rejected"
ARM_REASONS = "Arm: System not initialised; Arm: Accels inconsistent; Arm: Gyros inconsistent"
PREFLIGHT_REASONS = (
    "Preflight Fail: system power unavailable; Arming denied: Resolve system health failures firs"
)
DENIED = "Arming denied: Resolve system health failures firs"
GUIDED = "GUIDED"

REPORTS: Mapping[str, Mapping[str, Row]] = {
    "Start": {
        "first LOCAL_POSITION_NED": (10.26, 10.26, 0.031, 0.032),
        "GPS fix": (9.715, 9.722, 0.0, 0.0),
        "first GPS_GLOBAL_ORIGIN": (20.978, 21.006, 1.0, 1.007),
        "first HOME_POSITION": (10.237, 10.242, 1.0, 1.007),
        "pre-arm check healthy": (23.318, 23.323, 3.996, 4.038),
        "arming accepted": (25.118, 25.002, 4.079, 4.139),
        "GUIDED accepted": (0.993, 0.898, NOT_DRIVEN, NOT_DRIVEN),
        "GUIDED lost again": (YES, YES, NOT_DRIVEN, NOT_DRIVEN),
        "text that the estimator uses GPS": (41.784, 41.784, NOT_DRIVEN, NOT_DRIVEN),
        "arming refused, times": (8, 8, 1, 1),
        "arming refused with": (FAILED, FAILED, REJECTED, REJECTED),
        "reasons given": (ARM_REASONS, ARM_REASONS, PREFLIGHT_REASONS, DENIED),
        "first HOME_POSITION has numbers for x, y, z": (NO, NO, YES, YES),
        "yaw of the first ATTITUDE off the true one": (0.0, 0.127, 90.001, 0.008),
        "largest leap of the reported position before driving": (0.001, 0.011, 0.0, 0.007),
    },
    "Standing disarmed": {
        "reported speed, p50": (0.025, 0.025, 0.002, 0.036),
        "reported speed, p95": (0.026, 0.026, 0.005, 0.053),
        "reported speed, max": (0.026, 0.026, 0.005, 0.059),
        "reported speed below 0.03 m/s": (100, 100, 100, 37),
        "reported velocity, its mean": (0.025, 0.025, 0.001, 0.008),
        "its north part alike after 1 s": (0.86, 0.875, 0.362, 0.74),
        "its north part alike after 3 s": (0.349, 0.404, 0.157, 0.184),
        "reported position from its mean, p95": (0.002, 0.002, 0.005, 0.072),
        "reported position from its mean, max": (0.003, 0.003, 0.005, 0.082),
        "reported yaw, standard deviation": (0.012, 0.012, 0.005, 0.131),
        "reported yaw rate, p50": (0.047, 0.047, 0.012, 0.235),
        "reported yaw rate, p95": (0.057, 0.057, 0.047, 0.638),
        "reported yaw rate, max": (0.059, 0.059, 0.077, 1.108),
        "true speed, max": (0.0, 0.0, 0.0, 0.0),
        "truly turned": (0.0, 0.0, 0.0, 0.0),
        "landed_state": (0, 0, 1, 1),
    },
    "Standing armed": {
        "reported speed, p50": (0.029, 0.029, 0.003, 0.037),
        "reported speed, p95": (0.035, 0.035, 0.006, 0.064),
        "reported speed, max": (0.036, 0.036, 0.006, 0.069),
        "reported speed below 0.03 m/s": (58, 59, 100, 33),
        "reported velocity, its mean": (0.026, 0.026, 0.002, 0.025),
        "its north part alike after 1 s": (0.827, 0.828, 0.369, 0.884),
        "its north part alike after 3 s": (0.298, 0.301, 0.199, 0.627),
        "reported position from its mean, p95": (0.021, 0.021, 0.006, 0.081),
        "reported position from its mean, max": (0.022, 0.022, 0.006, 0.085),
        "reported yaw, standard deviation": (0.08, 0.059, 0.034, 0.108),
        "reported yaw rate, p50": (0.042, 0.042, 0.012, 0.225),
        "reported yaw rate, p95": (0.071, 0.044, 0.048, 0.656),
        "reported yaw rate, max": (0.086, 0.046, 1.396, 1.082),
        "true speed, max": (0.0, 0.0, 0.0, 0.0),
        "truly turned": (0.367, 0.0, 0.092, 0.0),
        "landed_state": (0, 0, 2, 2),
        "turned by the first streamed zeros": (0.367, 0.0, 89.49, 0.0),
    },
    "Estimate and truth": {
        "reported speed while it stands, driven before, p50": (0.028, 0.027, 0.004, 0.284),
        "reported speed while it stands, driven before, p95": (0.048, 0.028, 0.01, 0.473),
        "reported speed while it stands, driven before, max": (0.053, 0.028, 0.013, 0.665),
        "reported velocity off the true one, p50": (0.028, 0.028, 0.004, 0.218),
        "reported velocity off the true one, p95": (0.043, 0.048, 0.011, 0.571),
        "reported velocity off the true one, max": (0.058, 0.073, 0.037, 0.956),
        "reported yaw off the true one, p50": (0.894, 0.967, 0.045, 4.106),
        "reported yaw off the true one, p95": (1.135, 1.128, 0.132, 9.204),
        "reported yaw off the true one, max": (1.233, 1.15, 1.084, 14.826),
        "reported yaw off the true one, from p5 to p95": (0.453, 0.384, 0.188, 13.978),
        "reported position off, against the start, p50": (0.024, 0.022, 0.013, 0.176),
        "reported position off, against the start, p95": (0.044, 0.057, 0.026, 0.432),
        "reported position off, against the start, max": (0.092, 0.141, 0.059, 0.709),
    },
    "Timing": {
        "between two LOCAL_POSITION_NED, p50": (0.022, 0.022, 0.02, 0.02),
        "between two LOCAL_POSITION_NED, p95": (0.042, 0.042, 0.021, 0.021),
        "between two LOCAL_POSITION_NED, max": (0.058, 0.088, 0.069, 0.046),
        "acknowledgement of mode and arming, p50": (0.011, 0.012, 0.004, 0.004),
        "acknowledgement of mode and arming, max": (0.024, 0.023, 0.062, 0.048),
    },
    "Origin and home": {
        "GPS_GLOBAL_ORIGIN, different places": (1, 1, 1, 1),
        "GPS_GLOBAL_ORIGIN, farthest from the first": (0.0, 0.0, 0.0, 0.0),
        "GPS_GLOBAL_ORIGIN, spread of altitude": (0.0, 0.0, 0.0, 0.0),
        "GPS_GLOBAL_ORIGIN, leap of altitude in one place, p95": (0.0, 0.0, 0.0, 0.0),
        "HOME_POSITION, different places": (4, 6, 9, 43),
        "HOME_POSITION, farthest from the first": (46.785, 72.898, 12.512, 46.71),
        "HOME_POSITION, spread of altitude": (487.87, 487.94, 0.007, 5.529),
        "HOME_POSITION, leap of altitude in one place, p95": (0.0, 0.0, 0.0, 1.436),
        "home's moves when disarmed at 1 m/s": (1, 3, 1, 14),
        "home moves when disarmed": (YES, YES, YES, YES),
        "home moves while driving": (NO, NO, NO, NO),
        "home moves when armed": (NO, NO, YES, YES),
    },
}
