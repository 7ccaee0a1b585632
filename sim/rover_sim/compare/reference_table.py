"""The real figures; columns: ArduPilot skid, Ackermann, PX4 differential, Ackermann.

None: it did not happen, or was never sent. In texts, # stands for a number.
"""

from collections.abc import Mapping
from typing import Final

from rover_sim.compare.figure import Value

Row = tuple[Value, Value, Value, Value]

NOT_DRIVEN: Final = "not driven"  # a manoeuvre that this one was not put through
YES, NO = "yes", "no"

FAILED = "failed"
REJECTED = "temporarily rejected"
ARM_REASONS = "Arm: System not initialised; Arm: Accels inconsistent; Arm: Gyros inconsistent"
PREFLIGHT_REASONS = (
    "Preflight Fail: system power unavailable; Arming denied: Resolve system health failures firs"
)
DENIED = "Arming denied: Resolve system health failures firs"
GUIDED_HOLD = "GUIDED, HOLD"
OFFBOARD_HOLD = "OFFBOARD, HOLD"
GUIDED = "GUIDED"
OFFBOARD_RTL = "OFFBOARD, RTL, OFFBOARD disarmed"
NO_TARGET = "target not received last #secs, stopping"
RETURNS = (
    "Failsafe activated; RTL: land at destination; RTL: start return at # m (# m abov"
    "e destination; ); Landing detected; Disarmed by landing"
)
GUIDED_DISARMED = "GUIDED, GUIDED disarmed"
OFFBOARD_DISARMED = "OFFBOARD, OFFBOARD disarmed"
THROTTLE_DISARMED = "Throttle disarmed; target not received last #secs, stopping"
DISARMED_BY_COMMAND = "Disarmed by external command"

