"""Messages, codes and service settings of magsteer.

Generated from the Rust sources by `magsteer hal bindings`: do not edit.
"""

import ctypes

SCHEMA = 1
SCHEMA_HASH = "8b4372e56dc6ed05"
SCHEMA_ATTRIBUTE = "magsteer-schema"
TRANSPORT_VERSION = "0100"
ROOT_LENGTH_MAX = 65
COILS_MAX = 32
POSE_PARAMETERS_MAX = 8
MAGNETS_MAX = 8
# How far a stamp may lie ahead of the receiver's clock.
FUTURE_TOLERANCE_NS = 1000000
# Longest validity that a driver grants a command.
VALIDITY_MAX_NS = 1000000000
# How far a command's content may run ahead of its publish stamp.
SLEW_JITTER_S = 0.002


class Order:
    """What a CoilCommand asks of the driver."""

    RELEASE = 0
    CLAIM = 1
    DRIVE = 2
    RAMP_DOWN = 3
    DISABLE = 4


class DriverState:
    """State of a driver, in CoilFeedback."""

    IDLE = 0
    DRIVEN = 1
    RAMPING_DOWN = 2
    DISABLED = 3


class Verb:
    """What an operator asks for."""

    ARM = 1
    GO = 2
    HOLD = 3
    STOP = 4
    RESET = 5
    ESTOP = 6
    SET_TARGET = 7
    SAVE = 8
    RETREAT = 9


# Words for StatusMessage.state, by code.
STATE_NAMES = ["boot", "idle", "armed", "active", "holding", "safe-stop", "fault"]

# Words for the causes of refusals and stops, by code.
CAUSES = {
    1: "not possible in this state",
    2: "unknown request",
    3: "the target needs one unit direction a magnet of the rig, and frame angles within their ranges if any",
    4: "another request is under way",
    5: "real-time scheduling is enforced by the configuration but was not granted",
    6: "the driver did not confirm authority in time",
    7: "the driver is not idle at zero current",
    8: "the daemon is ending",
    9: "the rod would snap through on the way to the target",
    10: "on the way to the target a magnet would leave the field model's range",
    11: "held close to a snap-through until another target is set, or `retreat`",
    12: "held because the stream of targets ended",
    13: "going back along the way that led close to a snap-through",
    20: "this daemon has no records to write",
    21: "this machine only watches the rig; it is commanded on its own machine",
    100: "stopped by the operator",
    101: "the process was asked to end",
    200: "no fresh poses",
    201: "the model found no equilibrium",
    202: "a magnet lies outside the field model's range",
    203: "the loop missed too many periods",
    204: "no fresh feedback from the driver",
    205: "the driver runs another description of the rig",
    206: "commands could not be sent",
    207: "the controller asked for a value that is not finite",
    208: "the driver no longer obeys this daemon",
    209: "the pose sensor restarted",
    210: "measured poses and the model disagree",
    211: "currents or angles do not follow commands",
    212: "the rod is not stable where the model has it",
    213: "magnets are seen outside of the workspace",
    214: "measured poses move faster than the rod can",
    215: "a coil does not carry the current that it is asked for: open circuit",
    216: "a coil is too hot by the current that it carried",
    217: "the model stays away from what is measured",
    218: "the controller makes no progress towards its target",
    300: "the driver did not report zero current in time",
    301: "the driver cut its amplifiers",
    302: "the driver reports a fault",
    303: "a measured current lies beyond its limit",
    304: "emergency stop",
}

# Publish-subscribe services: what each is opened with.
SERVICES = {
    "pose": {"history": 1, "buffer": 64, "publishers": 8, "subscribers": 8, "nodes": 20},
    "coil/feedback": {"history": 1, "buffer": 64, "publishers": 8, "subscribers": 8, "nodes": 20},
    "coil/command": {"history": 0, "buffer": 1, "publishers": 8, "subscribers": 8, "nodes": 20},
    "status": {"history": 1, "buffer": 64, "publishers": 8, "subscribers": 16, "nodes": 28},
}
REQUEST = "request"
TARGET_SET = "target/set"


class Header(ctypes.Structure):
    _fields_ = [
        ("sequence", ctypes.c_uint64),
        ("source_stamp_ns", ctypes.c_uint64),
        ("publish_stamp_ns", ctypes.c_uint64),
        ("epoch", ctypes.c_uint64),
        ("schema", ctypes.c_uint32),
        ("flags", ctypes.c_uint32),
        ("valid_until_ns", ctypes.c_uint64),
    ]


