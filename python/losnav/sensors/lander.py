"""What a lander measures of the ground as a whole: its velocity against it, its height above it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, points, positive, units
from losnav.errors import InvalidInputError
from losnav.sensors.listed import NO_TURN, Listed, turns_with, velocity_needed


class _OfGround(Listed):
    """What the two share: rows of independent noise, and nothing to be told but the attitude."""

    sigma: FloatArray

    def predict(self, state: Any, *, dcm: ArrayLike | None = None) -> FloatArray:
        """Measurement expected at a state.

        Parameters
        ----------
        state : (..., 3), (..., 6), (position, mrp) or NavState
            See the module.
        dcm : (..., 3, 3), optional
            Known attitude, body from reference, where the state has none and the sensor needs it.

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
        return self._linearize(state, dcm)[0]

    def jacobian(self, state: Any, *, dcm: ArrayLike | None = None) -> FloatArray:
        """Derivative of :meth:`predict` along the state's tangent.

        Parameters
        ----------
        state, dcm
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
        return self._linearize(state, dcm)[1]

    def noise(self, state: Any = None, *, dcm: ArrayLike | None = None) -> FloatArray:
        """Covariance of the measurement, the same everywhere.

        Parameters
        ----------
        state, dcm
            As for :meth:`predict`; they do not matter here.

        Returns
        -------
        (M, M)
            Diagonal, squares of ``sigma``.
        """
        del state, dcm
        return np.diag(np.square(np.broadcast_to(self.sigma, self._rows())))

    def simulate(
        self, state: Any, rng: np.random.Generator | int | None = None, *, dcm: ArrayLike | None = None
    ) -> FloatArray:
        """Measurement with Gaussian noise.

        Parameters
        ----------
        state, dcm
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
        exact = self.predict(state, dcm=dcm)
        draws = np.asarray(np.random.default_rng(rng).standard_normal(exact.shape))
        return exact + draws * self.sigma

    def _rows(self) -> int:
        raise NotImplementedError

    def _linearize(self, state: Any, dcm: ArrayLike | None) -> tuple[FloatArray, FloatArray]:
        raise NotImplementedError


@dataclass(frozen=True, eq=False, init=False)
class Velocimeter(_OfGround):
    """Velocity in body axes, or along beams fixed to the body: a Doppler lidar or radar (L6).

    Measurement ``(..., M)``: ``dcm @ v``, m/s, of a state with a velocity; with ``beams`` ``b_i @ dcm @ v``.
    The frame is that of the ground: for a site on a rotating body ``v`` is the velocity against it. The
    sensor is at the body's origin.

    Parameters
    ----------
    sigma : float or (M,)
        1-sigma noise of each component, m/s.
    beams : (M, 3), optional
        Unit vectors in body axes; the axes themselves by default.

    Raises
    ------
    InvalidInputError
        On wrong shapes, beams that are not unit vectors, or a ``sigma`` that is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> down = np.diag([1.0, -1.0, -1.0])  # body axes East, South, down
    >>> ln.sensors.Velocimeter(0.01).predict([0.0, 0.0, 100.0, 0.25, 0.5, -2.0], dcm=down)
    array([ 0.25, -0.5 ,  2.  ])
    """

    sigma: FloatArray
    beams: FloatArray

    def __init__(self, sigma: ArrayLike, beams: ArrayLike | None = None) -> None:
        lines = np.eye(3) if beams is None else units(points(beams, "beams"), "beams").copy()
        deviation = positive(sigma, "sigma").copy()
        if deviation.shape not in ((), (len(lines),)):
            raise InvalidInputError(
                f"sigma: expected a number or shape ({len(lines)},), got {deviation.shape}"
            )
        for name, array in (("sigma", deviation), ("beams", lines)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @property
    def block(self) -> int:  # type: ignore[override]
        """Three beams are taken together, any other number one by one."""
        return 3 if len(self.beams) == 3 else 1

    def _rows(self) -> int:
        return len(self.beams)

    def _linearize(self, state: Any, dcm: ArrayLike | None) -> tuple[FloatArray, FloatArray]:
        predicted, jacobian = self._ask(state, dcm, self.beams, name="beams", core=2)
        velocity_needed(state, jacobian, "Velocimeter")
        return predicted, jacobian


@dataclass(frozen=True, eq=False, init=False)
class Altimeter(_OfGround):
    """Height above the horizon of the site, the plane ``z = 0`` of its frame (L6a).

    Measurement ``(..., 1)``, m: along the vertical, ``r_z``, whatever the attitude (a radar altimeter with a
    wide beam); or along a beam fixed to the body, ``-r_z / d_z`` with ``d = dcm.T @ boresight`` (a laser).
    A plane is no terrain: what the ground rises above it is an error, and so is the curvature of the body,
    ``s^2 / 2 R`` at the distance ``s`` from the site.

    Parameters
    ----------
    sigma : float
        1-sigma noise, m.
    boresight : (3,), optional
        Direction of the beam in body axes, a unit vector; None measures along the vertical.

    Raises
    ------
    InvalidInputError
        On a ``sigma`` that is not positive, or a ``boresight`` that is no unit vector.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> ln.sensors.Altimeter(0.5).predict([3.0, 4.0, 100.0])
    array([100.])
    >>> down = np.diag([1.0, -1.0, -1.0])  # body axes East, South, down
    >>> ln.sensors.Altimeter(0.5, boresight=[0.6, 0.0, 0.8]).predict([3.0, 4.0, 100.0], dcm=down)
    array([125.])
    """

    sigma: FloatArray
    boresight: FloatArray | None

    def __init__(self, sigma: ArrayLike, boresight: ArrayLike | None = None) -> None:
        deviation = positive(sigma, "sigma").copy()
        if deviation.ndim:
            raise InvalidInputError(f"sigma: expected a number, got shape {deviation.shape}")
        beam = None if boresight is None else units(boresight, "boresight").copy()
        if beam is not None and beam.ndim != 1:
            raise InvalidInputError(f"boresight: expected shape (3,), got {beam.shape}")
        for name, array in (("sigma", deviation), ("boresight", beam)):
            if array is not None:
                array.flags.writeable = False
            object.__setattr__(self, name, array)

    @property
    def _beam(self) -> FloatArray:
        """The beam as the engine reads it: none is empty."""
        return np.zeros(0) if self.boresight is None else self.boresight

    def _rows(self) -> int:
        return 1

    def _linearize(self, state: Any, dcm: ArrayLike | None) -> tuple[FloatArray, FloatArray]:
        if self.boresight is None and not turns_with(state):
            dcm = NO_TURN
        return self._ask(state, dcm, self._beam, name="boresight", core=1)
