"""Accuracy against the angle between the heads: the figures a tracker is laid out by.

Head 1 looks along fusion z. ``t`` is the angle that is swept.

symmetric   every pair of heads is ``t`` apart, 0 to 120 degrees for three; ``z2``, ``z3`` at azimuths
            ``45 deg -+ psi/2``, ``cos psi = cos t / (1 + cos t)``: x and y are treated alike, and at 90
            degrees ``z2 = x``, ``z3 = y``. Two heads: ``z2`` at azimuth 45 degrees.
asymmetric  ``z1`` and ``z2`` a fixed angle apart (43 degrees), ``z2`` towards x; ``z3`` at ``t`` from both.

For identical axisymmetric heads ``s^2 diag(1, 1, k^2)``, ``c = 1 - 1/k^2``, in the axes of head 1:

    sigma_z^2/s^2 = (1 + 2 cos t)/3 / (3 - c (1 + 2 cos t)) + (2 - 2 cos t)/3 / (3 - c (1 - cos t))    (T3)
    at 90 degrees  sigma_x = sigma_y = sigma_z = s / sqrt(2 + 1/k^2)                                   (T4)
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, finite, rotations
from losnav._arrays import covariances as checked_covariances
from losnav.errors import InvalidInputError
from losnav.star_tracker._rotation import mounting_of
from losnav.star_tracker.covariance import fused_covariance

__all__ = ["SeparationSweep", "separation_boresights", "separation_sweep"]

Geometry: TypeAlias = Literal["symmetric", "asymmetric"]
Frame: TypeAlias = "int | Literal['symmetry'] | ArrayLike"
# The paper's angle between heads 1 and 2 of the asymmetric geometry.
SEPARATION = float(np.radians(43.0))
# Rounding of an angle given as a limit of the range, rad.
EDGE = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class SeparationSweep:
    """Fused covariance over the angle between heads; every array has the shape ``(...)`` of the angles.

    Attributes
    ----------
    angles : (...)
        The angle swept, rad.
    mountings : (..., N, 3, 3)
        Fusion from head: head 1 looks along fusion z, the others are turned there the short way.
    covariance : (..., 3, 3)
        Of the fused attitude, rad^2, in the axes of ``frame``.
    """

    angles: FloatArray
    mountings: FloatArray
    covariance: FloatArray

    @property
    def boresights(self) -> FloatArray:
        """Optical axes in fusion axes, ``(..., N, 3)``."""
        return self.mountings[..., 2]

    @property
    def sigma(self) -> FloatArray:
        """1-sigma about each axis, ``(..., 3)``, rad."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance, axis1=-2, axis2=-1)))

    @property
    def trace(self) -> FloatArray:
        """Sum of the variances, ``(...)``, rad^2: the same in every frame."""
        return np.asarray(np.trace(self.covariance, axis1=-2, axis2=-1))

    @property
    def worst(self) -> FloatArray:
        """1-sigma about the weakest axis of all, ``(...)``, rad."""
        return np.asarray(np.sqrt(np.linalg.eigvalsh(self.covariance)[..., -1]))

    @property
    def determinant(self) -> FloatArray:
        """Product of the principal variances, ``(...)``, rad^6."""
        return np.asarray(np.prod(np.linalg.eigvalsh(self.covariance), axis=-1))

    def best(self, measure: str = "trace") -> float:
        """Angle with the least ``"x"``, ``"y"``, ``"z"``, ``"trace"``, ``"worst"`` or ``"determinant"``, rad.

        Parameters
        ----------
        measure : str
            What to make small.

        Returns
        -------
        float
            One of ``angles``.

        Raises
        ------
        InvalidInputError
            On another measure, or without angles.
        """
        if measure in ("x", "y", "z"):
            values = self.sigma[..., "xyz".index(measure)]
        elif measure in ("trace", "worst", "determinant"):
            values = getattr(self, measure)
        else:
            raise InvalidInputError(
                f'measure: expected "x", "y", "z", "trace", "worst" or "determinant", got {measure!r}'
            )
        if not values.size:
            raise InvalidInputError("angles: expected at least one angle to choose from, got none")
        return float(np.ravel(self.angles)[np.argmin(values)])

    def __repr__(self) -> str:
        degrees, count = np.degrees(self.angles), self.mountings.shape[-3]
        span = f" from {degrees.min():.1f} to {degrees.max():.1f} deg" if degrees.size else ""
        return f"SeparationSweep({count} heads, {degrees.size} angles{span})"


