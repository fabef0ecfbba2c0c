"""The nonlinear predictive filter with a Kalman update."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from losnav._arrays import ArrayLike, FloatArray, finite
from losnav.dynamics.strapdown import Strapdown
from losnav.errors import InvalidInputError
from losnav.filters.inertial import InertialKalmanFilter, unit_covariance
from losnav.filters.options import checked, pairs_of
from losnav.filters.step import Step
from losnav.navigation_state import NavState

__all__ = ["PredictiveFilter"]


class PredictiveFilter(InertialKalmanFilter):
    """Estimates, before every update, the acceleration that the model lacks.

    Lu (1994), Crassidis & Markley (1997), with a Kalman update.

    With ``e`` what the sensors measured of the epoch beyond what the prediction over ``T`` expects, and ``S =
    H_r T^2/2 + H_v T``, the acceleration ``d = (S' R^-1 S + W I)^-1 S' R^-1 e`` explains ``e`` best; the
    state is moved to where it would have led, and the Kalman update takes the same measurements again. Where
    no sensor of the epoch speaks of velocity nothing is estimated.

    What it is: a Kalman estimate of a white acceleration of variance ``1/W`` that takes the state to be
    exact, so a floor under the velocity gain. An extended Kalman filter whose process noise is raised to the
    same gain is as accurate and knows its covariance; that of this filter is too small unless ``accounted``.

    Parameters
    ----------
    dynamics : Strapdown
        Inertial navigation.
    state : NavState
        Estimate at ``time``, of shape ``()`` or ``(runs,)``.
    covariance : (n, n) or (runs, n, n)
        Of its error.
    weight : float
        ``W``, inverse variance of the acceleration, s^4/m^2. Infinite: the Kalman filter; 0: whatever
        explains the measurements.
    accounted : bool
        Is the uncertainty of ``d`` added to the covariance? The published filter does not.
    expectation : {"integrated", "series"}
        What ``e`` is measured against: the prediction itself, all samples of the unit in it; or, as
        published, ``h + sum T^k/k! L_f^k h`` at the epoch before, under the mean of the samples. They differ
        by ``T^3`` in pixels and ``T^2`` in velocity.
    gate, relock_after, iterations, underweighting, form, consider, time
        As for :class:`losnav.ExtendedKalmanFilter`.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, a covariance that is not positive definite or impossible options.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> model = ln.dynamics.Strapdown(
    ...     ln.dynamics.Site.inertial(), ln.gravity.Uniform([0, 0, -4e-3]), ln.dynamics.Imu.navigation()
    ... )
    >>> start = ln.NavState([0.0, 0.0, 100.0], [0.0, 0.0, -1.0], [0.0, 0.0, 0.0, 1.0])
    >>> npf = ln.PredictiveFilter(model, start, 1e-4 * np.eye(15), weight=1e4)
    >>> npf.predict(1.0, ([0.0, 0.0, 4e-3], [0.0, 0.0, 0.0]))
    >>> step = npf.update(ln.sensors.Velocimeter(0.01), [0.0, 0.0, -1.02])
    >>> npf.model_error.round(4)
    array([ 0.  ,  0.  , -0.01])
    """

    __slots__ = ()

    def __init__(
        self,
        dynamics: Strapdown,
        state: NavState,
        covariance: ArrayLike,
        *,
        weight: float = 1e4,
        accounted: bool = False,
        expectation: str = "integrated",
        gate: float | None = None,
        relock_after: int | None = 3,
        iterations: int = 1,
        underweighting: float = 0.0,
        form: str = "joseph",
        consider: Sequence[int] = (),
        time: float = 0.0,
    ) -> None:
        if not isinstance(dynamics, Strapdown):
            raise InvalidInputError(f"dynamics: expected a Strapdown, got {type(dynamics).__name__}")
        given: dict[str, Any] = {
            "gate": gate,
            "relock_after": relock_after,
            "iterations": iterations,
            "underweighting": underweighting,
            "form": form,
            "consider": consider,
        }
        if expectation not in {"integrated", "series"}:
            raise InvalidInputError(f'expectation: expected "integrated" or "series", got {expectation!r}')
        stage = _weight(weight), bool(accounted), expectation == "series"
        options = checked(given, dynamics.state_size)
        options.update(adaptive=None, stage=stage)
        self._begin(dynamics, state, covariance, options, time, stage)

    @property
    def model_error(self) -> FloatArray:
        """The acceleration last estimated, site axes, m/s^2: ``(3,)`` or ``(runs, 3)``."""
        return self._engine.model_error().reshape((*self._lead, 3))

    def epoch(self, measurements: Sequence[tuple[Any, ArrayLike]], **context: Any) -> list[Step]:
        """Take the measurements of several sensors at one time, explained together.

        Parameters
        ----------
        measurements : sequence of (sensor, z)
            Built-in sensors with their measurements, ``(M,)`` each.
        **context
            As for :meth:`update`.

        Returns
        -------
        list of Step
            One for each sensor.

        Raises
        ------
        InvalidInputError, DegenerateGeometryError, NumericalError
            As :meth:`update`.
        """
        steps = self._engine.step(None, pairs_of(measurements), None, context, None)
        if steps is None:
            raise InvalidInputError("measurements: a predictive filter takes built-in sensors")
        return list(steps)

    def _anew(self, dynamics: Any, state: NavState, options: dict[str, Any], time: float) -> None:
        self._begin(dynamics, state, unit_covariance(dynamics, state), options, time, options["stage"])


def _weight(value: Any) -> float:
    if value == float("inf"):
        # Beyond any information of a sensor, and still a number to divide by.
        return 1e300
    number = finite(value, "weight")
    if number.ndim or number < 0.0:
        raise InvalidInputError(f"weight: expected a number >= 0, got {value!r}")
    return float(number)
