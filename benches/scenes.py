"""Scenes the benches share: landmarks in front of a camera, a guess 50 m and 5 degrees off."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SIGMA = 2e-5
"""1-sigma noise of a direction, rad."""
GUESS_OFFSET = 50.0, np.radians(5.0)
"""Distance (m) and angle (rad) of the first guess from the truth."""

FOCAL = 1000.0
"""Focal length of the peers' camera, pixels: what their tolerances are made for."""

RING = np.array([[32.5, 0.0, 0.0], [0.0, 30.0, 0.0], [-31.5, 0.0, 0.0], [0.0, -30.5, 0.0]])


@dataclass
class Scene:
    """One problem. ``dcm`` takes reference to camera components, the camera looks along +z."""

    landmarks: np.ndarray
    los: np.ndarray
    position: np.ndarray
    dcm: np.ndarray
    guess_position: np.ndarray
    guess_dcm: np.ndarray
    inliers: np.ndarray

    @property
    def guess(self):
        """``[position, mrp]``."""
        return np.concatenate([self.guess_position, mrp_from_dcm(self.guess_dcm)])

    @property
    def pixels(self):
        """Image points of a camera of focal length ``FOCAL``."""
        return np.ascontiguousarray(FOCAL * self.los[:, :2] / self.los[:, 2:])


def rotation(vector):
    """exp(-[v x]): reference to body components after the rotation vector v."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) - np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def mrp_from_dcm(dcm):
    """Modified Rodrigues parameters inside the unit ball."""
    # Shepperd: the largest of the four components of the quaternion is at least a half.
    k = np.array(
        [
            [dcm[0, 0] - dcm[1, 1] - dcm[2, 2], 0, 0, 0],
            [dcm[0, 1] + dcm[1, 0], dcm[1, 1] - dcm[0, 0] - dcm[2, 2], 0, 0],
            [dcm[0, 2] + dcm[2, 0], dcm[1, 2] + dcm[2, 1], dcm[2, 2] - dcm[0, 0] - dcm[1, 1], 0],
            [dcm[1, 2] - dcm[2, 1], dcm[2, 0] - dcm[0, 2], dcm[0, 1] - dcm[1, 0], np.trace(dcm)],
        ]
    )
    q = np.linalg.eigh(k, UPLO="L")[1][:, -1]
    q = q if q[3] >= 0 else -q
    return q[:3] / (1 + q[3])


def unit(rows):
    """Rows divided by their norms."""
    return rows / np.linalg.norm(rows, axis=-1, keepdims=True)


def scene(rng, n, *, sigma=SIGMA, outliers=0.0):
    """A lander 500 m above ``n`` landmarks of 30 m: the ring of four, the others about it, 10 % relief."""
    others = rng.uniform(-32, 32, (max(n - 4, 0), 3)) * [1, 1, 0.1]
    landmarks = np.ascontiguousarray(np.vstack([RING, others])[:n])
    position = np.array([0.0, 0.0, 500.0]) + rng.uniform(-60, 60, 3)
    # Look at the middle of the scene, any roll, a few degrees beside it.
    forward = unit(-position)
    right = unit(np.cross(forward, rng.standard_normal(3)))
    dcm = rotation(rng.uniform(-0.05, 0.05, 3)) @ np.stack([right, np.cross(forward, right), forward])
    los = unit((landmarks - position) @ dcm.T)
    los = unit(los + sigma * rng.standard_normal((n, 3))) if sigma else los
    inliers = np.ones(n, dtype=bool)
    inliers[rng.permutation(n)[: round(outliers * n)]] = False
    wrong = unit(rng.uniform(-1, 1, (n, 3)) * [0.1, 0.1, 0] + [0, 0, 1])
    los = np.ascontiguousarray(np.where(inliers[:, None], los, wrong))
    shift, turn = unit(rng.standard_normal((2, 3)))
    return Scene(
        landmarks,
        los,
        position,
        dcm,
        position + GUESS_OFFSET[0] * shift,
        rotation(GUESS_OFFSET[1] * turn) @ dcm,
        inliers,
    )


def scenes(n, count, *, seed=1, sigma=SIGMA, outliers=0.0):
    """``count`` scenes of ``n`` landmarks from one seed."""
    rng = np.random.default_rng(seed)
    return [scene(rng, n, sigma=sigma, outliers=outliers) for _ in range(count)]


def batch(n, count, *, seed=2):
    """Shared landmarks, ``(count, n, 3)`` directions, ``(count, 6)`` guesses and true poses."""
    rng = np.random.default_rng(seed)
    one = scene(rng, n, sigma=0.0)
    los = unit(one.los + SIGMA * rng.standard_normal((count, n, 3)))
    guess = np.empty((count, 6))
    shifts, turns = unit(rng.standard_normal((2, count, 3)))
    for k in range(count):
        guess[k, :3] = one.position + GUESS_OFFSET[0] * shifts[k]
        guess[k, 3:] = mrp_from_dcm(rotation(GUESS_OFFSET[1] * turns[k]) @ one.dcm)
    return one, los, guess


def angle_between(a, b):
    """Angle of the rotation between two direction cosine matrices, rad; NaN if one is missing."""
    if a is None or not np.all(np.isfinite(a)):
        return np.nan
    relative = a @ b.T
    skew = [relative[1, 2] - relative[2, 1], relative[2, 0] - relative[0, 2], relative[0, 1] - relative[1, 0]]
    return float(np.arctan2(np.linalg.norm(skew) / 2, (np.trace(relative) - 1) / 2))