def separation_boresights(
    angles: ArrayLike, count: int = 3, geometry: Geometry = "symmetric", separation: float = SEPARATION
) -> FloatArray:
    """Boresights of the geometries of a :func:`separation_sweep`.

    Parameters
    ----------
    angles : (...)
        Swept angle, rad. Symmetric: 0 to 120 degrees for three heads, 0 to 180 for two. Asymmetric:
        ``separation / 2`` to 180 degrees less that.
    count : int
        Number of heads: 2 or 3 for the symmetric geometry, 3 for the asymmetric one.
    geometry : {"symmetric", "asymmetric"}
        See the module.
    separation : float
        Angle between heads 1 and 2 of the asymmetric geometry, rad.

    Returns
    -------
    (..., count, 3)
        Unit vectors in fusion axes.

    Raises
    ------
    InvalidInputError
        On an angle out of range, or a geometry that is not one for so many heads.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> ln.star_tracker.separation_boresights(np.pi / 2).round(12) + 0.0
    array([[0., 0., 1.],
           [1., 0., 0.],
           [0., 1., 0.]])
    """
    t = finite(angles, "angles")
    if geometry == "symmetric":
        if count not in (2, 3):
            raise InvalidInputError(
                f"geometry: expected 2 or 3 heads for equal angles between all pairs, got {count}"
            )
        _range(t, 0.0, np.pi if count == 2 else 2 * np.pi / 3)
        return _symmetric(t, count)
    if geometry == "asymmetric":
        if count != 3:
            raise InvalidInputError(f"geometry: expected 3 heads for the asymmetric geometry, got {count}")
        apart = finite(separation, "separation")
        if apart.ndim or not 0.0 < apart < np.pi:
            raise InvalidInputError(f"separation: expected an angle in (0, pi) rad, got {separation}")
        _range(t, 0.5 * float(apart), np.pi - 0.5 * float(apart))
        return _asymmetric(t, float(apart))
    raise InvalidInputError(f'geometry: expected "symmetric" or "asymmetric", got {geometry!r}')


def separation_sweep(
    covariances: ArrayLike,
    angles: ArrayLike,
    geometry: Geometry = "symmetric",
    *,
    separation: float = SEPARATION,
    frame: Frame = 0,
) -> SeparationSweep:
    """Fused covariance (X17) over the angle between the heads, in one of two geometries.

    Parameters
    ----------
    covariances : (N, 3, 3)
        Attitude covariance of each head in its own axes, rad^2.
    angles : (...)
        Swept angle, rad; the range is that of :func:`separation_boresights`.
    geometry : {"symmetric", "asymmetric"}
        All pairs at the same angle, or heads 1 and 2 at a fixed ``separation`` and head 3 at ``angles`` from
        both.
    separation : float
        Angle between heads 1 and 2 of the asymmetric geometry, rad; 43 degrees.
    frame : int, "symmetry" or (3, 3)
        Axes in which the covariance is given: those of a head (0, the first, is the fusion frame), with z on
        the axis at equal angles from the three boresights, or a rotation ``frame_from_fusion``. The trace
        does not depend on it, which angle is best for an axis does.

    Returns
    -------
    SeparationSweep
        ``sigma (..., 3)`` in rad, ``covariance``, ``mountings``, ``trace``, ``worst``, ``best("z")``.

    Raises
    ------
    InvalidInputError
        On bad covariances, angles out of range, or an unknown geometry or frame.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> head = np.diag([2.5, 2.5, 17.5]) ** 2                              # any unit: here arcsec^2
    >>> sweep = ln.star_tracker.separation_sweep([head] * 3, np.radians([30, 60, 90, 120]))
    >>> sweep.sigma.round(3)
    array([[1.716, 1.716, 4.216],
           [1.754, 1.754, 2.198],
           [1.759, 1.759, 1.759],
           [1.756, 1.756, 2.021]])
    >>> round(np.degrees(sweep.best("z")))
    90
    """
    p = checked_covariances(covariances, "covariances")
    if p.ndim != 3:
        raise InvalidInputError(f"covariances: expected shape (N, 3, 3), got {p.shape}")
    t = finite(angles, "angles")
    boresights = separation_boresights(t, len(p), geometry, separation)
    mountings = mounting_of(boresights)
    turned = _frame(frame, mountings)
    fused = turned @ fused_covariance(p, mountings) @ np.swapaxes(turned, -1, -2)
    return SeparationSweep(t, mountings, 0.5 * (fused + np.swapaxes(fused, -1, -2)))


