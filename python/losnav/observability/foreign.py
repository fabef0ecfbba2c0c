"""Lie derivatives where the model or a sensor lives in Python: power series through NumPy, or differences."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from losnav import _core
from losnav._arrays import FloatArray, as_float64, finite
from losnav.errors import InvalidInputError
from losnav.filters.step import told_to
from losnav.observability.jets import Jet
from losnav.sensors.listed import is_listed

__all__ = ["derivatives", "differences"]

# Where there are only propagated states: the half width of what is fitted, in units of time, and the degree
# beyond the order. Rounding grows as width^-order, what is left out falls as width^degree.
_WIDTH = 0.25
_SPARE_DEGREES = 8


def derivatives(  # noqa: PLR0917
    series: FloatArray | None,
    dynamics: Any,
    sensors: list[Any],
    state: FloatArray,
    order: int,
    control: Any,
    time: float,
    context: dict[str, Any],
) -> FloatArray:
    """``(K + 1, M, N)``: gradients of the Taylor coefficients of the measurements, of one state.

    ``series`` is that of the state, ``(K + 1, 1 + N, N)``, if the engine has expanded the model.
    """
    if series is None:
        series = _expanded(dynamics, state, order, control, time)
    return np.concatenate([_seen(one, series, told_to(one, context)) for one in sensors], axis=1)[..., 1:]


def _expanded(dynamics: Any, state: FloatArray, order: int, control: Any, time: float) -> FloatArray:
    """Series of the state from the model's ``rates``: each round one order more."""
    size = state.size
    start = np.column_stack([state, np.eye(size)])
    path = _objects([Jet(row[np.newaxis]) for row in start])
    known: dict[str, Any] = {} if control is None else {"control": control}
    for k in range(order):
        if getattr(dynamics, "time_varying", False):
            clock = np.zeros((k + 1, 1 + size))
            clock[0, 0], clock[1:2, 0] = time, 1.0
            known["time"] = Jet(clock)
        rates = _through(dynamics.rates, "dynamics.rates(...)", path, known)
        if len(rates) != size:
            raise InvalidInputError(f"dynamics.rates(...): expected shape ({size},), got ({len(rates)},)")
        path = _objects([_jet(r, k, size).integral(row) for r, row in zip(rates, start, strict=True)])
    return np.stack([jet.coefficients for jet in path], axis=-1)


def _seen(sensor: Any, series: FloatArray, told: dict[str, Any]) -> FloatArray:
    """``(K + 1, M, 1 + N)``: what a sensor sees of a series of the state."""
    if is_listed(sensor):
        known = dict(told)
        view = _core.lie_view(sensor, np.ascontiguousarray(series), known.pop("dcm", None), known)
        if view is not None:
            return view
    order, size = len(series) - 1, series.shape[-1]
    path = _objects([Jet(np.ascontiguousarray(series[..., i])) for i in range(size)])
    rows = _through(sensor.predict, "sensor.predict(...)", path, told)
    return np.stack([_jet(row, order, size).coefficients for row in rows], axis=1)


def _objects(jets: list[Jet]) -> Any:
    out = np.empty(len(jets), dtype=object)
    out[:] = jets
    return out


def _through(function: Callable[..., Any], what: str, path: Any, known: dict[str, Any]) -> list[Any]:
    """A user's function of a state, called with series."""
    try:
        return list(np.ravel(np.asarray(function(path, **known), dtype=object)))
    except (TypeError, AttributeError, ValueError) as error:
        raise InvalidInputError(
            f"{what}: cannot be differentiated: {error}. It is called with an array of numbers that carry "
            "their derivatives (dtype object); plain NumPy arithmetic lets them through. A model without "
            "rates is differentiated by differences of propagate, transition and jacobian instead"
        ) from error


def _jet(value: Any, order: int, size: int) -> Jet:
    """A result as a series to ``order``: a plain number is one that does not move."""
    if isinstance(value, Jet):
        known = np.zeros((order + 1, 1 + size))
        taken = value.coefficients[: order + 1]
        known[: len(taken)] = taken
        return Jet(known)
    constant = np.zeros((order + 1, 1 + size))
    constant[0, 0] = value
    return Jet(constant)


def differences(  # noqa: PLR0917
    dynamics: Any,
    sensors: list[Any],
    state: FloatArray,
    order: int,
    control: Any,
    time: float,
    context: dict[str, Any],
    pace: float,
) -> FloatArray:
    """The same of a model without ``rates``: ``H Phi`` along the path is fitted by Chebyshev polynomials.

    In the unit of time given, about 1e-9 of the largest entry of an order up to the second, 1e-6 at the
    fifth, where the motion is smooth over half a unit.
    """
    degree = order + _SPARE_DEGREES
    nodes = chebyshev.chebpts1(degree + 1)
    rows = [
        _carried(dynamics, sensors, state, _WIDTH * pace * float(node), control, time, context)
        for node in nodes
    ]
    stacked = np.array(rows)
    fitted = chebyshev.chebfit(nodes, stacked.reshape(len(nodes), -1), degree)
    power = np.stack([chebyshev.cheb2poly(column) for column in fitted.T], axis=1)[: order + 1]
    power /= ((_WIDTH * pace) ** np.arange(order + 1.0))[:, np.newaxis]
    return np.asarray(power.reshape(order + 1, *stacked.shape[1:]))


def _carried(  # noqa: PLR0917
    dynamics: Any,
    sensors: list[Any],
    state: FloatArray,
    dt: float,
    control: Any,
    time: float,
    context: dict[str, Any],
) -> FloatArray:
    """``H(x(dt)) Phi(dt)`` of all sensors."""
    known = (state, dt) if control is None else (state, dt, control)
    when = {"time": time} if getattr(dynamics, "time_varying", False) else {}
    moved = finite(dynamics.propagate(*known, **when), "dynamics.propagate(...)")
    phi = finite(dynamics.transition(*known, **when), "dynamics.transition(...)")
    if phi.shape != (state.size, state.size) or moved.shape != state.shape:
        raise InvalidInputError(
            f"dynamics: expected a state ({state.size},) and a transition ({state.size}, {state.size}), got "
            f"{moved.shape} and {phi.shape}"
        )
    jacobians = [
        as_float64(one.jacobian(moved, **told_to(one, context)), "sensor.jacobian(...)") for one in sensors
    ]
    return np.concatenate(jacobians, axis=-2) @ phi
