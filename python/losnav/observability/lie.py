"""What a measurement and its derivatives in time say of a state: Lie derivatives along the flow."""

from __future__ import annotations

import math
import operator
from functools import lru_cache
from typing import Any

import numpy as np

from losnav import _core
from losnav import dynamics as models
from losnav._arrays import ArrayLike, FloatArray, broadcast, finite, in_range, rotations, vectors
from losnav.dynamics.strapdown import numbers_of
from losnav.errors import InvalidInputError
from losnav.filters.foreign import needed
from losnav.filters.step import told_to
from losnav.navigation_state import NavState
from losnav.observability import foreign
from losnav.observability.units import POSE, Scale, fixed_units, mean_range, parts_of, state_units
from losnav.sensors.listed import NO_TURN, is_listed

__all__ = ["MAX_ORDER", "lie_matrix"]

#: Highest derivative.
MAX_ORDER = 15


def lie_matrix(
    dynamics: Any,
    sensor: Any,
    state: Any,
    order: int,
    scale: Scale = None,
    *,
    control: Any = None,
    time: ArrayLike = 0.0,
    **context: Any,
) -> FloatArray:
    """Gradients of the Lie derivatives of a measurement, orders ``0`` to ``order`` (equation V1).

    Derivative ``k`` is the ``k``-th derivative of the measurement in time along the motion; its gradient says
    which small changes of the state it would show. Their rank is the number of state components that can be
    known from a short arc (Hermann & Krener 1977). Exact to rounding: power series in time go through the
    equation of motion and the sensor, and derivatives with respect to the state through the same operations.

    Parameters
    ----------
    dynamics : model or None
        From :mod:`losnav.dynamics`, or your own with ``rates(state)``; None for a state of which nothing is
        known to move, whose derivatives are zero.
    sensor : sensor or sequence of sensors
        One or several, from :mod:`losnav.sensors` or your own; several are stacked within each order.
    state : (..., N), NavState or (position, mrp)
        Where to look; a batch is done in parallel.
    order : int
        Highest derivative, 0 to 15.
    scale : optional
        Units of length and time for rows and columns. None: canonical ones of the model. About the Sun the
        astronomical unit, about a planet its radius if the model knows it, otherwise the distance ``|r|`` of
        each state, with the time that makes ``mu`` one (``mu = 1`` says that they are canonical already); of
        relative motion the separation and the target's orbit; of other models ``|r|`` and ``|r| / |v|``. Or
        a length (of models with ``mu``), ``(length, time)``, sizes of one unit of each component ``(N,)``
        (the time is position over velocity), ``(sizes, time)``, or ``"SI"`` for derivatives as they are.
    control : (3,) or (..., 3), optional
        Acceleration held along the way, m/s^2; specific force and rate of a strapped-down unit.
    time : float or (...), optional
        When, s; for models that change with time.
    **context
        What sensors are told: ``dcm=`` ``(3, 3)`` or ``(..., 3, 3)``, which does not turn, ``landmarks=``,
        ``target=``.

    Returns
    -------
    (..., M (order + 1), N)
        Rows of order 0 first: ``T^k d(L_f^k h)/dx`` times the sizes of the components.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, an order out of range, a scale that is none, a model or sensor that
        cannot be differentiated, or a state where the measurement is undefined.

    Examples
    --------
    >>> import losnav as ln
    >>> from losnav.constants import SUN_MU
    >>> orbit, sun = ln.dynamics.TwoBody(SUN_MU), ln.sensors.SunDirection(5e-5)
    >>> state = [1.5e11, 0.0, 0.0, 0.0, 3.1e4, 2.0e3]
    >>> matrix = ln.observability.lie_matrix(orbit, sun, state, order=5)
    >>> matrix.shape
    (18, 6)
    >>> [ln.observability.analyze(matrix[: 3 * k]).rank for k in (1, 2, 3, 4)]
    [2, 4, 5, 6]
    """
    if scale is None and control is None and not context and time == 0.0:
        quick = _at_once(dynamics, sensor, state, order)
        if quick is not None:
            return quick
    highest = _order(order)
    sensors = list(sensor) if isinstance(sensor, list | tuple) else [sensor]
    if not sensors:
        raise InvalidInputError("sensor: expected at least one")
    for one in sensors:
        needed(one, "sensor", ("predict", "jacobian"))
    if dynamics is None:
        return _still(sensors, state, highest, scale, context)
    if isinstance(dynamics, models.Strapdown):
        return _inertial(dynamics, sensors, state, highest, scale, control=control, context=context)
    asked = _Asked(dynamics, sensors, state, highest, scale, control=control, time=time, context=context)
    matrix = asked.by_engine() if all(is_listed(one) for one in sensors) else None
    return asked.in_python() if matrix is None else matrix


