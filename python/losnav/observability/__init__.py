"""What can be known: rank, the directions that are weak or lost, and for a pose the geometry by its name.

:func:`analyze` and :func:`degree` take any matrix whose columns are state components (a stacked Jacobian, a
Lie matrix, the square root of a Gramian); :func:`pose_observability` builds that matrix for a pose from lines
of sight and says in words what is weak. ``PoseSolution.observability`` is the same for a solved pose.
"""

from losnav.observability.bound import crlb
from losnav.observability.empirical import empirical_gramian
from losnav.observability.information import (
    estimation_condition,
    gramian,
    horizon_weighted,
    unobservability_index,
)
from losnav.observability.lie import lie_matrix
from losnav.observability.matrix import Observability, analyze, degree
from losnav.observability.pose import Diagnosis, PoseObservability, of_pose_solution, pose_observability
from losnav.observability.units import canonical_units, state_labels

__all__ = [
    "Diagnosis",
    "Observability",
    "PoseObservability",
    "analyze",
    "canonical_units",
    "crlb",
    "degree",
    "empirical_gramian",
    "estimation_condition",
    "gramian",
    "horizon_weighted",
    "lie_matrix",
    "of_pose_solution",
    "pose_observability",
    "state_labels",
    "unobservability_index",
]
