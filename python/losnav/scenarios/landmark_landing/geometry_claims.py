"""Claims 7 and 8: ranks of the pose problem, what makes it singular, and when the pose is unique."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from losnav.scenarios.landmark_landing.descent import Descent
from losnav.scenarios.landmark_landing.geometry import (
    cylinder_distance,
    pose_rank,
    singular_landmarks,
    twin_poses,
)
from losnav.scenarios.verdicts import Claim, Verdict

if TYPE_CHECKING:
    from losnav.scenarios.landmark_landing import LandmarkLanding

__all__ = ["geometry_claims"]

Array = NDArray[np.float64]

_CASES = 20  # random camera positions for each rank


def geometry_claims(scenario: LandmarkLanding) -> list[Claim]:
    """Claims 7 and 8, from constructions solved on the spot."""
    return [*_ranks(scenario), *_singular(scenario), _twins(), _planar(scenario.descent)]


def _cameras(scenario: LandmarkLanding) -> Array:
    """Random positions above the landing site."""
    return np.random.default_rng(7).uniform((-150.0, -150.0, 50.0), (150.0, 150.0, 500.0), size=(_CASES, 3))


def _rank_claim(  # noqa: PLR0917
    number: str, statement: str, printed: str, cases: list[tuple[Array, Array]], expected: int, why: str
) -> Claim:
    """A claim that all the cases (landmarks, camera) have the expected rank."""
    ranks = sorted({pose_rank(landmarks, camera) for landmarks, camera in cases})
    verdict: Verdict = "holds" if ranks == [expected] else "does not"
    text = f"rank {', '.join(map(str, ranks))} in {len(cases)} case{'s' if len(cases) > 1 else ''}"
    value = float(ranks[-1])
    established: Verdict = "holds" if number in "7a 7b 7c 7d" else "does not"
    return Claim(
        number=number,
        statement=statement,
        printed=printed,
        ours=text,
        value=value,
        interval=(float(ranks[0]), value),
        confidence=1.0,
        verdict=verdict,
        why=why,
        established=established,
    )


def _ranks(scenario: LandmarkLanding) -> list[Claim]:
    landmarks, cameras = scenario.descent.landmarks, _cameras(scenario)
    line = np.array([[-30.0, 0.0, 0.0], [5.0, 0.0, 0.0], [40.0, 0.0, 0.0]])
    why = "Random cameras above the site; rank of the Jacobian with position scaled by the range."
    return [
        _rank_claim("7a", "One landmark gives rank 2", "2", [(landmarks[:1], c) for c in cameras], 2, why),
        _rank_claim("7b", "Two landmarks give rank 4", "4", [(landmarks[:2], c) for c in cameras], 4, why),
        _rank_claim(
            "7c",
            "Three landmarks in general position give rank 6",
            "≤ 6",
            [(landmarks[:3], c) for c in cameras],
            6,
            why,
        ),
        _rank_claim(
            "7d",
            "Three collinear landmarks are singular",
            "< 6",
            [(line, c) for c in cameras],
            5,
            "The rotation about their line cannot be seen.",
        ),
    ]


def _singular(scenario: LandmarkLanding) -> list[Claim]:
    triple = scenario.descent.landmarks[:3]
    on_cylinder = [_onto_cylinder(triple, camera) for camera in _cameras(scenario)]
    miss = max(abs(float(cylinder_distance(triple, camera))) for camera in on_cylinder)
    camera = np.array([-50.0, 50.0, 500.0])
    curve = singular_landmarks(
        camera,
        np.array([0.01, -0.02, 0.015]),
        np.array([1.0, 2.0, -0.5]),
        np.array([-0.05, -0.03, 0.01, 0.02, 0.04, 0.06]),
    )
    return [
        _rank_claim(
            "7e",
            "Three landmarks are singular only if they are collinear",
            "only then",
            [(triple, camera) for camera in on_cylinder],
            6,
            "Cameras on the danger cylinder, the circle through the three landmarks raised at right angles "
            f"to their plane (within {miss:.0e} m), see three landmarks that are not collinear and have "
            "rank 5.",
        ),
        _rank_claim(
            "7f",
            "Four or more landmarks are singular only if they are collinear",
            "only then",
            [(curve[:count], camera) for count in (4, 5, 6)],
            6,
            "Landmarks on a cubic curve through the camera, constructed so that one motion moves each "
            "along its own line of sight: 4, 5 and 6 of them, not coplanar, have rank 5.",
        ),
    ]


def _onto_cylinder(triple: Array, camera: Array) -> Array:
    """Move a camera at right angles to the axis of the danger cylinder until it lies on it."""
    a, b = triple[1] - triple[0], triple[2] - triple[0]
    normal = np.cross(a, b)
    centre = triple[0] + np.cross((a @ a) * b - (b @ b) * a, normal) / (2 * normal @ normal)
    axis = normal / np.linalg.norm(normal)
    along = ((camera - centre) @ axis) * axis
    across = camera - centre - along
    return np.asarray(centre + along + across / np.linalg.norm(across) * np.linalg.norm(triple[0] - centre))


def _twins() -> Claim:
    twins = twin_poses()
    distance, angle = twins.separation
    where = " and ".join(f"({x:.0f}, {y:.0f}, {z:.0f})" for x, y, z in twins.positions)
    marks = ", ".join(f"({x:.1f}, {y:.1f}, {z:.1f})" for x, y, z in twins.landmarks)
    return Claim(
        number="8a",
        statement="Four or more landmarks and rank 6 make the pose unique",
        printed="unique",
        ours=f"two exact poses {distance:.0f} m and {np.degrees(angle):.0f} deg apart, lines of sight equal "
        f"to {twins.los_difference:.0e}",
        value=distance,
        interval=(distance, distance),
        confidence=1.0,
        verdict="does not" if twins.valid else "ambiguous",
        why=f"Cameras at {where} m see the landmarks {marks} m in the same directions; ranks "
        f"{twins.ranks[0]} and {twins.ranks[1]}, not coplanar, and the solver converges to either with zero "
        "residual.",
        established="does not",
    )


def _planar(descent: Descent) -> Claim:
    """The homography of coplanar landmarks is unique if its linear system has rank 8."""
    above = descent.altitude > 1e-9
    ground = descent.landmarks[:, :2] / np.abs(descent.landmarks[:, :2]).max()
    plane = np.column_stack([ground, np.ones(len(ground))])
    flat = float(np.ptp(descent.landmarks[:, 2]))
    singular = []
    for los in descent.los[above]:
        # b × (H m) = 0 for every landmark m = (X, Y, 1): three equations each, linear in the nine entries of
        # H.
        rows = [np.kron(_cross(b), m) for b, m in zip(los, plane, strict=True)]
        values = np.linalg.svd(np.concatenate(rows), compute_uv=False)
        singular.append(values[7] / values[0])
    full = float(np.mean(np.array(singular) > 1e-9)) if flat == 0.0 else np.nan
    return Claim(
        number="8b",
        statement="The pose from the four coplanar landmarks of this site is unique",
        printed="unique",
        ours=f"homography unique at {full:.0%} of the epochs above ground",
        value=full,
        interval=(full, full),
        confidence=1.0,
        verdict="ambiguous" if np.isnan(full) else "holds" if full == 1.0 else "does not",
        why="Its linear system has rank 8 of 9 (smallest of the eight scaled singular values "
        f"{min(singular):.1e}), so one homography and one pose in front of the landmarks fit.",
        established="holds",
    )


def _cross(a: Array) -> Array:
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])