def _symmetric(t: FloatArray, count: int) -> FloatArray:
    cosine = np.cos(t)
    if count == 3:
        psi = np.arccos(np.clip(cosine / (1.0 + cosine), -1.0, 1.0))
        azimuths = [np.pi / 4 - psi / 2, np.pi / 4 + psi / 2]
    else:
        azimuths = [np.full_like(t, np.pi / 4)]
    first = np.broadcast_to([0.0, 0.0, 1.0], (*t.shape, 3))
    others = [np.stack([np.sin(t) * np.cos(a), np.sin(t) * np.sin(a), cosine], axis=-1) for a in azimuths]
    return np.stack([first, *others], axis=-2)


def _asymmetric(t: FloatArray, apart: float) -> FloatArray:
    first = np.array([0.0, 0.0, 1.0])
    second = np.array([np.sin(apart), 0.0, np.cos(apart)])
    # In the plane of the first two, and across it.
    inside = np.cos(t) / np.cos(0.5 * apart)
    across = np.sqrt(np.maximum(1.0 - inside**2, 0.0))
    middle = np.array([np.sin(0.5 * apart), 0.0, np.cos(0.5 * apart)])
    third = inside[..., np.newaxis] * middle + across[..., np.newaxis] * np.array([0.0, 1.0, 0.0])
    return np.stack(np.broadcast_arrays(first, second, third), axis=-2)


def _range(t: FloatArray, low: float, high: float) -> None:
    bad = (t < low - EDGE) | (t > high + EDGE)
    if bad.any():
        index = tuple(int(i) for i in np.argwhere(bad)[0])
        raise InvalidInputError(
            f"angles{list(index) or ''}: expected {np.degrees(low):.2f} to {np.degrees(high):.2f} deg, given "
            f"in rad, got {t[index]:.6g} rad = {np.degrees(t[index]):.2f} deg"
        )


def _frame(frame: Frame, mountings: FloatArray) -> FloatArray:
    """``frame_from_fusion``."""
    count = mountings.shape[-3]
    if isinstance(frame, str):
        if frame != "symmetry":
            raise InvalidInputError(
                f'frame: expected a head\'s number, "symmetry" or a rotation, got {frame!r}'
            )
        return np.swapaxes(mounting_of(_symmetry_axis(mountings[..., 2])), -1, -2)
    if isinstance(frame, int | np.integer) and not isinstance(frame, bool):
        if not 0 <= frame < count:
            raise InvalidInputError(f"frame: expected a head from 0 to {count - 1}, got {frame}")
        return np.swapaxes(mountings[..., int(frame), :, :], -1, -2)
    return rotations(frame, "frame")


def _symmetry_axis(boresights: FloatArray) -> FloatArray:
    """At equal angles from all boresights: their mean, or the normal of their plane where that vanishes."""
    mean = boresights.sum(axis=-2)
    if boresights.shape[-2] == 2:
        normal = np.broadcast_to([0.0, 0.0, 1.0], mean.shape)
        size = np.linalg.norm(mean, axis=-1, keepdims=True)
        return np.asarray(np.where(size > EDGE, mean, normal))
    a, b, c = np.moveaxis(boresights, -2, 0)
    normal = np.cross(a, b) + np.cross(b, c) + np.cross(c, a)
    size = np.linalg.norm(normal, axis=-1, keepdims=True)
    return np.asarray(np.where(size > EDGE, normal, mean))
