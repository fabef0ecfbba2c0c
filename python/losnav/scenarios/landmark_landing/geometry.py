"""Where pose from lines of sight fails: rank, danger cylinders, and poses that share their images.

The pose is locally unobservable exactly if some motion (w, v) ≠ 0 moves every landmark along its own line of
sight:

    (w × L_i + v) ∥ (L_i − p)   for every i.

Solved for the landmarks this is a cubic curve through the camera, L(μ) = ([w×] − μI)⁻¹ (−μp − v): any number
of landmarks on it leaves the rank at 5. Likewise two poses (p₁, A₁), (p₂, A₂) see the same directions of
every point of

    X(λ) = (A₁ − λA₂)⁻¹ (A₁p₁ − λA₂p₂),   λ > 0,

so four landmarks on it, coplanar or not, do not decide between the two however good the rank of each.

Both curves are computed here from scratch; ranks come from :func:`losnav.pose_observability`.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

import losnav as ln
from losnav.attitude import dcm_from_mrp, rotation_error
from losnav.scenarios.landmark_landing.descent import cross_matrix

__all__ = [
    "TwinPoses",
    "cylinder_distance",
    "danger_crossings",
    "pose_rank",
    "singular_landmarks",
    "twin_poses",
]

Array = NDArray[np.float64]


def pose_rank(landmarks: ArrayLike, position: ArrayLike) -> int:
    """Rank of the pose information that these landmarks give at this camera position."""
    return int(ln.pose_observability(np.asarray(landmarks, float), np.asarray(position, float)).rank)


def cylinder_distance(triple: Array, position: Array) -> Array:
    """Signed distance from the danger cylinder of three landmarks, m, negative inside; (3, 3), (..., 3) ->
    (...).

    The danger cylinder stands on the circle through the three landmarks, at right angles to their plane.
    """
    a, b = triple[1] - triple[0], triple[2] - triple[0]
    normal = np.cross(a, b)
    centre = triple[0] + np.cross((a @ a) * b - (b @ b) * a, normal) / (2 * normal @ normal)
    axis = normal / np.linalg.norm(normal)
    offset = position - centre
    across = offset - (offset @ axis)[..., None] * axis
    return np.asarray(np.linalg.norm(across, axis=-1) - np.linalg.norm(triple[0] - centre))


def danger_crossings(landmarks: Array, times: Array, position: Array) -> list[tuple[tuple[int, ...], float]]:
    """Times (s) at which a path crosses the danger cylinder of each three of the landmarks, by linear
    interpolation."""
    found: list[tuple[tuple[int, ...], float]] = []
    for triple in itertools.combinations(range(len(landmarks)), 3):
        distance = cylinder_distance(landmarks[list(triple)], position)
        for k in np.flatnonzero(distance[:-1] * distance[1:] < 0):
            share = distance[k] / (distance[k] - distance[k + 1])
            found.append((triple, float(times[k] + share * (times[k + 1] - times[k]))))
    return found


def singular_landmarks(position: Array, spin: Array, velocity: Array, parameters: Array) -> Array:
    """Landmarks that leave the pose of a camera at ``position`` unobservable, one for each parameter μ ≠ 0,
    (M,) -> (M, 3)."""
    system = cross_matrix(spin) - parameters[:, None, None] * np.eye(3)
    right = -parameters[:, None] * position - velocity
    return np.asarray(np.linalg.solve(system, right[..., None])[..., 0])


@dataclass(frozen=True)
class TwinPoses:
    """Two poses with identical images of the same four landmarks.

    Attributes
    ----------
    landmarks : (4, 3) array
        m; not coplanar.
    positions : (2, 3) array
        The two cameras, m.
    mrps : (2, 3) array
        Their attitudes.
    los_difference : float
        Largest difference between their lines of sight, rad.
    ranks : (int, int)
        Rank at each.
    volume : float
        Volume of the tetrahedron of landmarks relative to the cube of its longest edge (0 if coplanar).
    separation : (float, float)
        Distance between the two cameras, m, and angle between their attitudes, rad.
    solved : bool
        Whether ``solve_pose`` converges to each of the two, with zero residual, from a guess nearby.
    """

    landmarks: Array
    positions: Array
    mrps: Array
    los_difference: float
    ranks: tuple[int, int]
    volume: float
    separation: tuple[float, float]
    solved: bool

    @property
    def valid(self) -> bool:
        """Whether this disproves uniqueness: exact, observable, and not coplanar."""
        exact = self.los_difference < 1e-12 and self.separation[0] > 1.0
        return exact and self.ranks == (6, 6) and self.volume > 1e-3 and self.solved


def twin_poses(parameters: tuple[float, ...] = (0.3, 0.7, 1.5, 3.0)) -> TwinPoses:
    """Construct four landmarks that two different cameras see in the same directions."""
    positions = np.array([[-50.0, 50.0, 500.0], [160.0, -40.0, 430.0]])
    mrps = np.array([[0.09, -0.04, 0.03], [0.02, 0.10, -0.06]])
    first, second = dcm_from_mrp(mrps)
    landmarks = np.array(
        [
            np.linalg.solve(first - k * second, first @ positions[0] - k * second @ positions[1])
            for k in parameters
        ]
    )
    los = ln.predict_los(landmarks, positions, mrps)
    guess = np.concatenate([positions + np.array([1.0, -1.0, 1.0]), mrps + 1e-3], axis=-1)
    solution = ln.solve_pose(landmarks, los[0], sigma=1e-5, guess=guess)
    near = np.linalg.norm(solution.position - positions, axis=-1) < 1e-3
    edges = landmarks[1:] - landmarks[0]
    longest = max(np.linalg.norm(a - b) for a, b in itertools.combinations(landmarks, 2))
    turn = rotation_error(first, second)
    return TwinPoses(
        landmarks=landmarks,
        positions=positions,
        mrps=mrps,
        los_difference=float(np.abs(los[0] - los[1]).max()),
        ranks=(pose_rank(landmarks, positions[0]), pose_rank(landmarks, positions[1])),
        volume=float(abs(np.linalg.det(edges)) / 6 / longest**3),
        separation=(float(np.linalg.norm(positions[0] - positions[1])), float(np.linalg.norm(turn))),
        solved=bool(near.all() and np.all(solution.converged) and np.all(solution.chi2 < 1e-12)),
    )
