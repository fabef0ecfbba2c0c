"""States along an orbit, and the observability degree of the direction to the Sun there."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import losnav as ln

if TYPE_CHECKING:
    from losnav.scenarios.sun_line_of_sight import SunLineOfSight

__all__ = [
    "anomalies",
    "canonical",
    "curve",
    "degree",
    "dip_from",
    "horizon_index",
    "lie_rows",
    "orbit_state",
    "reversal",
]

Array = NDArray[np.float64]

_POINTS = 361  # of a curve over one orbit
# Points of a grid of parameters, and how often it is made finer.
_GRID, _ROUNDS = 46, 6
# How far from the aphelion a dip must show, rad.
_ASIDE = np.radians(1.0)


def orbit_state(
    scenario: SunLineOfSight,
    anomaly: Any,
    *,
    semi_major_axis: Any = None,
    eccentricity: Any = None,
    inclination: Any = None,
) -> Array:
    """States ``[r v]`` at true anomalies, (..., 6), m and m/s; elements not given are the scenario's."""
    s = scenario
    a = s.semi_major_axis if semi_major_axis is None else semi_major_axis
    e = s.eccentricity if eccentricity is None else eccentricity
    i = s.inclination if inclination is None else inclination
    f, a, e, i = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in (anomaly, a, e, i)))
    parameter = a * (1 - e * e)
    r, speed = parameter / (1 + e * np.cos(f)), np.sqrt(s.mu / parameter)
    along = s.argument_of_perihelion
    cn, sn, ci, si = np.cos(s.node), np.sin(s.node), np.cos(i), np.sin(i)
    ca, sa = np.cos(along), np.sin(along)
    p = np.stack([cn * ca - sn * sa * ci, sn * ca + cn * sa * ci, sa * si], axis=-1)
    q = np.stack([-cn * sa - sn * ca * ci, -sn * sa + cn * ca * ci, ca * si], axis=-1)
    cf, sf = np.cos(f)[..., None], np.sin(f)[..., None]
    position = r[..., None] * (cf * p + sf * q)
    velocity = speed[..., None] * (-sf * p + (e[..., None] + cf) * q)
    return np.concatenate([position, velocity], axis=-1)


def anomalies() -> Array:
    """True anomalies of a curve, perihelion to perihelion, rad."""
    return np.linspace(0.0, 2 * np.pi, _POINTS)


def canonical(scenario: SunLineOfSight, unit_length: Any = None) -> tuple[Array, Array]:
    """Size of one unit of each component of the state, (..., 6), and of time, (...), s, with mu = 1."""
    length = np.asarray(scenario.unit_length if unit_length is None else unit_length, dtype=float)
    speed = np.sqrt(scenario.mu / length)
    sizes = np.stack([length] * 3 + [speed] * 3, axis=-1)
    return sizes, length / speed


def lie_rows(scenario: SunLineOfSight, states: Array, order: int | None = None) -> Array:
    """Derivatives of the Lie derivatives of the direction, (..., 3 (order + 1), 6), SI units."""
    order = scenario.order if order is None else order
    motion = ln.dynamics.TwoBody(scenario.mu)
    return np.asarray(ln.observability.lie_matrix(motion, scenario.sensor, states, order, scale="SI"))


def degree(
    scenario: SunLineOfSight, states: Array, order: int | None = None, unit_length: Any = None
) -> Array:
    """Observability degree at states, in units of length and time with mu = 1, (...)."""
    rows = lie_rows(scenario, states, order)
    sizes, time = canonical(scenario, unit_length)
    powers = np.repeat(np.arange(rows.shape[-2] // 3), 3)
    unit = rows * time[..., None, None] ** powers[:, None] * sizes[..., None, :]
    return np.asarray(ln.observability.degree(unit))


def curve(
    scenario: SunLineOfSight,
    anomaly: Any = None,
    *,
    order: int | None = None,
    unit_length: Any = None,
    **elements: Any,
) -> Array:
    """Observability degree at true anomalies (a whole orbit if none are given)."""
    f = anomalies() if anomaly is None else anomaly
    return degree(scenario, orbit_state(scenario, f, **elements), order, unit_length)


def horizon_index(scenario: SunLineOfSight, states: Array) -> Array:
    """Smallest singular value of the Lie matrix whose rows are weighted by the horizon, (...)."""
    sizes, _ = canonical(scenario)
    rows = lie_rows(scenario, states)
    weighted = ln.observability.horizon_weighted(rows, scenario.horizon, scenario.order, scale=sizes)
    return np.asarray(np.linalg.svd(weighted, compute_uv=False)[..., -1])


@lru_cache(maxsize=32)
def reversal(scenario: SunLineOfSight, order: int) -> float:
    """Semi-major axis at which perihelion and aphelion have the same degree, m; infinite if there is none."""

    def difference(a: Array) -> Array:
        ends = curve(scenario, np.array([0.0, np.pi]), order=order, semi_major_axis=a[:, None])
        return np.asarray(ends[:, 1] - ends[:, 0])

    return _root(difference, 0.5 * scenario.unit_length, 5 * scenario.unit_length)


@lru_cache(maxsize=32)
def dip_from(scenario: SunLineOfSight, order: int, own_unit: bool = False) -> float:
    """Eccentricity from which on the degree dips at the aphelion; infinite if it never does.

    ``own_unit`` takes the semi-major axis for the unit of length.
    """
    unit = scenario.semi_major_axis if own_unit else None

    def rise(e: Array) -> Array:
        f = np.array([np.pi, np.pi - _ASIDE])
        near = curve(scenario, f, order=order, unit_length=unit, eccentricity=e[:, None])
        return np.asarray(near[:, 0] - near[:, 1])

    return _root(rise, 0.05, 0.95)


def _root(function: Callable[[Array], Array], low: float, high: float) -> float:
    """Where a function that starts positive first is negative, on a grid that is made finer and finer."""
    for round_ in range(_ROUNDS):
        grid = np.linspace(low, high, _GRID)
        positive = function(grid) > 0.0
        if not round_ and (positive.all() or not positive[0]):
            return float("inf") if positive.all() else low
        k = int(np.argmin(positive)) or 1
        low, high = float(grid[k - 1]), float(grid[k])
    return 0.5 * (low + high)
