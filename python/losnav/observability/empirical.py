"""What measurements do when the state is moved, without derivatives: the empirical Gramian."""

from __future__ import annotations

from typing import Any

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, as_float64, positive
from losnav.errors import InvalidInputError
from losnav.observability.arc import Course, Look, course, survey, told_at, whitening

__all__ = ["empirical_gramian"]


def empirical_gramian(
    dynamics: Any,
    sensor: Any,
    state: Any,
    times: ArrayLike,
    scale: ArrayLike,
    *,
    controls: Any = None,
    start: float | None = None,
    **context: Any,
) -> FloatArray:
    """Gramian of an arc from central differences of finite size (equation I5).

    Sees what a derivative does not: that a large error of the state changes what is measured more, or less,
    than in proportion. For small ``scale`` it is :func:`gramian`.

    Parameters
    ----------
    dynamics, sensor, state, times, controls, start, **context
        As for :func:`gramian`; of one state. ``jacobian`` of the sensor is not asked.
    scale : (N,)
        How far each component of the state is moved, both ways.

    Returns
    -------
    (N, N)
        ``W_ij = sum_k d_i' R^-1 d_j / (4 scale_i scale_j)``, ``d_i`` the difference of the measurements with
        component ``i`` moved up and down.

    Raises
    ------
    InvalidInputError
        As :func:`gramian`.

    Notes
    -----
    Lall, Marsden & Glavaski, Int. J. Robust Nonlinear Control 12, 2002; Krener & Ide, CDC 2009, whose indices
    are :func:`unobservability_index` and :func:`estimation_condition`.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> orbit = ln.dynamics.ClohessyWiltshire(mean_motion=1.1e-3)
    >>> laser = ln.sensors.Range(sigma=1.0)
    >>> setting = orbit, laser, [-500.0, 30.0, 20.0, 0.1, 0.2, 0.0], np.arange(0.0, 6000.0, 60.0)
    >>> exact = ln.observability.gramian(*setting)
    >>> moved = ln.observability.empirical_gramian(*setting, scale=[1.0] * 3 + [1e-3] * 3)
    >>> bool(np.abs(moved - exact).max() < 1e-4 * exact.max())
    True
    """
    path, sensors, told = survey(dynamics, sensor, state, times, controls, start, context)
    if path.transition.ndim != 3:
        raise InvalidInputError(f"state: expected one state, got shape {np.shape(state)}")
    sizes = positive(scale, "scale")
    if sizes.shape != (path.size,):
        raise InvalidInputError(f"scale: expected shape ({path.size},), got {sizes.shape}")
    columns = []
    for i, size in enumerate(sizes):
        step = size * np.eye(path.size)[i]
        ends = [course(dynamics, _moved(state, sign * step), path.times, controls) for sign in (1.0, -1.0)]
        columns.append(np.concatenate([_difference(path, ends, look, told) for look in sensors]) / (2 * size))
    rows = np.stack(columns, axis=-1)
    return np.asarray(rows.T @ rows)


def _moved(state: Any, step: FloatArray) -> Any:
    return state.inject(step) if hasattr(state, "inject") else as_float64(state, "state") + step


def _difference(path: Course, ends: list[Course], look: Look, context: dict[str, Any]) -> FloatArray:
    """Measurements from one end less those from the other, in units of their noise, one after another."""
    seen = look.seen
    parts = []
    for k in np.flatnonzero(seen.any(axis=1)):
        told = told_at(look.sensor, context, int(k), path.times)
        up, down = (np.atleast_1d(look.sensor.predict(end.at(int(k)), **told)) for end in ends)
        residual = getattr(look.sensor, "residual", None)
        d = as_float64(up - down if residual is None else residual(up, down), "sensor.predict(...)")
        r = as_float64(look.sensor.noise(path.at(int(k)), **told), "sensor.noise(...)")
        kept = np.broadcast_to(seen[k], d.shape)
        parts.append(whitening(r[np.ix_(kept, kept)], d[kept][:, np.newaxis])[:, 0])
    return np.concatenate(parts) if parts else np.zeros(0)
