"""The guided descent to the landing site and what the camera sees on the way.

Position and attitude follow cubic Hermite curves from the published initial state to rest at the origin:

    x(t) = (2s³ − 3s² + 1) x₀ + (s³ − 2s² + s) T ẋ₀,    s = t/T

for the position from (p₀, v₀) and for the MRP from (σ₀, ¼ B(σ₀) ω₀). The publication gives the initial state
and the duration but not the path between; constant v₀ would end at 414 m. The accuracy of a pose depends on
the position alone, so figures of another guidance law compare at equal altitude.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from losnav.attitude import dcm_from_mrp

__all__ = ["Descent", "cross_matrix", "focal_plane_covariance", "perturb_los", "rotation_from_vector"]

Array = NDArray[np.float64]

# A pinhole image runs to infinity as a LOS approaches the image plane, and focal-plane noise then means less
# and less angle. The ideal camera without a field-of-view limit keeps the noise of a LOS this far off its
# axis for all LOS beyond.
_MAX_OFF_AXIS = np.radians(80.0)


@dataclass(frozen=True)
class Descent:
    """True motion and geometry at given times.

    Attributes
    ----------
    landmarks : (N, 3) array
        Landmarks in the site frame, m.
    times : (T,) array
        Epochs, s.
    duration : float
        Time of touchdown, s.
    start : (4, 3) array
        Initial position (m), velocity (m/s), MRP and body rate (rad/s).
    """

    landmarks: Array
    times: Array
    duration: float
    start: Array

    @cached_property
    def _hermite(self) -> tuple[Array, Array]:
        s = self.times[:, None] / self.duration
        return (2 * s - 3) * s * s + 1, ((s - 2) * s + 1) * s * self.duration

    @cached_property
    def position(self) -> Array:
        """Camera position in the site frame, m, (T, 3)."""
        value, slope = self._hermite
        return np.asarray(value * self.start[0] + slope * self.start[1])

    @cached_property
    def mrp(self) -> Array:
        """Attitude (camera from site) as MRP, (T, 3)."""
        value, slope = self._hermite
        sigma, rate = self.start[2], self.start[3]
        # dσ/dt = ¼ B(σ) ω with B = (1 − σ'σ) I + 2 [σ×] + 2 σσ'
        b_matrix = (1 - sigma @ sigma) * np.eye(3) + 2 * cross_matrix(sigma) + 2 * np.outer(sigma, sigma)
        return np.asarray(value * sigma + slope * (b_matrix @ rate / 4))

    @cached_property
    def dcm(self) -> Array:
        """Attitude (camera from site), (T, 3, 3)."""
        return np.asarray(dcm_from_mrp(self.mrp))

    @property
    def altitude(self) -> Array:
        """Height above the landing site, m, (T,)."""
        return self.position[:, 2]

    @cached_property
    def los(self) -> Array:
        """True lines of sight in camera axes, (T, N, 3)."""
        offset = self.landmarks - self.position[:, None, :]
        unit = offset / np.linalg.norm(offset, axis=-1, keepdims=True)
        return np.asarray(np.einsum("tij,tnj->tni", self.dcm, unit))

    @cached_property
    def off_axis(self) -> Array:
        """Angle of each landmark from the optical axis −z, rad, (T, N)."""
        return np.asarray(np.arctan2(np.linalg.norm(self.los[..., :2], axis=-1), -self.los[..., 2]))

    def nav_off(self, half_fov: float, least: int) -> int:
        """First epoch from which fewer than ``least`` landmarks are within ``half_fov`` (rad); ``T`` if there
        is none."""
        seen = np.count_nonzero(self.off_axis <= half_fov, axis=1)
        lost = np.flatnonzero(seen < least)
        return int(lost[0]) if lost.size else len(self.times)


def cross_matrix(a: Array) -> Array:
    """Matrix [a×] of the cross product, (3,) -> (3, 3)."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def rotation_from_vector(angle: Array) -> Array:
    """Rotation matrix exp(−[a×]) of a rotation vector in body axes, rad, (..., 3) -> (..., 3, 3).

    Its MRP is ``e tan(φ/4)``, so ``rotation_from_vector(a) @ dcm`` is the attitude turned by ``a`` about its
    own axes.
    """
    size = np.linalg.norm(angle, axis=-1, keepdims=True)
    # tan(φ/4)/φ → 1/4; below 1e-8 rad the next term, φ²/192, is under one part in 10¹⁶.
    ratio = np.where(size > 1e-8, np.tan(size / 4) / np.where(size > 1e-8, size, 1.0), 0.25)
    return np.asarray(dcm_from_mrp(ratio * angle))


def focal_plane_factor(los: Array, focal_length: float) -> Array:
    """Derivative of a unit LOS by its focal-plane coordinates along and across the radius, 1/m.

    (..., 3) -> (..., 3, 2): at the angle θ off axis, a step on the focal plane turns the LOS by cos²θ/f along
    the radius and by cos θ/f across it.
    """
    radius = np.linalg.norm(los[..., :2], axis=-1, keepdims=True)
    # On the axis every direction is radial; any will do.
    unit = np.where(radius > 1e-12, los[..., :2] / np.where(radius > 1e-12, radius, 1.0), [1.0, 0.0])
    across = np.stack([-unit[..., 1], unit[..., 0], np.zeros(unit.shape[:-1])], axis=-1)
    along = np.cross(across, los)
    depth = np.maximum(np.abs(los[..., 2, None]), np.cos(_MAX_OFF_AXIS))
    return np.stack([depth**2 * along, depth * across], axis=-1) / focal_length


def focal_plane_covariance(los: Array, focal_length: float, sigma: float) -> Array:
    """Covariance of LOS with white focal-plane noise, rad², rank 2, (..., 3) -> (..., 3, 3).

    The model of :func:`losnav.noise.focal_plane`, held constant far off axis.
    """
    factor = sigma * focal_plane_factor(los, focal_length)
    return np.asarray(factor @ np.swapaxes(factor, -1, -2))


def perturb_los(los: Array, noise: Array, model: str, focal_length: float, sigma: float) -> Array:
    """Add measurement noise and return unit vectors.

    ``noise`` (..., 3) is standard normal. "tangent" tilts the LOS by ``sigma/focal_length`` rad in every
    direction across it; "focal-plane" moves the image point by ``sigma`` metres along both axes.
    """
    if model == "tangent":
        moved = los + sigma / focal_length * noise
    else:
        factor = focal_plane_factor(los, focal_length)
        moved = los + sigma * np.einsum("...ij,...j->...i", factor, noise[..., :2])
    return np.asarray(moved / np.linalg.norm(moved, axis=-1, keepdims=True))
