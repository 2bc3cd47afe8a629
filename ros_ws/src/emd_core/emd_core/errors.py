"""The errors of the folding cell: one small family, each with a code that messages carry."""

from __future__ import annotations

from enum import IntEnum


class ErrorCode(IntEnum):
    """What went wrong, as a number.

    The values equal the constants of ``emd_msgs_py/msg/ErrorCode`` (a test compares them).
    """

    NONE = 0
    UNKNOWN = 1
    INVALID_INPUT = 10
    BUSY = 11
    CANCELLED = 12
    TIMEOUT = 13
    NO_OBSERVATION = 20
    NO_CLOTH = 21
    NO_PLAN = 30
    MODEL = 31
    DOUBTFUL_PLAN = 32
    OUT_OF_REACH = 40
    COLLISION = 41
    NO_HEM = 42
    TRACKING = 43
    GRASP_FAILED = 44
    SIMULATION = 50


class CellError(Exception):
    """Base of all errors that the cell raises on purpose.

    The text says what was wanted, what came, and the remedy; `code` travels in messages.
    """

    code: ErrorCode = ErrorCode.UNKNOWN


class InvalidInputError(CellError):
    """An argument, file or message does not have the form that was asked for."""

    code = ErrorCode.INVALID_INPUT


class BusyError(CellError):
    """The node already works on another goal."""

    code = ErrorCode.BUSY


class CancelledError(CellError):
    """The caller asked to stop."""

    code = ErrorCode.CANCELLED


class DeadlineError(CellError):
    """Something did not happen in the time allowed for it."""

    code = ErrorCode.TIMEOUT


class NoObservationError(CellError):
    """No camera frame or voxel grid has come yet."""

    code = ErrorCode.NO_OBSERVATION


class NoClothError(CellError):
    """No sensible cloth is in view."""

    code = ErrorCode.NO_CLOTH


class NoPlanError(CellError):
    """The search ended without a usable plan."""

    code = ErrorCode.NO_PLAN


class ModelError(CellError):
    """The weights are missing or do not fit the network."""

    code = ErrorCode.MODEL


class DoubtfulPlanError(CellError):
    """The plan found is more likely to fail than the user allows."""

    code = ErrorCode.DOUBTFUL_PLAN


class OutOfReachError(CellError):
    """No arm can take the posture that is asked for."""

    code = ErrorCode.OUT_OF_REACH


class CollisionError(CellError):
    """The motion would touch the table, the robot itself or the other arm."""

    code = ErrorCode.COLLISION


class NoHemError(CellError):
    """No hem of the cloth lies near the grasp point."""

    code = ErrorCode.NO_HEM


class TrackingError(CellError):
    """The robot did not follow the commanded trajectory."""

    code = ErrorCode.TRACKING


class GraspFailedError(CellError):
    """The gripper closed without cloth between its fingers."""

    code = ErrorCode.GRASP_FAILED


class SimulationError(CellError):
    """The simulation left the range in which its result means something."""

    code = ErrorCode.SIMULATION


def error_from_code(code: int, text: str) -> CellError:
    """Rebuild the error that a message carries, for the caller of a node to raise."""
    for kind in CellError.__subclasses__():
        if kind.code == code:
            return kind(text)
    return CellError(text)
