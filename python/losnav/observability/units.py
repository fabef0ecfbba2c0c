"""Units in which the components of a state, and its derivatives in time, can be compared."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, finite, positive, vectors
from losnav.constants import AU, SUN_MU
from losnav.errors import InvalidInputError

__all__ = [
    "POSE",
    "Scale",
    "canonical_units",
    "fixed_units",
    "mean_range",
    "parts_of",
    "state_labels",
    "state_units",
]

#: What a caller may give as units; see :func:`losnav.observability.lie_matrix`.
Scale: TypeAlias = "str | float | tuple[Any, Any] | ArrayLike | None"

# Share by which a gravitational parameter may differ from the Sun's and still be the Sun's.
_SAME_SUN = 0.01
# Powers of length and of one over time of the parts of a tangent, three components each.
_POWERS = {
    "position": (1, 0),
    "velocity": (1, 1),
    "attitude": (0, 0),
    "accelerometer bias": (1, 2),
    "gyroscope bias": (0, 1),
    "acceleration": (1, 2),
}
#: What a pose is made of.
POSE = ("position", "attitude")
_BIASES = ("accelerometer bias", "gyroscope bias")
_PARTS: dict[int, tuple[str, ...]] = {
    3: ("position",),
    6: ("position", "velocity"),
    9: ("position", "velocity", "attitude"),
    12: ("position", "velocity", "attitude", "acceleration"),
    15: ("position", "velocity", "attitude", *_BIASES),
    18: ("position", "velocity", "attitude", *_BIASES, "acceleration"),
}


def canonical_units(mu: float, length: float) -> tuple[float, float]:
    """Units in which a gravitational parameter is one: ``(length, time)``, time ``sqrt(length^3 / mu)``.

    The degree of observability of an orbit depends on the length that is called one, and has no meaning until
    it is fixed: that of an orbit ``n`` times as large in a unit ``n`` times as large is the same.

    Parameters
    ----------
    mu : float
        Gravitational parameter, m^3/s^2.
    length : float
        Unit of length, m: for the Sun the astronomical unit, for a planet its radius.

    Returns
    -------
    tuple of float
        Length, m, and time, s: a ``scale`` of :func:`lie_matrix`.

    Raises
    ------
    InvalidInputError
        If one is not a positive number.

    Examples
    --------
    >>> import losnav as ln
    >>> from losnav.constants import AU, SUN_MU
    >>> length, time = ln.observability.canonical_units(SUN_MU, AU)
    >>> round(time / 86400, 3)  # days: a year over 2 pi
    58.132
    """
    gravity, size = _number(mu, "mu"), _number(length, "length")
    return size, float(np.sqrt(size / gravity) * size)


def state_labels(size: int) -> tuple[str, ...]:
    """Names of the components of a tangent, for :func:`analyze`.

    Parameters
    ----------
    size : int
        6 for ``[r v]``, or 9, 12, 15 or 18 as in :class:`losnav.NavState`; ``x0, x1, ...`` for others.

    Returns
    -------
    tuple of str
        ``"position x"``, ...

    Examples
    --------
    >>> import losnav as ln
    >>> ln.observability.state_labels(6)[3:]
    ('velocity x', 'velocity y', 'velocity z')
    """
    parts = _PARTS.get(size)
    if parts is None:
        return tuple(f"x{k}" for k in range(size))
    return tuple(f"{part} {axis}" for part in parts for axis in "xyz")


def parts_of(size: int) -> tuple[str, ...] | None:
    """What a tangent of so many components is made of, if it is one of losnav's."""
    return _PARTS.get(size)


def mean_range(sensors: list[Any], told: list[dict[str, Any]], position: FloatArray) -> FloatArray | None:
    """Mean distance of the landmarks of all sensors: it makes a shift and a turn alike."""
    known = [
        context.get("landmarks", getattr(one, "landmarks", None))
        for one, context in zip(sensors, told, strict=True)
    ]
    ranges = [
        np.linalg.norm(vectors(marks, "landmarks") - position[..., np.newaxis, :], axis=-1)
        for marks in known
        if marks is not None
    ]
    return np.concatenate(ranges, axis=-1).mean(axis=-1) if ranges else None