TABLE: Mapping[str, Mapping[str, Row]] = {
    "Start": {
        "first LOCAL_POSITION_NED": (10.26, 10.26, 0.03, 0.03),
        "GPS fix": (9.71, 9.72, 0.0, 0.0),
        "first GPS_GLOBAL_ORIGIN": (20.98, 21.01, 1.0, 1.01),
        "first HOME_POSITION": (10.24, 10.24, 1.0, 1.01),
        "pre-arm check healthy": (23.32, 23.32, 4.0, 4.04),
        "arming accepted": (25.12, 25.0, 4.08, 4.14),
        "GUIDED accepted": (0.99, 0.9, NOT_DRIVEN, NOT_DRIVEN),
        "GUIDED lost again": (YES, YES, NOT_DRIVEN, NOT_DRIVEN),
        "text that the estimator uses GPS": (41.78, 41.78, NOT_DRIVEN, NOT_DRIVEN),
        "arming refused, times": (8, 8, 1, 1),
        "arming refused with": (FAILED, FAILED, REJECTED, REJECTED),
        "reasons given": (ARM_REASONS, ARM_REASONS, PREFLIGHT_REASONS, DENIED),
        "first HOME_POSITION has numbers for x, y, z": (NO, NO, YES, YES),
        "yaw of the first ATTITUDE off the true one": (0.0, 0.1, 90.0, 0.0),
        "largest leap of the reported position before driving": (0.0, 0.01, 0.0, 0.01),
    },
    "Standing disarmed": {
        "reported speed, p50": (0.025, 0.025, 0.002, 0.036),
        "reported speed, p95": (0.026, 0.026, 0.005, 0.053),
        "reported speed, max": (0.026, 0.026, 0.005, 0.059),
        "reported speed below 0.03 m/s": (100, 100, 100, 37),
        "reported velocity, its mean": (0.025, 0.025, 0.001, 0.008),
        "its north part alike after 1 s": (0.86, 0.88, 0.36, 0.74),
        "its north part alike after 3 s": (0.35, 0.4, 0.16, 0.18),
        "reported position from its mean, p95": (0.002, 0.002, 0.005, 0.072),
        "reported position from its mean, max": (0.003, 0.003, 0.005, 0.082),
        "reported yaw, standard deviation": (0.01, 0.01, 0.0, 0.13),
        "reported yaw rate, p50": (0.05, 0.05, 0.01, 0.24),
        "reported yaw rate, p95": (0.06, 0.06, 0.05, 0.64),
        "reported yaw rate, max": (0.06, 0.06, 0.08, 1.11),
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
        "its north part alike after 1 s": (0.83, 0.83, 0.37, 0.88),
        "its north part alike after 3 s": (0.3, 0.3, 0.2, 0.63),
        "reported position from its mean, p95": (0.021, 0.021, 0.006, 0.081),
        "reported position from its mean, max": (0.022, 0.022, 0.006, 0.085),
        "reported yaw, standard deviation": (0.08, 0.06, 0.03, 0.11),
        "reported yaw rate, p50": (0.04, 0.04, 0.01, 0.22),
        "reported yaw rate, p95": (0.07, 0.04, 0.05, 0.66),
        "reported yaw rate, max": (0.09, 0.05, 1.4, 1.08),
        "true speed, max": (0.0, 0.0, 0.0, 0.0),
        "truly turned": (0.4, 0.0, 0.1, 0.0),
        "landed_state": (0, 0, 2, 2),
        "turned by the first streamed zeros": (0.4, 0.0, 89.5, 0.0),
    },
    "Estimate and truth": {
        "reported speed while it stands, driven before, p50": (0.028, 0.027, 0.004, 0.284),
        "reported speed while it stands, driven before, p95": (0.048, 0.028, 0.01, 0.473),
        "reported speed while it stands, driven before, max": (0.053, 0.028, 0.013, 0.665),
        "reported velocity off the true one, p50": (0.028, 0.028, 0.004, 0.218),
        "reported velocity off the true one, p95": (0.043, 0.048, 0.011, 0.571),
        "reported velocity off the true one, max": (0.058, 0.073, 0.037, 0.956),
        "reported yaw off the true one, p50": (0.9, 1.0, 0.0, 4.1),
        "reported yaw off the true one, p95": (1.1, 1.1, 0.1, 9.2),
        "reported yaw off the true one, max": (1.2, 1.2, 1.1, 14.8),
        "reported yaw off the true one, from p5 to p95": (0.5, 0.4, 0.2, 14.0),
        "reported position off, against the start, p50": (0.02, 0.02, 0.01, 0.18),
        "reported position off, against the start, p95": (0.04, 0.06, 0.03, 0.43),
        "reported position off, against the start, max": (0.09, 0.14, 0.06, 0.71),
    },
    "Timing": {
        "between two LOCAL_POSITION_NED, p50": (0.022, 0.022, 0.02, 0.02),
        "between two LOCAL_POSITION_NED, p95": (0.042, 0.042, 0.021, 0.021),
        "between two LOCAL_POSITION_NED, max": (0.058, 0.088, 0.069, 0.046),
        "acknowledgement of mode and arming, p50": (0.011, 0.012, 0.004, 0.004),
        "acknowledgement of mode and arming, max": (0.024, 0.023, 0.062, 0.048),
    },
    "Step 0.5 m/s": {
        "steady speed": (0.526, 0.503, 0.5, 0.0),
        "scatter of the steady speed": (0.003, 0.021, 0.0, 0.0),
        "reaches 10 % of what was asked": (0.21, 0.32, 0.07, None),
        "reaches 63 % of what was asked": (0.53, 0.71, 0.2, None),
        "reaches 90 % of what was asked": (0.69, 0.95, 0.28, None),
        "peak over what was asked": (10, 35, 0, -100),
        "yaw changed": (0.7, 0.0, 0.0, 0.0),
        "stops after": (1.0, 3.59, 0.31, 0.04),
        "stops within": (0.23, 0.47, 0.05, 0.0),
        "swings back to": (0.0, 0.0, 0.0, 0.0),
        "yaw changed by zeros": (0.0, 0.0, 0.0, 0.0),
    },
    "Step 1 m/s": {
        "steady speed": (1.027, 0.997, 1.0, 1.37),
        "scatter of the steady speed": (0.006, 0.059, 0.0, 0.0),
        "reaches 10 % of what was asked": (0.28, 0.38, 0.09, 0.53),
        "reaches 63 % of what was asked": (0.83, 1.02, 0.26, 0.73),
        "reaches 90 % of what was asked": (1.07, 1.26, 0.39, 0.85),
        "peak over what was asked": (8, 29, 0, 37),
        "yaw changed": (0.4, 0.0, 0.0, 1.1),
        "stops after": (1.46, 3.69, 0.41, 0.74),
        "stops within": (0.68, 0.96, 0.14, 0.64),
        "swings back to": (0.0, 0.0, 0.0, 0.0),
        "yaw changed by zeros": (0.1, 0.0, 0.0, 13.5),
    },
    "Step 2 m/s": {
        "steady speed": (2.047, 2.133, 1.804, 2.496),
        "scatter of the steady speed": (0.021, 0.156, 0.0, 0.003),
        "reaches 10 % of what was asked": (0.41, 0.56, 0.15, 0.53),
        "reaches 63 % of what was asked": (1.41, 1.52, 0.44, 0.78),
        "reaches 90 % of what was asked": (1.89, 1.92, 0.86, 0.9),
        "peak over what was asked": (6, 22, -10, 25),
        "yaw changed": (0.4, 0.0, 0.0, 5.7),
        "stops after": (2.36, 2.19, 0.57, 1.15),
        "stops within": (2.38, 2.44, 0.4, 1.69),
        "swings back to": (0.0, 0.0, 0.0, 0.0),
        "yaw changed by zeros": (0.1, 0.0, 0.0, 3.2),
    },
    "Step -0.5 m/s": {
        "steady speed": (-0.489, -0.472, -0.5, 0.0),
        "scatter of the steady speed": (0.002, 0.019, 0.0, 0.0),
        "reaches 10 % of what was asked": (0.23, 0.34, 0.78, None),
        "reaches 63 % of what was asked": (0.55, 0.77, 0.91, None),
        "reaches 90 % of what was asked": (0.75, 1.05, 1.03, None),
        "peak over what was asked": (4, 24, 0, -100),
        "yaw changed": (0.3, 0.0, 180.2, 0.0),
        "stops after": (0.94, 2.84, 0.31, 0.02),
        "stops within": (0.21, 0.38, 0.06, 0.0),
        "swings back to": (0.0, 0.0, 0.0, 0.0),
        "yaw changed by zeros": (0.0, 0.0, 0.0, 0.0),
    },
    "Step 0.1 m/s": {
        "steady speed": (0.12, 0.121, 0.104, 0.0),
        "scatter of the steady speed": (0.001, 0.001, 0.002, 0.0),
        "reaches 10 % of what was asked": (0.09, 0.2, 0.05, None),
        "reaches 63 % of what was asked": (0.25, 0.52, 0.09, None),
        "reaches 90 % of what was asked": (0.41, 0.68, 0.17, None),
        "peak over what was asked": (25, 56, 8, -100),
        "mean speed over 8 s": (0.119, 0.12, 0.101, 0.004),
        "stops after": (0.48, 2.83, 0.13, 0.01),
        "stops within": (0.02, 0.17, 0.01, 0.0),
    },
    "Step 0.05 m/s": {
        "steady speed": (0.069, 0.07, 0.056, 0.0),
        "scatter of the steady speed": (0.0, 0.0, 0.001, 0.0),
        "reaches 10 % of what was asked": (0.07, 0.02, 0.04, None),
        "reaches 63 % of what was asked": (0.23, 0.38, 0.12, None),
        "reaches 90 % of what was asked": (0.39, 0.58, 0.21, None),
        "peak over what was asked": (39, 66, 20, -100),
        "mean speed over 8 s": (0.07, 0.068, 0.054, 0.004),
        "stops after": (0.3, 1.73, 0.07, 0.01),
        "stops within": (0.01, 0.08, 0.0, 0.0),
    },
    "Step 0.02 m/s": {
        "steady speed": (0.039, 0.041, 0.024, 0.0),
        "scatter of the steady speed": (0.001, 0.001, 0.0, 0.0),
        "reaches 10 % of what was asked": (0.05, 0.0, 0.02, None),
        "reaches 63 % of what was asked": (0.18, 0.24, 0.12, None),
        "reaches 90 % of what was asked": (0.3, 0.4, 0.2, None),
        "peak over what was asked": (100, 129, 20, -100),
        "mean speed over 8 s": (0.037, 0.037, 0.022, 0.004),
        "stops after": (0.13, 0.59, 0.03, 0.01),
        "stops within": (0.01, 0.03, 0.0, 0.0),
    },
    "Turn +30 deg/s on the spot": {
        "rate reached": (29.7, 0.0, NOT_DRIVEN, NOT_DRIVEN),
        "reaches 63 % of the rate asked": (0.16, None, NOT_DRIVEN, NOT_DRIVEN),
        "peak rate": (32.5, 0.1, NOT_DRIVEN, NOT_DRIVEN),
        "turned": (117.2, -0.2, NOT_DRIVEN, NOT_DRIVEN),
        "way made meanwhile": (0.0, 0.0, NOT_DRIVEN, NOT_DRIVEN),
        "turned on after zeros": (2.4, 0.0, NOT_DRIVEN, NOT_DRIVEN),
    },
    "Turn -30 deg/s on the spot": {
        "rate reached": (-30.2, 0.0, NOT_DRIVEN, NOT_DRIVEN),
        "reaches 63 % of the rate asked": (0.18, None, NOT_DRIVEN, NOT_DRIVEN),
        "peak rate": (33.6, 0.0, NOT_DRIVEN, NOT_DRIVEN),
        "turned": (-117.3, 0.0, NOT_DRIVEN, NOT_DRIVEN),
        "way made meanwhile": (0.0, 0.0, NOT_DRIVEN, NOT_DRIVEN),
        "turned on after zeros": (3.1, 0.0, NOT_DRIVEN, NOT_DRIVEN),
    },
    "Turn 0.1 m/s at +90 deg": {
        "peak rate": (NOT_DRIVEN, NOT_DRIVEN, 195.6, 0.0),
        "turned": (NOT_DRIVEN, NOT_DRIVEN, 89.7, 0.0),
        "way made meanwhile": (NOT_DRIVEN, NOT_DRIVEN, 0.4, 0.03),
        "turned on after zeros": (NOT_DRIVEN, NOT_DRIVEN, 89.6, 0.0),
    },
    "Turn 0.1 m/s at -90 deg": {
        "peak rate": (NOT_DRIVEN, NOT_DRIVEN, 194.6, 0.0),
        "turned": (NOT_DRIVEN, NOT_DRIVEN, -89.7, 0.0),
        "way made meanwhile": (NOT_DRIVEN, NOT_DRIVEN, 0.41, 0.02),
        "turned on after zeros": (NOT_DRIVEN, NOT_DRIVEN, 89.1, 0.0),
    },
    "Turn 0.5 m/s with 20 deg/s": {
        "rate reached": (19.9, 10.0, 20.1, 0.0),
        "reaches 63 % of the rate asked": (0.12, 1.58, 0.23, None),
        "peak rate": (23.2, 12.9, 20.6, 0.0),
        "turned": (99.1, 48.4, 96.4, 0.0),
        "way made meanwhile": (2.51, 2.56, 2.45, 0.02),
        "turned on after zeros": (0.8, 0.9, 82.9, 0.0),
    },
    "HOLD at 1 m/s": {
        "speed at the start": (1.025, 0.983, 1.0, 1.426),
        "slower by a tenth after": (0.17, 0.28, 0.11, 0.26),
        "stands after": (1.17, 7.03, 0.41, 4.02),
        "stands within": (0.45, 2.18, 0.16, 5.66),
        "top speed": (1.025, 0.983, 1.0, 2.306),
        "yaw changed": (0.0, 0.0, 0.0, 321.3),
        "modes": (GUIDED_HOLD, GUIDED_HOLD, OFFBOARD_HOLD, OFFBOARD_HOLD),
        "last change of mode seen after": (0.01, 0.01, 0.93, 0.83),
        "texts": (None, None, None, None),
    },
    "set-points end at 1 m/s": {
        "speed at the start": (1.024, 0.98, 1.0, 1.357),
        "slower by a tenth after": (3.28, 3.46, 1.21, 12.53),
        "stands after": (4.48, 6.78, 1.51, 12.9),
        "stands within": (3.77, 4.16, 1.21, 34.65),
        "top speed": (1.024, 1.032, 1.804, 3.272),
        "yaw changed": (0.1, 0.0, 175.1, 151.0),
        "modes": (GUIDED, GUIDED, OFFBOARD_RTL, OFFBOARD_RTL),
        "last change of mode seen after": (None, None, 18.16, 14.6),
        "texts": (NO_TARGET, NO_TARGET, RETURNS, RETURNS),
    },
    "disarm at 1 m/s": {
        "speed at the start": (1.024, 0.983, 1.0, 1.476),
        "slower by a tenth after": (0.09, 0.27, 0.06, None),
        "stands after": (1.05, 7.03, 0.36, None),
        "stands within": (0.31, 2.13, 0.1, None),
        "top speed": (1.024, 0.983, 1.0, 1.476),
        "yaw changed": (0.0, 0.0, 0.0, 1.8),
        "modes": (GUIDED_DISARMED, GUIDED_DISARMED, OFFBOARD_DISARMED, OFFBOARD_DISARMED),
        "last change of mode seen after": (0.52, 0.75, 0.6, 0.02),
        "texts": (THROTTLE_DISARMED, THROTTLE_DISARMED, DISARMED_BY_COMMAND, DISARMED_BY_COMMAND),
    },
    "Throttle stick, asked 0 m/s": {
        "speed, stick free": (0.0, 0.001, NOT_DRIVEN, NOT_DRIVEN),
        "channel 3, stick free": (1500, 1500, NOT_DRIVEN, NOT_DRIVEN),
        "speed, stick forward": (1.945, 2.616, NOT_DRIVEN, NOT_DRIVEN),
        "channel 3, stick forward": (1750, 1750, NOT_DRIVEN, NOT_DRIVEN),
        "speed, stick released": (0.0, -0.409, NOT_DRIVEN, NOT_DRIVEN),
        "channel 3, stick released": (1500, 1500, NOT_DRIVEN, NOT_DRIVEN),
    },
    "Throttle stick, asked 0.5 m/s": {
        "speed, stick free": (0.521, 0.518, NOT_DRIVEN, NOT_DRIVEN),
        "channel 3, stick free": (1500, 1500, NOT_DRIVEN, NOT_DRIVEN),
        "speed, stick forward": (1.919, 3.109, NOT_DRIVEN, NOT_DRIVEN),
        "channel 3, stick forward": (1750, 1750, NOT_DRIVEN, NOT_DRIVEN),
        "speed, stick released": (0.499, 0.088, NOT_DRIVEN, NOT_DRIVEN),
        "channel 3, stick released": (1500, 1500, NOT_DRIVEN, NOT_DRIVEN),
    },
    "Origin and home": {
        "GPS_GLOBAL_ORIGIN, different places": (1, 1, 1, 1),
        "GPS_GLOBAL_ORIGIN, farthest from the first": (0.0, 0.0, 0.0, 0.0),
        "GPS_GLOBAL_ORIGIN, spread of altitude": (0.0, 0.0, 0.0, 0.0),
        "GPS_GLOBAL_ORIGIN, leap of altitude in one place, p95": (0.0, 0.0, 0.0, 0.0),
        "HOME_POSITION, different places": (4, 6, 9, 43),
        "HOME_POSITION, farthest from the first": (46.79, 72.9, 12.51, 46.71),
        "HOME_POSITION, spread of altitude": (487.87, 487.94, 0.01, 5.53),
        "HOME_POSITION, leap of altitude in one place, p95": (0.0, 0.0, 0.0, 1.44),
        "home's moves when disarmed at 1 m/s": (1, 3, 1, 14),
        "home moves when disarmed": (YES, YES, YES, YES),
        "home moves while driving": (NO, NO, NO, NO),
        "home moves when armed": (NO, NO, YES, YES),
    },
}
