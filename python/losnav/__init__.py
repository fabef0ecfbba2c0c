"""Line-of-sight navigation: where am I, how am I oriented, and how well can I know it."""

from losnav import attitude, dynamics, noise, observability, sensors
from losnav._core import __version__
from losnav.errors import (
    DegenerateGeometryError,
    InvalidInputError,
    LosnavError,
    NumericalError,
    UnobservableError,
)
from losnav.observability import Observability, PoseObservability, pose_observability
from losnav.pose import (
    PoseSolution,
    Termination,
    fisher_information,
    los_jacobian,
    predict_los,
    solve_pose,
    solve_pose_robust,
)

__all__ = [
    "DegenerateGeometryError",
    "InvalidInputError",
    "LosnavError",
    "NumericalError",
    "Observability",
    "PoseObservability",
    "PoseSolution",
    "Termination",
    "UnobservableError",
    "__version__",
    "attitude",
    "dynamics",
    "fisher_information",
    "los_jacobian",
    "noise",
    "observability",
    "pose_observability",
    "predict_los",
    "sensors",
    "solve_pose",
    "solve_pose_robust",
]