#: Models of ``[r v]`` that the engine expands itself; a subclass may have changed anything.
_EXPANDED = (
    models.ClohessyWiltshire,
    models.CurvilinearClohessyWiltshire,
    models.RelativeTwoBody,
    models.TwoBody,
    models.YamanakaAnkersen,
)
_NO_CONTROL = np.zeros(3)
#: Parts of the tangent of everything a NavState holds.
_LARGEST = parts_of(18) or ()


def _at_once(dynamics: Any, sensor: Any, state: Any, order: int) -> FloatArray | None:
    """A single state in the fixed units of its model, if that is what is asked."""
    if type(dynamics) not in _EXPANDED or type(order) is not int or order < 0:
        return None
    try:
        study = _study(dynamics, sensor)
    except TypeError:
        # A sequence of sensors.
        return None
    return None if study is None else study.matrix(state, order)


@lru_cache(maxsize=32)
def _study(dynamics: Any, sensor: Any) -> _core.LieStudy | None:
    units = fixed_units(dynamics)
    if units is None or dynamics.time_varying or not is_listed(sensor):
        return None
    length, time = units
    sizes = [length] * 3 + [length / time] * 3
    return _core.LieStudy.of(dynamics._engine_name, dynamics._parameters(), sensor, sizes, time)


class _Asked:
    """A call, its arguments checked and broadcast."""

    def __init__(
        self,
        dynamics: Any,
        sensors: list[Any],
        state: Any,
        order: int,
        scale: Scale,
        *,
        control: Any,
        time: ArrayLike,
        context: dict[str, Any],
    ) -> None:
        self.dynamics, self.sensors, self.order = dynamics, sensors, order
        self.expanded = type(dynamics) in _EXPANDED
        x, when = finite(state, "state"), finite(time, "time")
        if not x.ndim or (self.expanded and x.shape[-1] != dynamics.state_size):
            size = dynamics.state_size if self.expanded else "N"
            raise InvalidInputError(f"state: expected shape (..., {size}), got {x.shape}")
        self.size = int(x.shape[-1])
        columns, pace = state_units(scale, dynamics, x[..., :3], x[..., 3:6], parts_of(self.size), self.size)
        self.told = dict(context)
        dcm = self.told.pop("dcm", None)
        attitude = NO_TURN if dcm is None else rotations(dcm, "dcm")
        given = None if control is None else finite(control, "control")
        u = _NO_CONTROL if given is None else given
        if not u.ndim or (self.expanded and u.shape[-1] != 3):
            raise InvalidInputError(f"control: expected shape (..., 3), got {u.shape}")
        if self.expanded:
            dynamics._check_span(when, when, "time")
        self.shape, (self.state, self.control, self.time, attitude) = broadcast(
            ("state", x, 1), ("control", u, 1), ("time", when, 0), ("dcm", attitude, 2)
        )
        self.controlled = given is not None
        self.dcm = None if dcm is None else attitude
        self.columns = self._flat(columns, (self.size,))
        self.pace = self._flat(pace, ())

    def _flat(self, array: FloatArray, core: tuple[int, ...]) -> FloatArray:
        """A row for each state, or the one for all."""
        if array.ndim == len(core):
            return np.ascontiguousarray(array)
        return np.ascontiguousarray(np.broadcast_to(array, self.shape + core)).reshape(-1, *core)

    def by_engine(self) -> FloatArray | None:
        """All of it at once, if the engine has it all."""
        if not self.expanded:
            return None
        matrix = _core.lie_matrix(
            self.dynamics._engine_name,
            self.dynamics._parameters(),
            tuple(self.sensors),
            self.state,
            self.control,
            self.dcm,
            self.time,
            self.order,
            self.columns,
            self.pace,
            self.told,
        )
        if matrix is None:
            return None
        in_range(matrix, "state, control or scale")
        return np.asarray(matrix).reshape((*self.shape, *matrix.shape[1:]))

    def in_python(self) -> FloatArray:
        """State by state."""
        states = [self._one(k) for k in range(len(self.state))]
        orders = np.arange(self.order + 1)
        factors = np.array([math.factorial(k) for k in orders]) * self.pace[..., np.newaxis] ** orders
        weighted = np.array(states) * factors[..., np.newaxis, np.newaxis]
        weighted = weighted * self.columns[..., np.newaxis, np.newaxis, :]
        in_range(weighted, "state, control or scale")
        rows = weighted.shape[1] * weighted.shape[2]
        return np.asarray(weighted).reshape((*self.shape, rows, self.size))

    def _one(self, k: int) -> FloatArray:
        x, time = self.state[k], float(self.time[k])
        u = self.control[k] if self.controlled else None
        told = self.told if self.dcm is None else {**self.told, "dcm": self.dcm[k]}
        if self.expanded:
            name, parameters = self.dynamics._engine_name, self.dynamics._parameters()
            series = _core.lie_path(name, parameters, x, self.control[k], self.time[k : k + 1], self.order)[0]
            return foreign.derivatives(series, None, self.sensors, x, self.order, u, time, told)
        if callable(getattr(self.dynamics, "rates", None)):
            return foreign.derivatives(None, self.dynamics, self.sensors, x, self.order, u, time, told)
        needed(self.dynamics, "dynamics", ("propagate", "transition"))
        pace = float(self.pace[k] if self.pace.ndim else self.pace)
        return foreign.differences(self.dynamics, self.sensors, x, self.order, u, time, told, pace)


