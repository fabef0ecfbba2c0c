"""Where N heads should look.

For axisymmetric heads ``P_n = s_n^2 diag(1, 1, k_n^2)``, ``w_n = 1/s_n^2``, ``c_n = 1 - 1/k_n^2``:

    F = sum_n w_n (I - c_n z_n z_n')                                                      (T5)

``tr F`` does not depend on the boresights ``z_n``. Trace, determinant and largest eigenvalue of ``P =
F^-1`` are Schur-convex in the spectrum of ``F``: the more even, the better, and none can beat

    tr P >= 9 / tr F,   det P >= (3 / tr F)^3,   lambda_max(P) >= 3 / tr F                (T6)

For equal heads the bound is reached where ``sum z z' = (N/3) I``, a tight frame: right angles for two and
three heads (two cannot reach it), and for any ``N >= 3`` heads evenly around a cone of half-angle
acos(1/sqrt 3) = 54.74 degrees, of which three orthogonal heads are the first case. "90 degrees apart" is no
rule for four or more. A boresight may be reversed: ``z`` and ``-z`` inform alike.

Cones that must stay free of boresights (Sun, Earth, structure) are constraints: the search is a projected
gradient descent on the spheres from many random starts. Leaves out: fields that block each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, positive, vectors
from losnav.errors import DegenerateGeometryError, InvalidInputError
from losnav.star_tracker._rotation import mounting_of, unit
from losnav.star_tracker.covariance import in_scale
from losnav.star_tracker.field import whole

__all__ = ["Layout", "optimal_layout", "tight_frame"]

Criterion: TypeAlias = Literal["trace", "determinant", "worst"]
# Cost is tr(P^p): the volume, the trace, and nearly the largest eigenvalue.
POWER = {"determinant": 0, "trace": 1, "worst": 12}
STARTS, ITERATIONS, SAMPLES, SWEEPS = 24, 3000, 20_000, 200
# Boresights closer to a cone than this may be inside it by rounding, rad.
EDGE = 1e-9


@dataclass(frozen=True, eq=False)
class Layout:
    """Boresights of N heads and what they achieve.

    Attributes
    ----------
    boresights : (N, 3)
        Unit vectors in fusion axes.
    covariance : (3, 3)
        Of the fused attitude, in the square of the unit of ``sigma``, fusion axes.
    value : float
        Of the criterion.
    bound : float
        What no layout of these heads can beat (T6).
    clearance : (N,)
        Angle from each boresight to the nearest edge of an excluded cone, rad; infinite without cones.
    """

    boresights: FloatArray
    covariance: FloatArray
    value: float
    bound: float
    clearance: FloatArray

    @property
    def mountings(self) -> FloatArray:
        """Fusion from head, ``(N, 3, 3)``: +z turned to each boresight the short way."""
        return mounting_of(self.boresights)

    @property
    def efficiency(self) -> float:
        """``bound / value``, in (0, 1]; 1 is a layout that cannot be improved."""
        return self.bound / self.value

    @property
    def sigma(self) -> FloatArray:
        """1-sigma about the fusion axes, ``(3,)``."""
        return np.asarray(np.sqrt(np.diag(self.covariance)))


def tight_frame(count: int) -> FloatArray:
    """Boresights for equal heads without constraints: the best there are, in closed form.

    One: along z. Two: z and x. Three: z, x and y. Four: a tetrahedron. Six: the diagonals of an
    icosahedron. Any other number: evenly around a cone of half-angle 54.74 degrees about z.

    Parameters
    ----------
    count : int
        Number of heads.

    Returns
    -------
    (count, 3)
        Unit vectors; from three on ``sum z z' = (count / 3) I``.

    Raises
    ------
    InvalidInputError
        If ``count`` is not a positive whole number.

    Examples
    --------
    >>> import losnav as ln
    >>> z = ln.star_tracker.tight_frame(5)
    >>> (z.T @ z).round(12) + 0.0
    array([[1.66666667, 0.        , 0.        ],
           [0.        , 1.66666667, 0.        ],
           [0.        , 0.        , 1.66666667]])
    """
    number = whole(count, "count", 1)
    if number <= 3:
        return np.asarray(np.eye(3)[[2, 0, 1]][:number])
    if number == 4:
        return unit(np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]))
    if number == 6:
        golden = 0.5 * (1.0 + np.sqrt(5.0))
        axes = [
            [0, 1, golden],
            [0, -1, golden],
            [golden, 0, 1],
            [golden, 0, -1],
            [1, golden, 0],
            [-1, golden, 0],
        ]
        return unit(np.array(axes))
    turn = 2 * np.pi * np.arange(number) / number
    flat = np.stack([np.cos(turn), np.sin(turn)], axis=1) * np.sqrt(2.0 / 3.0)
    return np.concatenate([flat, np.full((number, 1), np.sqrt(1.0 / 3.0))], axis=1)


def optimal_layout(
    count: int,
    *,
    sigma: ArrayLike = 1.0,
    ratio: ArrayLike = 7.0,
    exclusions: Sequence[tuple[ArrayLike, float]] = (),
    criterion: Criterion = "trace",
    seed: int = 0,
) -> Layout:
    """Boresights for N heads, equal or not, that keep clear of the Sun, the Earth and the structure.

    Parameters
    ----------
    count : int
        Number of heads, at least 2.
    sigma : scalar or (count,)
        1-sigma of each head across its boresight, any unit.
    ratio : scalar or (count,)
        1-sigma about the boresight over that across it, at least 1 (:func:`boresight_ratio`).
    exclusions : sequence of (direction (3,), half-angle)
        Cones that no boresight may enter: direction in fusion axes, half-angle in rad, in (0, pi). Include
        half the head's field and the baffle's angle in it.
    criterion : {"trace", "determinant", "worst"}
        Of the fused covariance.
    seed : int
        Of the random starts.

    Returns
    -------
    Layout

    Raises
    ------
    InvalidInputError
        On bad arguments.
    DegenerateGeometryError
        If the cones leave no room.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> free = ln.star_tracker.optimal_layout(4, sigma=2.5)
    >>> free.sigma.round(3), round(free.efficiency, 6)
    (array([1.523, 1.523, 1.523]), 1.0)

    Three heads, 100 degrees clear of the nadir (-z) and 45 degrees of the Sun:

    >>> cones = [([0, 0, -1], np.radians(100)), ([1, 0, 0.3], np.radians(45))]
    >>> layout = ln.star_tracker.optimal_layout(3, sigma=2.5, exclusions=cones)
    >>> bool((layout.clearance > -1e-9).all()), round(layout.efficiency, 3)
    (True, 1.0)
    """
    number = whole(count, "count", 2)
    weight = _per_head(sigma, number, "sigma") ** -2.0
    ratios = _per_head(ratio, number, "ratio")
    if not (ratios >= 1.0).all():
        raise InvalidInputError(f"ratio: expected at least 1, got {ratios.min():g}")
    if criterion not in POWER:
        raise InvalidInputError(f'criterion: expected "trace", "determinant" or "worst", got {criterion!r}')
    cones = _cones(exclusions)
    part = weight * (1.0 - ratios**-2.0)
    total = float(weight.sum())
    equal = np.ptp(weight) == 0.0 and np.ptp(ratios) == 0.0
    if equal and not len(cones[0]):
        boresights = tight_frame(number)
    else:
        # Weights of sum one: steps and tolerances know no unit.
        boresights = _search(part / total, cones, POWER[criterion], seed)
    covariance = np.asarray(np.linalg.inv(_information(boresights, part / total)) / total, dtype=np.float64)
    return Layout(
        boresights,
        0.5 * (covariance + covariance.T),
        _value(covariance, criterion),
        _value(np.eye(3) * 3.0 / (3.0 * total - part.sum()), criterion),
        _clearance(boresights, cones),
    )


def _per_head(value: ArrayLike, count: int, name: str) -> FloatArray:
    array = in_scale(positive(value, name), name)
    if array.shape not in ((), (count,)):
        raise InvalidInputError(f"{name}: expected a scalar or shape ({count},), got {array.shape}")
    return np.asarray(np.broadcast_to(array, count), dtype=np.float64)


def _cones(exclusions: Sequence[tuple[ArrayLike, float]]) -> tuple[FloatArray, FloatArray]:
    axes, angles = [], []
    for n, entry in enumerate(exclusions):
        try:
            direction, angle = entry
        except (TypeError, ValueError) as error:
            raise InvalidInputError(
                f"exclusions[{n}]: expected (direction, half-angle), got {entry!r}"
            ) from error
        axis = vectors(direction, f"exclusions[{n}]")
        if axis.shape != (3,) or not np.linalg.norm(axis) > 0.0:
            raise InvalidInputError(f"exclusions[{n}]: expected a direction (3,) that is not zero")
        half = positive(angle, f"exclusions[{n}]")
        if half.ndim or not half < np.pi:
            raise InvalidInputError(f"exclusions[{n}]: expected a half-angle in (0, pi) rad, got {angle}")
        axes.append(unit(axis))
        angles.append(float(half))
    return np.reshape(axes, (-1, 3)), np.array(angles)


def _information(z: FloatArray, part: FloatArray) -> FloatArray:
    """(T5) over the sum of the weights."""
    return np.asarray(np.eye(3) - np.einsum("n,...ni,...nj->...ij", part, z, z))


def _value(covariance: FloatArray, criterion: Criterion) -> float:
    values = np.linalg.eigvalsh(covariance)
    return float({"trace": values.sum(), "determinant": values.prod(), "worst": values[-1]}[criterion])


def _clearance(z: FloatArray, cones: tuple[FloatArray, FloatArray]) -> FloatArray:
    axes, angles = cones
    if not len(angles):
        return np.full(z.shape[:-1], np.inf)
    return np.asarray((_angle(z[..., np.newaxis, :], axes) - angles).min(axis=-1))


def _angle(a: FloatArray, b: FloatArray) -> FloatArray:
    """Between unit vectors, accurate at 0 and pi."""
    return np.asarray(2.0 * np.arctan2(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1)))


def _search(part: FloatArray, cones: tuple[FloatArray, FloatArray], power: int, seed: int) -> FloatArray:
    """Projected gradient descent from many starts at once; the best point of all."""
    z = _starts(len(part), cones, seed)
    step = np.full(STARTS, 1.0)
    cost, slope = _cost(z, part, power)
    for _ in range(ITERATIONS):
        trial = _outside(unit(z - step[:, np.newaxis, np.newaxis] * slope), cones)
        new, new_slope = _cost(trial, part, power)
        better = (new < cost) & (_clearance(trial, cones).min(axis=-1) >= -EDGE)
        z[better], cost[better], slope[better] = trial[better], new[better], new_slope[better]
        step = np.where(better, 1.3 * step, 0.3 * step)
        if (step < 1e-13).all():
            break
    return _polished(z[cost.argmin()], part, cones, power)


def _polished(
    z: FloatArray, part: FloatArray, cones: tuple[FloatArray, FloatArray], power: int
) -> FloatArray:
    """One head at a time to where the others know most, as long as that helps.

    The best place for that head, whatever the weights; a gradient step for all creeps if they differ much.
    """
    cost = _cost(z[np.newaxis], part, power)[0][0]
    for _ in range(SWEEPS):
        before = cost
        for n in range(len(z)):
            others = _information(np.delete(z, n, axis=0), np.delete(part, n))
            best = np.linalg.eigh(others)[1][:, -1]
            for sign in (1.0, -1.0) if best @ z[n] >= 0.0 else (-1.0, 1.0):
                trial = z.copy()
                trial[n] = sign * best
                new = _cost(trial[np.newaxis], part, power)[0][0]
                if new < cost and _clearance(trial, cones).min() >= -EDGE:
                    z, cost = trial, new
                    break
        if not cost < before:
            break
    return z


def _cost(z: FloatArray, part: FloatArray, power: int) -> tuple[FloatArray, FloatArray]:
    """``(tr P^p)^(1/p)``, ``log det P`` for 0, and its slope on the spheres: ``dcost = -tr(P^(p+1) dF)``."""
    values, axes = np.linalg.eigh(_information(z, part))
    if power:
        total = (values ** -float(power)).sum(axis=-1)
        cost = total ** (1.0 / power)
        factor = cost / total
    else:
        cost, factor = -np.log(values).sum(axis=-1), np.ones(len(values))
    bent = factor[:, np.newaxis] * values ** -float(power + 1)
    gradient = 2.0 * part[:, np.newaxis] * np.einsum("sik,sk,sjk,snj->sni", axes, bent, axes, z)
    return cost, gradient - (gradient * z).sum(axis=-1, keepdims=True) * z


def _starts(count: int, cones: tuple[FloatArray, FloatArray], seed: int) -> FloatArray:
    """Random boresights outside all cones, ``(STARTS, count, 3)``."""
    rng = np.random.default_rng(seed)
    pool = unit(rng.standard_normal((SAMPLES, 3)))
    pool = pool[_clearance(pool, cones) >= 0.0]
    if not len(pool):
        raise DegenerateGeometryError("exclusions: the cones leave no direction for a boresight")
    return np.asarray(pool[rng.integers(0, len(pool), (STARTS, count))])


def _outside(z: FloatArray, cones: tuple[FloatArray, FloatArray]) -> FloatArray:
    """Boresights inside a cone moved to its edge; a few rounds for cones that overlap."""
    axes, angles = cones
    for _ in range(4 if len(angles) > 1 else 1):
        for axis, angle in zip(axes, angles, strict=True):
            inside = _angle(z, axis) < angle
            across = z - (z @ axis)[..., np.newaxis] * axis
            size = np.linalg.norm(across, axis=-1, keepdims=True)
            edge = np.cos(angle) * axis + np.sin(angle) * across / np.where(size > 0.0, size, 1.0)
            z = np.where((inside & (size[..., 0] > 0.0))[..., np.newaxis], edge, z)
    return z