class MagnetPose(ctypes.Structure):
    _fields_ = [
        ("position_m", ctypes.c_double * 3),
        ("orientation_xyzw", ctypes.c_double * 4),
        ("valid", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
    ]


class PoseMessage(ctypes.Structure):
    _fields_ = [
        ("header", Header),
        ("magnet_count", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
        ("magnets", MagnetPose * 8),
    ]

    @staticmethod
    def type_name() -> str:
        return "magsteer_pose_v1"


class Actuation(ctypes.Structure):
    _fields_ = [
        ("current_a", ctypes.c_double * 32),
        ("angle_rad", ctypes.c_double * 8),
    ]


class CoilCommand(ctypes.Structure):
    _fields_ = [
        ("header", Header),
        ("token", ctypes.c_uint64),
        ("order", ctypes.c_uint32),
        ("coil_count", ctypes.c_uint32),
        ("pose_parameter_count", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
        ("actuation", Actuation),
    ]

    @staticmethod
    def type_name() -> str:
        return "magsteer_coil_command_v1"


class CoilFeedback(ctypes.Structure):
    _fields_ = [
        ("header", Header),
        ("accepted_sequence", ctypes.c_uint64),
        ("accepted_epoch", ctypes.c_uint64),
        ("description_fingerprint", ctypes.c_uint64),
        ("commands_refused", ctypes.c_uint64),
        ("limit_breaks", ctypes.c_uint64),
        ("answered_pose_stamp_ns", ctypes.c_uint64),
        ("answer_received_stamp_ns", ctypes.c_uint64),
        ("state", ctypes.c_uint32),
        ("fault", ctypes.c_uint32),
        ("coil_count", ctypes.c_uint32),
        ("pose_parameter_count", ctypes.c_uint32),
        ("measured", Actuation),
    ]

    @staticmethod
    def type_name() -> str:
        return "magsteer_coil_feedback_v2"


class OperatorRequest(ctypes.Structure):
    _fields_ = [
        ("verb", ctypes.c_uint32),
        ("magnet_count", ctypes.c_uint32),
        ("direction", (ctypes.c_double * 3) * 8),
        ("pose_parameter_count", ctypes.c_uint32),
        ("valid_ms", ctypes.c_uint32),
        ("angle_rad", ctypes.c_double * 8),
    ]

    @staticmethod
    def type_name() -> str:
        return "magsteer_operator_request_v3"


class OperatorAnswer(ctypes.Structure):
    _fields_ = [
        ("accepted", ctypes.c_uint32),
        ("cause", ctypes.c_uint32),
        ("state", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
        ("epoch", ctypes.c_uint64),
    ]

    @staticmethod
    def type_name() -> str:
        return "magsteer_operator_answer_v1"


class Quantiles(ctypes.Structure):
    _fields_ = [
        ("p50_us", ctypes.c_double),
        ("p99_us", ctypes.c_double),
        ("p999_us", ctypes.c_double),
        ("p9999_us", ctypes.c_double),
        ("max_us", ctypes.c_double),
    ]


class PhaseQuantiles(ctypes.Structure):
    _fields_ = [
        ("read", Quantiles),
        ("control", Quantiles),
        ("decide", Quantiles),
        ("write", Quantiles),
        ("record", Quantiles),
    ]


class LoopTiming(ctypes.Structure):
    _fields_ = [
        ("cycles", ctypes.c_uint64),
        ("missed", ctypes.c_uint64),
        ("lateness", Quantiles),
        ("execution", Quantiles),
        ("phases", PhaseQuantiles),
        ("pose_age", Quantiles),
        ("pose_to_command", Quantiles),
        ("pose_to_driver", Quantiles),
        ("round_trip", Quantiles),
    ]


class StatusMessage(ctypes.Structure):
    _fields_ = [
        ("header", Header),
        ("state", ctypes.c_uint32),
        ("cause", ctypes.c_uint32),
        ("cycle", ctypes.c_uint64),
        ("missed", ctypes.c_uint64),
        ("rate_hz", ctypes.c_double),
        ("rate_measured_hz", ctypes.c_double),
        ("lateness_us", ctypes.c_double),
        ("lateness_max_us", ctypes.c_double),
        ("pose_age_us", ctypes.c_double),
        ("feedback_age_us", ctypes.c_double),
        ("timing", LoopTiming),
        ("last_minute", LoopTiming),
        ("records_dropped", ctypes.c_uint64),
        ("loop_allocations", ctypes.c_uint64),
        ("stability_margin", ctypes.c_double),
        ("magnet_count", ctypes.c_uint32),
        ("coil_count", ctypes.c_uint32),
        ("pose_parameter_count", ctypes.c_uint32),
        ("model_converged", ctypes.c_uint32),
        ("target_verdict", ctypes.c_uint32),
        ("stability_low", ctypes.c_uint32),
        ("recorder", ctypes.c_uint32),
        ("recorder_error", ctypes.c_uint32),
        ("flights", ctypes.c_uint32),
        ("recorder_lost", ctypes.c_uint32),
        ("passive", ctypes.c_uint32),
        ("would_trip", ctypes.c_uint32),
        ("would_trip_count", ctypes.c_uint64),
        ("safe_action", ctypes.c_uint32),
        ("coil_hot", ctypes.c_uint32),
        ("coil_heat", ctypes.c_double),
        ("target_direction", (ctypes.c_double * 3) * 8),
        ("desired_direction", (ctypes.c_double * 3) * 8),
        ("measured_direction", (ctypes.c_double * 3) * 8),
        ("predicted_direction", (ctypes.c_double * 3) * 8),
        ("coil_gain", ctypes.c_double * 32),
        ("modelled", Actuation),
        ("base_force_n", ctypes.c_double * 3),
        ("base_moment_n_m", ctypes.c_double * 3),
        ("measured_position_m", (ctypes.c_double * 3) * 8),
        ("description_fingerprint", ctypes.c_uint64),
        ("measured", Actuation),
        ("admitted", Actuation),
    ]

    @staticmethod
    def type_name() -> str:
        return "magsteer_status_v7"


# Size of each structure and offset of each field as Rust has them.
LAYOUTS = {
    "Header": (48, {
        "sequence": 0,
        "source_stamp_ns": 8,
        "publish_stamp_ns": 16,
        "epoch": 24,
        "schema": 32,
        "flags": 36,
        "valid_until_ns": 40,
    }),
    "MagnetPose": (64, {
        "position_m": 0,
        "orientation_xyzw": 24,
        "valid": 56,
        "reserved": 60,
    }),
    "PoseMessage": (568, {
        "header": 0,
        "magnet_count": 48,
        "reserved": 52,
        "magnets": 56,
    }),
    "Actuation": (320, {
        "current_a": 0,
        "angle_rad": 256,
    }),
    "CoilCommand": (392, {
        "header": 0,
        "token": 48,
        "order": 56,
        "coil_count": 60,
        "pose_parameter_count": 64,
        "reserved": 68,
        "actuation": 72,
    }),
    "CoilFeedback": (440, {
        "header": 0,
        "accepted_sequence": 48,
        "accepted_epoch": 56,
        "description_fingerprint": 64,
        "commands_refused": 72,
        "limit_breaks": 80,
        "answered_pose_stamp_ns": 88,
        "answer_received_stamp_ns": 96,
        "state": 104,
        "fault": 108,
        "coil_count": 112,
        "pose_parameter_count": 116,
        "measured": 120,
    }),
    "OperatorRequest": (272, {
        "verb": 0,
        "magnet_count": 4,
        "direction": 8,
        "pose_parameter_count": 200,
        "valid_ms": 204,
        "angle_rad": 208,
    }),
    "OperatorAnswer": (24, {
        "accepted": 0,
        "cause": 4,
        "state": 8,
        "reserved": 12,
        "epoch": 16,
    }),
    "Quantiles": (40, {
        "p50_us": 0,
        "p99_us": 8,
        "p999_us": 16,
        "p9999_us": 24,
        "max_us": 32,
    }),
    "PhaseQuantiles": (200, {
        "read": 0,
        "control": 40,
        "decide": 80,
        "write": 120,
        "record": 160,
    }),
    "LoopTiming": (456, {
        "cycles": 0,
        "missed": 8,
        "lateness": 16,
        "execution": 56,
        "phases": 96,
        "pose_age": 296,
        "pose_to_command": 336,
        "pose_to_driver": 376,
        "round_trip": 416,
    }),
    "StatusMessage": (3360, {
        "header": 0,
        "state": 48,
        "cause": 52,
        "cycle": 56,
        "missed": 64,
        "rate_hz": 72,
        "rate_measured_hz": 80,
        "lateness_us": 88,
        "lateness_max_us": 96,
        "pose_age_us": 104,
        "feedback_age_us": 112,
        "timing": 120,
        "last_minute": 576,
        "records_dropped": 1032,
        "loop_allocations": 1040,
        "stability_margin": 1048,
        "magnet_count": 1056,
        "coil_count": 1060,
        "pose_parameter_count": 1064,
        "model_converged": 1068,
        "target_verdict": 1072,
        "stability_low": 1076,
        "recorder": 1080,
        "recorder_error": 1084,
        "flights": 1088,
        "recorder_lost": 1092,
        "passive": 1096,
        "would_trip": 1100,
        "would_trip_count": 1104,
        "safe_action": 1112,
        "coil_hot": 1116,
        "coil_heat": 1120,
        "target_direction": 1128,
        "desired_direction": 1320,
        "measured_direction": 1512,
        "predicted_direction": 1704,
        "coil_gain": 1896,
        "modelled": 2152,
        "base_force_n": 2472,
        "base_moment_n_m": 2496,
        "measured_position_m": 2520,
        "description_fingerprint": 2712,
        "measured": 2720,
        "admitted": 3040,
    }),
}
