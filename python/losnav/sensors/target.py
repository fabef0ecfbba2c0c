"""Sensors of one target: a camera with a laser, a distance, a rate of distance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, positive, vectors
from losnav.errors import InvalidInputError
from losnav.sensors.listed import NO_TURN, Listed, turns_with, velocity_needed, wrapped

ORIGIN = (0.0, 0.0, 0.0)


class _OfTarget(Listed):
    """What sensors of one target share: standard deviations that are numbers, and a place."""

    sigmas: ClassVar[tuple[str, ...]]
    needs_attitude: ClassVar[bool] = False
    needs_velocity: ClassVar[bool] = False
    told: ClassVar[tuple[str, ...]] = ("target",)
    target: FloatArray

    def _hold(self, target: ArrayLike, **sigmas: ArrayLike) -> None:
        for name, sigma in sigmas.items():
            value = positive(sigma, name)
            if value.ndim:
                raise InvalidInputError(f"{name}: expected a number, got shape {value.shape}")
            object.__setattr__(self, name, float(value))
        place = vectors(target, "target").copy()
        if place.ndim != 1:
            raise InvalidInputError(f"target: expected shape (3,), got {place.shape}")
        place.flags.writeable = False
        object.__setattr__(self, "target", place)

    def predict(
        self, state: Any, *, dcm: ArrayLike | None = None, target: ArrayLike | None = None
    ) -> FloatArray:
        """Measurement expected at a state.

        Parameters
        ----------
        state : (..., 3), (..., 6), (position, mrp) or NavState
            See the module.
        dcm : (..., 3, 3), optional
            Known attitude, body from reference, where the state has none; ignored by a sensor that does not
            need it.
        target : (3,) or (..., 3), optional
            In place of the sensor's.

        Returns
        -------
        (..., M)
            See the class.

        Raises
        ------
        InvalidInputError
            On wrong shapes, a missing attitude or velocity, NaN, infinity, or where the measurement is
            undefined.
        """
        predicted, _ = self._linearize(state, dcm, target)
        for column in self.angles:
            # Read off as minus an innovation, whose interval is closed at the other end.
            predicted[..., column] = wrapped(predicted[..., column])
        return predicted

    def jacobian(
        self, state: Any, *, dcm: ArrayLike | None = None, target: ArrayLike | None = None
    ) -> FloatArray:
        """Derivative of :meth:`predict` along the state's tangent.

        Parameters
        ----------
        state, dcm, target
            As for :meth:`predict`.

        Returns
        -------
        (..., M, K)
            Columns ``[dr]``, ``[dr dv]``, ``[dp dalpha]`` or the 15 of a NavState.

        Raises
        ------
        InvalidInputError
            As :meth:`predict`.
        """
        return self._linearize(state, dcm, target)[1]

    def noise(
        self, state: Any = None, *, dcm: ArrayLike | None = None, target: ArrayLike | None = None
    ) -> FloatArray:
        """Covariance of the measurement, the same everywhere.

        Parameters
        ----------
        state, dcm, target
            As for :meth:`predict`; they do not matter here.

        Returns
        -------
        (M, M)
            Diagonal, squares of the standard deviations.
        """
        del state, dcm, target
        return np.diag(np.square(self._deviations()))

    def simulate(
        self,
        state: Any,
        rng: np.random.Generator | int | None = None,
        *,
        dcm: ArrayLike | None = None,
        target: ArrayLike | None = None,
    ) -> FloatArray:
        """Measurement with Gaussian noise, angles wrapped.

        Parameters
        ----------
        state, dcm, target
            As for :meth:`predict`.
        rng : numpy.random.Generator or seed
            Source of the noise.

        Returns
        -------
        (..., M)
            See the class.

        Raises
        ------
        InvalidInputError
            As :meth:`predict`.
        """
        exact = self.predict(state, dcm=dcm, target=target)
        draws = np.asarray(np.random.default_rng(rng).standard_normal(exact.shape))
        measured: FloatArray = exact + draws * self._deviations()
        for column in self.angles:
            measured[..., column] = wrapped(measured[..., column])
        return measured

    def _deviations(self) -> FloatArray:
        return np.array([getattr(self, name) for name in self.sigmas])

    def _linearize(
        self, state: Any, dcm: ArrayLike | None, target: ArrayLike | None
    ) -> tuple[FloatArray, FloatArray]:
        place = self.target if target is None else vectors(target, "target")
        if not self.needs_attitude and not turns_with(state):
            dcm = NO_TURN
        predicted, jacobian = self._ask(state, dcm, place, name="target", core=1)
        if self.needs_velocity:
            velocity_needed(state, jacobian, type(self).__name__)
        return predicted, jacobian


@dataclass(frozen=True, eq=False, init=False)
class RangeBearing(_OfTarget):
    """Range, azimuth and elevation of a target in body axes: a camera with a laser, boresight +x.

    Measurement ``(..., 3)``: with ``L = dcm @ (target - r)``, ``[|L|, atan2(L2, L1), atan2(L3, hypot(L1,
    L2))]``, m and rad, azimuth in (-pi, pi] from +x towards +y, elevation towards +z. Li, Yang & Li 2008,
    equation 8 (with ``atan2``). Undefined at the target, and the azimuth straight along the body's z axis.

    Parameters
    ----------
    sigma_range : float
        1-sigma noise of the range, m.
    sigma_angle : float
        1-sigma noise of azimuth and elevation, rad.
    target : (3,), optional
        Where the target is in the state's frame, m; the origin, for a state relative to it.

    Raises
    ------
    InvalidInputError
        On a standard deviation that is not positive, or a wrong shape.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> sensor = ln.sensors.RangeBearing(sigma_range=0.2, sigma_angle=6e-4)
    >>> relative = [-300.0, 0.0, 400.0, 0.1, 0.0, 0.0]  # [r v], chaser minus target
    >>> sensor.predict(relative, dcm=np.eye(3)).round(6)
    array([500.      ,   0.      ,  -0.927295])
    >>> sensor.residual([500.0, 3.1, 0.0], [500.0, -3.1, 0.0]).round(6)
    array([ 0.      , -0.083185,  0.      ])
    """

    sigma_range: float
    sigma_angle: float
    target: FloatArray

    angles: ClassVar[tuple[int, ...]] = (1, 2)
    sigmas: ClassVar[tuple[str, ...]] = ("sigma_range", "sigma_angle", "sigma_angle")
    needs_attitude: ClassVar[bool] = True

    def __init__(self, sigma_range: float, sigma_angle: float, target: ArrayLike = ORIGIN) -> None:
        self._hold(target, sigma_range=sigma_range, sigma_angle=sigma_angle)


@dataclass(frozen=True, eq=False, init=False)
class Range(_OfTarget):
    """Distance to a target: measurement ``(..., 1)``, ``|r - target|``, m. Needs no attitude.

    Parameters
    ----------
    sigma : float
        1-sigma noise, m.
    target : (3,), optional
        Where the target is in the state's frame, m; the origin, for a state relative to it.

    Raises
    ------
    InvalidInputError
        On a standard deviation that is not positive, or a wrong shape.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.sensors.Range(sigma=0.2).predict([300.0, 0.0, -400.0])
    array([500.])
    """

    sigma: float
    target: FloatArray

    sigmas: ClassVar[tuple[str, ...]] = ("sigma",)

    def __init__(self, sigma: float, target: ArrayLike = ORIGIN) -> None:
        self._hold(target, sigma=sigma)


@dataclass(frozen=True, eq=False, init=False)
class RangeRate(_OfTarget):
    """Rate of the distance to a target at rest in the state's frame, positive when they part: Doppler.

    Measurement ``(..., 1)``: ``v @ (r - target) / |r - target|``, m/s. The same in a rotating frame, and
    needs no attitude; the state must be ``[r v]``.

    Parameters
    ----------
    sigma : float
        1-sigma noise, m/s.
    target : (3,), optional
        Where the target is in the state's frame, m; the origin, for a state relative to it.

    Raises
    ------
    InvalidInputError
        On a standard deviation that is not positive, or a wrong shape.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.sensors.RangeRate(sigma=0.01).predict([300.0, 0.0, -400.0, -1.0, 5.0, 0.5])
    array([-1.])
    """

    sigma: float
    target: FloatArray

    sigmas: ClassVar[tuple[str, ...]] = ("sigma",)
    needs_velocity: ClassVar[bool] = True

    def __init__(self, sigma: float, target: ArrayLike = ORIGIN) -> None:
        self._hold(target, sigma=sigma)