def state_units(  # noqa: PLR0917
    scale: Scale,
    dynamics: Any,
    position: FloatArray,
    velocity: FloatArray,
    parts: tuple[str, ...] | None,
    size: int,
) -> tuple[FloatArray, FloatArray]:
    """Size of one unit of each component ``(..., N)``, and the unit of time ``(...)``.

    Leading dimensions are those of the state where a unit depends on it, none otherwise.
    """
    if isinstance(scale, str) and scale != "SI":
        raise InvalidInputError(f"scale: expected 'SI', numbers or None, got {scale!r}")
    if isinstance(scale, str) or (scale is None and parts is None):
        return np.ones(size), np.ones(())
    if scale is None:
        return _composed(*_chosen(dynamics, position, velocity), parts)
    if isinstance(scale, tuple) and len(scale) == 2:
        unit, pace = scale
        if np.shape(unit) == (size,) and size != 2:
            return _components(unit, size), positive(pace, "scale[1]")
        return _composed(positive(unit, "scale[0]"), positive(pace, "scale[1]"), parts)
    if np.ndim(scale):
        components = _components(scale, size)
        if parts is None or "velocity" not in parts:
            raise InvalidInputError("scale: expected a pair (sizes of the components, unit of time)")
        return components, np.asarray(components[0] / components[3])
    mu = getattr(dynamics, "mu", None)
    if mu is None:
        raise InvalidInputError("scale: expected (length, time); only a model with mu needs the length alone")
    length, time = canonical_units(mu, scale)  # type: ignore[arg-type]
    return _composed(np.asarray(length), np.asarray(time), parts)


def _composed(
    length: FloatArray, time: FloatArray, parts: tuple[str, ...] | None
) -> tuple[FloatArray, FloatArray]:
    """Components of a state in units of length and time."""
    if parts is None:
        raise InvalidInputError("scale: expected a pair (sizes of the components, unit of time), or 'SI'")
    sizes = [length**of_length / time**of_rate for of_length, of_rate in (_POWERS[part] for part in parts)]
    return np.repeat(np.stack(np.broadcast_arrays(*sizes), axis=-1), 3, axis=-1), time


def _chosen(dynamics: Any, position: FloatArray, velocity: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Length and time where the caller gives none."""
    with np.errstate(all="ignore"):
        distance = _or_one(np.linalg.norm(position, axis=-1))
        passing = _or_one(distance / np.linalg.norm(velocity, axis=-1))
        mu = getattr(dynamics, "mu", None)
        orbit = _orbit_size(dynamics, position)
        if mu is None or orbit is None:
            rate = getattr(dynamics, "mean_motion", None)
            return distance, np.asarray(1.0 / rate) if rate else passing
        if orbit is position:
            length = _fixed_length(dynamics, mu)
            size = distance if length is None else np.asarray(length)
            return size, np.asarray(np.sqrt(size / mu) * size)
        # Relative motion: the orbit gives the time, the separation the length.
        return distance, np.asarray(np.sqrt(orbit / mu) * orbit)


def _orbit_size(dynamics: Any, position: FloatArray) -> FloatArray | None:
    """Of relative motion the size of the orbit; ``position`` itself if that is about the planet."""
    chaser = getattr(dynamics, "chaser", None)
    if chaser is not None:
        return np.asarray(np.linalg.norm(np.atleast_2d(chaser)[0, :3]))
    axis = getattr(dynamics, "semi_major_axis", None)
    return position if axis is None else np.asarray(axis, dtype=float)


def fixed_units(dynamics: Any) -> tuple[float, float] | None:
    """Length and time that a model of an orbit has whatever the state; nothing if they depend on it."""
    mu = getattr(dynamics, "mu", None)
    if mu is None or hasattr(dynamics, "chaser") or hasattr(dynamics, "semi_major_axis"):
        return None
    length = _fixed_length(dynamics, mu)
    return None if length is None else canonical_units(mu, length)


def _fixed_length(dynamics: Any, mu: float) -> float | None:
    if mu == 1.0:
        # The caller's numbers are in canonical units.
        return 1.0
    if abs(mu / SUN_MU - 1.0) < _SAME_SUN:
        return AU
    radius = getattr(dynamics, "radius", None)
    return None if radius is None else float(radius)


def _or_one(size: FloatArray) -> FloatArray:
    return np.where(np.isfinite(size) & (size > 0.0), size, 1.0)


def _components(scale: Any, size: int) -> FloatArray:
    sizes = positive(scale, "scale")
    if sizes.shape != (size,):
        raise InvalidInputError(f"scale: expected {size} positive numbers, got shape {sizes.shape}")
    return sizes


def _number(value: Any, name: str) -> float:
    number = finite(value, name)
    if number.ndim or number <= 0.0:
        raise InvalidInputError(f"{name}: expected a positive number, got {value!r}")
    return float(number)
