"""Directions to the Sun and to planets, as a spacecraft on its way between them sees them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, positive
from losnav.errors import InvalidInputError
from losnav.sensors.listed import NO_TURN, Listed, turns_with, velocity_needed


class _Celestial(Listed):
    """What directions to one body share: isotropic noise, an attitude that may be missing."""

    unit_vectors: ClassVar[bool] = True
    sigma: float
    aberration: bool

    def _hold(self, sigma: ArrayLike, **switches: bool) -> None:
        value = positive(sigma, "sigma")
        if value.ndim:
            raise InvalidInputError(f"sigma: expected a number, got shape {value.shape}")
        object.__setattr__(self, "sigma", float(value))
        for name, switch in switches.items():
            if not isinstance(switch, (bool, np.bool_)):
                raise InvalidInputError(f"{name}: expected True or False, got {switch!r}")
            object.__setattr__(self, name, bool(switch))

    def _variances(self) -> FloatArray:
        return self.sigma**2 * np.eye(3)

    def _disturbed(self, exact: FloatArray, rng: np.random.Generator | int | None) -> FloatArray:
        """Across the direction by ``sigma``, then unit again."""
        noise = self.sigma * np.asarray(np.random.default_rng(rng).standard_normal(exact.shape))
        noise -= np.einsum("...i,...i->...", noise, exact)[..., np.newaxis] * exact
        measured: FloatArray = exact + noise
        measured /= np.linalg.norm(measured, axis=-1, keepdims=True)
        return measured

    def _sight(
        self, state: Any, dcm: ArrayLike | None, parameter: FloatArray, name: str
    ) -> tuple[FloatArray, FloatArray]:
        if dcm is None and not turns_with(state):
            dcm = NO_TURN
        predicted, jacobian = self._ask(state, dcm, parameter, name=name, core=1)
        if self.aberration:
            velocity_needed(state, jacobian, "aberration")
        return predicted, jacobian


@dataclass(frozen=True, eq=False, init=False)
class SunDirection(_Celestial):
    """Unit vector from the observer to the Sun at the origin of a heliocentric state (equation D1).

    Measurement ``(..., 3)``: ``dcm @ (-r / |r|)``, two degrees of freedom. Without ``dcm=`` the components
    are those of the state's axes: a direction that a star tracker has already turned into them.

    A real sensor sees the Sun displaced by stellar aberration, up to 1.1e-4 rad (23") in an orbit like the
    Earth's. Left out of the model it looks like another orbit: at 5e-5 rad of noise the estimate is 1.7e4 km
    off while the NIS stays at 2.00. So measurements either are corrected before they come here
    (``losnav.star_tracker.remove_aberration``) and ``aberration`` stays False, or are not and it must be
    True. The Sun stands still in a heliocentric frame: its light time is no matter (5e-8 rad at most).

    Parameters
    ----------
    sigma : float
        1-sigma noise, rad per axis.
    aberration : bool, optional
        Predict the direction a moving observer sees (equation T11, exact), which needs the velocity, rather
        than the geometric one.

    Raises
    ------
    InvalidInputError
        On a ``sigma`` that is not a positive number, or a switch that is none.

    Examples
    --------
    >>> import losnav as ln
    >>> state = [0.0, 2.0e11, 0.0, -2.5e4, 0.0, 0.0]  # [r v], heliocentric, m and m/s
    >>> ln.sensors.SunDirection(5e-5).predict(state)
    array([ 0., -1.,  0.])
    >>> apparent = ln.sensors.SunDirection(5e-5, aberration=True).predict(state)
    >>> (1e6 * apparent[:2]).round(1).tolist()  # turned towards the velocity by v/c
    [-83.4, -1000000.0]
    >>> ln.sensors.SunDirection(5e-5).jacobian(state).shape
    (3, 6)
    """

    sigma: float
    aberration: bool

    def __init__(self, sigma: float, *, aberration: bool = False) -> None:
        self._hold(sigma, aberration=aberration)
        seen = np.array([float(self.aberration)])
        seen.flags.writeable = False
        object.__setattr__(self, "_seen", seen)

    def predict(self, state: Any, *, dcm: ArrayLike | None = None) -> FloatArray:
        """Direction expected at a state.

        Parameters
        ----------
        state : (..., 6), (..., 3) or (position, mrp)
            Heliocentric ``[r v]``, m and m/s; see the module. Aberration needs the velocity.
        dcm : (..., 3, 3), optional
            Known attitude, body from reference; none leaves the components in the axes of the state.

        Returns
        -------
        (..., 3)
            Unit vector.

        Raises
        ------
        InvalidInputError
            On wrong shapes, NaN, infinity, a missing velocity, or a state at the Sun's centre.
        """
        return self._sight(state, dcm, self._place(), "aberration")[0]

    def jacobian(self, state: Any, *, dcm: ArrayLike | None = None) -> FloatArray:
        """Derivative of :meth:`predict` along the state's tangent.

        Parameters
        ----------
        state, dcm
            As for :meth:`predict`.

        Returns
        -------
        (..., 3, K)
            Columns ``[dr]``, ``[dr dv]`` or ``[dp dalpha]``; those of the velocity are zero without
            aberration.

        Raises
        ------
        InvalidInputError
            As :meth:`predict`.
        """
        return self._sight(state, dcm, self._place(), "aberration")[1]

    def noise(self, state: Any = None, *, dcm: ArrayLike | None = None) -> FloatArray:
        """Covariance of the measurement: isotropic, ``sigma^2 I``; filters take what is across the direction.

        Parameters
        ----------
        state, dcm
            As for :meth:`predict`; they do not matter here.

        Returns
        -------
        (3, 3)
            rad^2.
        """
        del state, dcm
        return self._variances()

    def simulate(
        self, state: Any, rng: np.random.Generator | int | None = None, *, dcm: ArrayLike | None = None
    ) -> FloatArray:
        """Measurement with noise: disturbed across the direction by ``sigma``, then unit again.

        Parameters
        ----------
        state, dcm
            As for :meth:`predict`.
        rng : numpy.random.Generator or seed
            Source of the noise.

        Returns
        -------
        (..., 3)
            Unit vector.

        Raises
        ------
        InvalidInputError
            As :meth:`predict`.
        """
        return self._disturbed(self.predict(state, dcm=dcm), rng)

    def _place(self) -> FloatArray:
        place: FloatArray = self.__dict__["_seen"]
        return place