def _order(order: int) -> int:
    try:
        highest = operator.index(order)
    except TypeError:
        raise InvalidInputError(f"order: expected a whole number, got {order!r}") from None
    if not 0 <= highest <= MAX_ORDER:
        raise InvalidInputError(f"order: expected 0 to {MAX_ORDER}, got {highest}")
    return highest


def _inertial(
    dynamics: models.Strapdown,
    sensors: list[Any],
    state: Any,
    order: int,
    scale: Scale,
    *,
    control: Any,
    context: dict[str, Any],
) -> FloatArray:
    """Along inertial navigation: the columns of this model's tangent among those of the largest."""
    if not isinstance(state, NavState):
        raise InvalidInputError(f"state: expected a NavState, got {type(state).__name__}")
    size, parts = dynamics.state_size, parts_of(dynamics.state_size) or ()
    columns, pace = state_units(scale, None, state.position, state.velocity, parts, size)
    keep = np.concatenate([np.arange(3) + 3 * _LARGEST.index(part) for part in parts])
    sample = np.zeros(6) if control is None else finite(numbers_of(control), "control")
    shape, (x, u, units) = broadcast(
        ("state", state._numbers(), 1), ("control", sample, 1), ("scale", columns, 1)
    )
    sizes = np.ones((len(x), 3 * len(_LARGEST)))
    sizes[:, keep] = units
    paces = np.ascontiguousarray(np.broadcast_to(pace, shape)).reshape(-1)
    matrix = _core.lie_inertial(
        dynamics._engine, tuple(sensors), x, u, np.zeros(1), order, sizes, paces, dict(context)
    )
    if matrix is None:
        raise InvalidInputError(
            "sensor: with a NavState only sensors of losnav.sensors can be differentiated"
        )
    in_range(matrix, "state, control or scale")
    return np.asarray(matrix[..., keep]).reshape((*shape, matrix.shape[1], size))


def _still(sensors: list[Any], state: Any, order: int, scale: Scale, context: dict[str, Any]) -> FloatArray:
    """Of a state that does not move: the Jacobian, and zeros."""
    told = [told_to(one, context) for one in sensors]
    asked = zip(sensors, told, strict=True)
    rows = [finite(one.jacobian(state, **known), "sensor.jacobian(...)") for one, known in asked]
    lead = np.broadcast_shapes(*(r.shape[:-2] for r in rows))
    jacobian = np.concatenate([np.broadcast_to(r, (*lead, *r.shape[-2:])) for r in rows], axis=-2)
    size = jacobian.shape[-1]
    position, parts = _place(state, size)
    if scale is None:
        length = mean_range(sensors, told, position)
        scale = (length, 1.0) if length is not None else None
    columns, _ = state_units(scale, None, position, np.zeros(3), parts, size)
    if columns.ndim > 1:
        columns = columns[..., np.newaxis, :]
    zeros = np.zeros((*lead, order * jacobian.shape[-2], size))
    return np.concatenate([jacobian * columns, zeros], axis=-2)


def _place(state: Any, size: int) -> tuple[FloatArray, tuple[str, ...] | None]:
    """Where a state of any kind is, and what it is made of."""
    if isinstance(state, tuple) and len(state) == 2:
        return vectors(state[0], "position"), POSE
    position = getattr(state, "position", None)
    if position is not None:
        return vectors(position, "position"), POSE if hasattr(state, "mrp") else parts_of(size)
    return finite(state, "state")[..., :3], parts_of(size)
