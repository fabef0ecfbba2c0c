"""Line-of-sight navigation: where am I, how am I oriented, and how well can I know it."""

import importlib
from typing import TYPE_CHECKING, Any

from losnav import attitude, constants, dynamics, ephemeris, gravity, noise, observability, sensors
from losnav._core import __version__
from losnav.attitude_determination import AttitudeSolution, solve_attitude, solve_attitude_robust
from losnav.ephemeris import Ephemeris
from losnav.errors import (
    DegenerateGeometryError,
    InvalidInputError,
    LosnavError,
    NumericalError,
    UnobservableError,
)
from losnav.navigation_state import NavState
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

if TYPE_CHECKING:
    from losnav import campaign, consistency, filters, landing, orbits, scenarios, star_tracker
    from losnav.filters import ExtendedKalmanFilter, FilterLog, PredictiveFilter, Step, UnscentedKalmanFilter

# Imported when first asked for: solving poses needs none of them.
_LATER = ("campaign", "consistency", "filters", "landing", "orbits", "scenarios", "star_tracker")
_LATER_FROM = dict.fromkeys(
    ("ExtendedKalmanFilter", "FilterLog", "PredictiveFilter", "Step", "UnscentedKalmanFilter"), "filters"
)

__all__ = [
    "AttitudeSolution",
    "DegenerateGeometryError",
    "Ephemeris",
    "ExtendedKalmanFilter",
    "FilterLog",
    "InvalidInputError",
    "LosnavError",
    "NavState",
    "NumericalError",
    "Observability",
    "PoseObservability",
    "PoseSolution",
    "PredictiveFilter",
    "Step",
    "Termination",
    "UnobservableError",
    "UnscentedKalmanFilter",
    "__version__",
    "attitude",
    "campaign",
    "consistency",
    "constants",
    "dynamics",
    "ephemeris",
    "filters",
    "fisher_information",
    "gravity",
    "landing",
    "los_jacobian",
    "noise",
    "observability",
    "orbits",
    "pose_observability",
    "predict_los",
    "scenarios",
    "sensors",
    "solve_attitude",
    "solve_attitude_robust",
    "solve_pose",
    "solve_pose_robust",
    "star_tracker",
]


def __getattr__(name: str) -> Any:
    if name in _LATER:
        return importlib.import_module(f"losnav.{name}")
    if name in _LATER_FROM:
        return getattr(importlib.import_module(f"losnav.{_LATER_FROM[name]}"), name)
    raise AttributeError(f"module 'losnav' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *_LATER, *_LATER_FROM})
