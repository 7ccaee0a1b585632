"""The real figures of steps, turns, endings and sticks: the motion of a rover."""

from collections.abc import Mapping

from rover_sim.compare.reference_row import NOT_DRIVEN, Row

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

DRIVING: Mapping[str, Mapping[str, Row]] = {
    "Step 0.5 m/s": {
        "steady speed": (0.526, 0.503, 0.5, 0.0),
        "scatter of the steady speed": (0.003, 0.021, 0.0, 0.0),
        "reaches 10 % of what was asked": (0.21, 0.317, 0.066, None),
        "reaches 63 % of what was asked": (0.53, 0.715, 0.199, None),
        "reaches 90 % of what was asked": (0.69, 0.954, 0.282, None),
        "peak over what was asked": (10, 35, 0, -100),
        "yaw changed": (0.688, 0.0, 0.0, 0.0),
        "stops after": (1.005, 3.585, 0.308, 0.036),
        "stops within": (0.234, 0.467, 0.053, 0.0),
        "swings back to": (0.0, 0.0, 0.0, 0.0),
        "yaw changed by zeros": (0.029, 0.0, 0.0, 0.0),
    },
    "Step 1 m/s": {
        "steady speed": (1.027, 0.997, 1.0, 1.37),
        "scatter of the steady speed": (0.006, 0.059, 0.0, 0.0),
        "reaches 10 % of what was asked": (0.275, 0.377, 0.094, 0.53),
        "reaches 63 % of what was asked": (0.832, 1.018, 0.259, 0.732),
        "reaches 90 % of what was asked": (1.072, 1.259, 0.393, 0.853),
        "peak over what was asked": (8, 29, 0, 37),
        "yaw changed": (0.361, 0.0, 0.0, 1.106),
        "stops after": (1.46, 3.688, 0.408, 0.736),
        "stops within": (0.683, 0.957, 0.141, 0.636),
        "swings back to": (0.0, 0.0, 0.0, 0.0),
        "yaw changed by zeros": (0.063, 0.0, 0.0, 13.493),
    },
    "Step 2 m/s": {
        "steady speed": (2.047, 2.133, 1.804, 2.496),
        "scatter of the steady speed": (0.021, 0.156, 0.0, 0.003),
        "reaches 10 % of what was asked": (0.415, 0.556, 0.151, 0.535),
        "reaches 63 % of what was asked": (1.415, 1.519, 0.438, 0.777),
        "reaches 90 % of what was asked": (1.895, 1.919, 0.858, 0.898),
        "peak over what was asked": (6, 22, -10, 25),
        "yaw changed": (0.355, 0.0, 0.0, 5.747),
        "stops after": (2.362, 2.187, 0.574, 1.149),
        "stops within": (2.38, 2.438, 0.402, 1.688),
        "swings back to": (0.0, 0.0, 0.0, 0.0),
        "yaw changed by zeros": (0.092, 0.0, 0.0, 3.168),
    },
    "Step -0.5 m/s": {
        "steady speed": (-0.489, -0.472, -0.5, 0.0),
        "scatter of the steady speed": (0.002, 0.019, 0.0, 0.0),
        "reaches 10 % of what was asked": (0.231, 0.336, 0.776, None),
        "reaches 63 % of what was asked": (0.549, 0.774, 0.909, None),
        "reaches 90 % of what was asked": (0.75, 1.054, 1.032, None),
        "peak over what was asked": (4, 24, 0, -100),
        "yaw changed": (0.292, 0.0, 180.247, 0.0),
        "stops after": (0.94, 2.844, 0.31, 0.019),
        "stops within": (0.212, 0.379, 0.056, 0.0),
        "swings back to": (0.0, 0.0, 0.0, 0.0),
        "yaw changed by zeros": (0.034, 0.0, 0.0, 0.0),
    },
    "Step 0.1 m/s": {
        "steady speed": (0.12, 0.121, 0.104, 0.0),
        "scatter of the steady speed": (0.001, 0.001, 0.002, 0.0),
        "reaches 10 % of what was asked": (0.093, 0.196, 0.051, None),
        "reaches 63 % of what was asked": (0.251, 0.518, 0.091, None),
        "reaches 90 % of what was asked": (0.413, 0.681, 0.173, None),
        "peak over what was asked": (25, 56, 8, -100),
        "mean speed over 8 s": (0.119, 0.12, 0.101, 0.004),
        "stops after": (0.48, 2.83, 0.129, 0.008),
        "stops within": (0.022, 0.167, 0.007, 0.0),
    },
    "Step 0.05 m/s": {
        "steady speed": (0.069, 0.07, 0.056, 0.0),
        "scatter of the steady speed": (0.0, 0.0, 0.001, 0.0),
        "reaches 10 % of what was asked": (0.07, 0.02, 0.04, None),
        "reaches 63 % of what was asked": (0.23, 0.382, 0.124, None),
        "reaches 90 % of what was asked": (0.393, 0.578, 0.209, None),
        "peak over what was asked": (39, 66, 20, -100),
        "mean speed over 8 s": (0.07, 0.068, 0.054, 0.004),
        "stops after": (0.3, 1.729, 0.071, 0.01),
        "stops within": (0.011, 0.078, 0.002, 0.0),
    },
    "Step 0.02 m/s": {
        "steady speed": (0.039, 0.041, 0.024, 0.0),
        "scatter of the steady speed": (0.001, 0.001, 0.0, 0.0),
        "reaches 10 % of what was asked": (0.054, 0.002, 0.024, None),
        "reaches 63 % of what was asked": (0.176, 0.239, 0.116, None),
        "reaches 90 % of what was asked": (0.295, 0.399, 0.198, None),
        "peak over what was asked": (100, 129, 20, -100),
        "mean speed over 8 s": (0.037, 0.037, 0.022, 0.004),
        "stops after": (0.127, 0.589, 0.032, 0.014),
        "stops within": (0.011, 0.034, 0.0, 0.0),
    },
    "Turn +30 deg/s on the spot": {
        "rate reached": (29.679, -0.023, NOT_DRIVEN, NOT_DRIVEN),
        "reaches 63 % of the rate asked": (0.157, None, NOT_DRIVEN, NOT_DRIVEN),
        "peak rate": (32.481, 0.092, NOT_DRIVEN, NOT_DRIVEN),
        "turned": (117.181, -0.166, NOT_DRIVEN, NOT_DRIVEN),
        "way made meanwhile": (0.0, 0.0, NOT_DRIVEN, NOT_DRIVEN),
        "turned on after zeros": (2.418, 0.0, NOT_DRIVEN, NOT_DRIVEN),
    },
    "Turn -30 deg/s on the spot": {
        "rate reached": (-30.241, 0.0, NOT_DRIVEN, NOT_DRIVEN),
        "reaches 63 % of the rate asked": (0.179, None, NOT_DRIVEN, NOT_DRIVEN),
        "peak rate": (33.598, 0.0, NOT_DRIVEN, NOT_DRIVEN),
        "turned": (-117.279, 0.0, NOT_DRIVEN, NOT_DRIVEN),
        "way made meanwhile": (0.0, 0.0, NOT_DRIVEN, NOT_DRIVEN),
        "turned on after zeros": (3.065, 0.0, NOT_DRIVEN, NOT_DRIVEN),
    },
    "Turn 0.1 m/s at +90 deg": {
        "peak rate": (NOT_DRIVEN, NOT_DRIVEN, 195.591, 0.0),
        "turned": (NOT_DRIVEN, NOT_DRIVEN, 89.702, 0.0),
        "way made meanwhile": (NOT_DRIVEN, NOT_DRIVEN, 0.404, 0.03),
        "turned on after zeros": (NOT_DRIVEN, NOT_DRIVEN, 89.622, 0.0),
    },
    "Turn 0.1 m/s at -90 deg": {
        "peak rate": (NOT_DRIVEN, NOT_DRIVEN, 194.622, 0.0),
        "turned": (NOT_DRIVEN, NOT_DRIVEN, -89.707, 0.0),
        "way made meanwhile": (NOT_DRIVEN, NOT_DRIVEN, 0.409, 0.022),
        "turned on after zeros": (NOT_DRIVEN, NOT_DRIVEN, 89.089, 0.0),
    },
    "Turn 0.5 m/s with 20 deg/s": {
        "rate reached": (19.882, 9.981, 20.079, 0.0),
        "reaches 63 % of the rate asked": (0.116, 1.581, 0.234, None),
        "peak rate": (23.239, 12.903, 20.592, 0.0),
        "turned": (99.105, 48.426, 96.422, 0.0),
        "way made meanwhile": (2.51, 2.555, 2.449, 0.022),
        "turned on after zeros": (0.751, 0.865, 82.861, 0.0),
    },
    "HOLD at 1 m/s": {
        "speed at the start": (1.025, 0.983, 1.0, 1.426),
        "slower by a tenth after": (0.172, 0.276, 0.114, 0.256),
        "stands after": (1.167, 7.031, 0.412, 4.016),
        "stands within": (0.446, 2.178, 0.163, 5.659),
        "top speed": (1.025, 0.983, 1.0, 2.306),
        "yaw changed": (0.006, 0.0, 0.0, 321.331),
        "modes": (GUIDED_HOLD, GUIDED_HOLD, OFFBOARD_HOLD, OFFBOARD_HOLD),
        "last change of mode seen after": (0.011, 0.014, 0.929, 0.826),
        "texts": (None, None, None, None),
    },
    "set-points end at 1 m/s": {
        "speed at the start": (1.024, 0.98, 1.0, 1.357),
        "slower by a tenth after": (3.278, 3.465, 1.213, 12.534),
        "stands after": (4.477, 6.781, 1.513, 12.899),
        "stands within": (3.768, 4.163, 1.212, 34.654),
        "top speed": (1.024, 1.032, 1.804, 3.272),
        "yaw changed": (0.143, 0.0, 175.119, 151.042),
        "modes": (GUIDED, GUIDED, OFFBOARD_RTL, OFFBOARD_RTL),
        "last change of mode seen after": (None, None, 18.165, 14.603),
        "texts": (NO_TARGET, NO_TARGET, RETURNS, RETURNS),
    },
    "disarm at 1 m/s": {
        "speed at the start": (1.024, 0.983, 1.0, 1.476),
        "slower by a tenth after": (0.087, 0.273, 0.061, None),
        "stands after": (1.046, 7.03, 0.356, None),
        "stands within": (0.308, 2.133, 0.102, None),
        "top speed": (1.024, 0.983, 1.0, 1.476),
        "yaw changed": (0.0, 0.0, 0.0, 1.759),
        "modes": (GUIDED_DISARMED, GUIDED_DISARMED, OFFBOARD_DISARMED, OFFBOARD_DISARMED),
        "last change of mode seen after": (0.524, 0.754, 0.6, 0.016),
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
}
