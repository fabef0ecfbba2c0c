"""Coordinates that bend with the orbit, for separations of many kilometres."""

from __future__ import annotations

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, in_range, positive, together, vectors


@np.errstate(all="ignore")
def curvilinear_from_lvlh(relative: ArrayLike, radius: ArrayLike) -> FloatArray:
    """Relative state along the orbit's circle instead of its tangent: spherical coordinates about the planet.

    Arc along the track ``R atan2(x, R - z)``, arc across the plane ``R atan2(y, hypot(x, R - z))``, depth
    ``R - |(x, y, R - z)|``, and their rates. Equal to the Cartesian state to first order; the equations of
    Clohessy and Wiltshire hold in them at any distance along the track: what they leave out is of second
    order in depth and rates only. A chaser 160 km behind on the same circle stands 1.8 km "below" the
    tangent.

    Parameters
    ----------
    relative : (..., 6)
        ``[r v]`` in the target's orbital frame, m and m/s; not opposite of the planet's centre.
    radius : scalar or (...)
        ``R`` of the target's circular orbit, m.

    Returns
    -------
    (..., 6)
        Arcs and depth, m, and their rates, m/s.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, or a radius that is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> angle, radius = 0.1, 7e6  # on the same circle, 700 km behind
    >>> behind = [-radius * np.sin(angle), 0, radius * (1 - np.cos(angle)), 0, 0, 0]
    >>> ln.orbits.curvilinear_from_lvlh(behind, radius).round(6) + 0.0
    array([-700000.,       0.,       0.,       0.,       0.,       0.])
    """
    x, around = _arguments(relative, radius)
    along, across, depth, v_along, v_across, v_depth = np.moveaxis(x, -1, 0)
    height = around - depth
    flat = np.hypot(along, height)
    distance = np.hypot(flat, across)
    # Rates of the flat distance, of the distance, and of the two angles.
    v_flat = (along * v_along - height * v_depth) / flat
    v_distance = (flat * v_flat + across * v_across) / distance
    turn = (height * v_along + along * v_depth) / flat**2
    lift = (flat * v_across - across * v_flat) / distance**2
    moved: FloatArray = np.stack(
        [
            around * np.arctan2(along, height),
            around * np.arctan2(across, flat),
            # R - distance without the difference of two large numbers.
            (2 * around * depth - depth**2 - along**2 - across**2) / (around + distance),
            around * turn,
            around * lift,
            -v_distance,
        ],
        axis=-1,
    )
    return in_range(moved, "relative or radius")


@np.errstate(all="ignore")
def lvlh_from_curvilinear(curvilinear: ArrayLike, radius: ArrayLike) -> FloatArray:
    """Cartesian state in the target's orbital frame: the inverse of :func:`curvilinear_from_lvlh`.

    Parameters
    ----------
    curvilinear : (..., 6)
        Arcs and depth, m, and their rates, m/s.
    radius : scalar or (...)
        ``R`` of the target's circular orbit, m.

    Returns
    -------
    (..., 6)
        ``[r v]``, m and m/s.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, or a radius that is not positive.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.orbits.lvlh_from_curvilinear([-160e3, 0, 0, 0, 0, 0], 7e6).round(1) + 0.0
    array([-159986.1,       0. ,    1828.5,       0. ,       0. ,       0. ])
    """
    x, around = _arguments(curvilinear, radius)
    along, across, depth, v_along, v_across, v_depth = np.moveaxis(x, -1, 0)
    theta, phi = along / around, across / around
    distance, turn, lift = around - depth, v_along / around, v_across / around
    flat = distance * np.cos(phi)
    v_flat = -v_depth * np.cos(phi) - distance * np.sin(phi) * lift
    # R - s cos(theta) without the difference of two large numbers.
    versed = 2 * np.sin(0.5 * theta) ** 2
    below = depth * np.cos(phi) + 2 * around * np.sin(0.5 * phi) ** 2
    moved: FloatArray = np.stack(
        [
            flat * np.sin(theta),
            distance * np.sin(phi),
            below + flat * versed,
            v_flat * np.sin(theta) + flat * np.cos(theta) * turn,
            -v_depth * np.sin(phi) + distance * np.cos(phi) * lift,
            -v_flat * np.cos(theta) + flat * np.sin(theta) * turn,
        ],
        axis=-1,
    )
    return in_range(moved, "relative or radius")


def _arguments(state: ArrayLike, radius: ArrayLike) -> list[FloatArray]:
    return together(("relative", vectors(state, "relative", 6), 1), ("radius", positive(radius, "radius"), 0))
