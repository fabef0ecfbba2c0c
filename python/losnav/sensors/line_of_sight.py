"""Directions to known landmarks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, points, positive, vectors
from losnav.errors import InvalidInputError
from losnav.sensors.listed import Listed


@dataclass(frozen=True, eq=False, init=False)
class LineOfSight(Listed):
    """Unit directions from the observer to known landmarks, in body axes (equations 4, 7).

    Measurement ``(..., 3 N)``: the N directions one after another, ``b = dcm @ (L - p) / |L - p|``. Each has
    two degrees of freedom; to first order the third component is void. A state relative to a target sees it
    at ``landmarks=[[0, 0, 0]]``: angles-only relative navigation.

    Parameters
    ----------
    landmarks : (N, 3)
        Landmarks in the reference frame, m.
    sigma : scalar or (N,)
        1-sigma noise of each direction, rad per axis.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, or a ``sigma`` that is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> sensor = ln.sensors.LineOfSight(landmarks=[[0.0, 0.0, 10.0], [10.0, 0.0, 0.0]], sigma=1e-3)
    >>> state = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0]  # [r v]
    >>> sensor.predict(state, dcm=np.eye(3))
    array([0., 0., 1., 1., 0., 0.])
    >>> sensor.jacobian(state, dcm=np.eye(3)).shape
    (6, 6)
    """

    landmarks: FloatArray
    sigma: FloatArray

    unit_vectors: ClassVar[bool] = True
    told: ClassVar[tuple[str, ...]] = ("landmarks",)
    block: ClassVar[int] = 3

    def __init__(self, landmarks: ArrayLike, sigma: ArrayLike) -> None:
        marks, deviation = points(landmarks, "landmarks").copy(), positive(sigma, "sigma").copy()
        if deviation.shape not in ((), (len(marks),)):
            raise InvalidInputError(
                f"sigma: expected a scalar or shape ({len(marks)},), got {deviation.shape}"
            )
        for name, array in (("landmarks", marks), ("sigma", deviation)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    def predict(
        self, state: Any, *, dcm: ArrayLike | None = None, landmarks: ArrayLike | None = None
    ) -> FloatArray:
        """Measurement expected at a state.

        Parameters
        ----------
        state : (..., 3), (..., 6), (position, mrp) or NavState
            See the module.
        dcm : (..., 3, 3), optional
            Known attitude, body from reference, where the state has none.
        landmarks : (N, 3) or (..., N, 3), optional
            In place of the sensor's.

        Returns
        -------
        (..., 3 N)
            Unit vectors one after another.

        Raises
        ------
        InvalidInputError
            On wrong shapes, a missing attitude, NaN, infinity, or an observer on a landmark.
        """
        return self._linearize(state, dcm, landmarks)[0]

    def jacobian(
        self, state: Any, *, dcm: ArrayLike | None = None, landmarks: ArrayLike | None = None
    ) -> FloatArray:
        """Derivative of :meth:`predict` along the state's tangent (equation 11; attitude columns ``[b x]``).

        Parameters
        ----------
        state, dcm, landmarks
            As for :meth:`predict`.

        Returns
        -------
        (..., 3 N, K)
            Columns ``[dr]``, ``[dr dv]``, ``[dp dalpha]`` or the 15 of a NavState: 1/m, s/m, 1/rad.

        Raises
        ------
        InvalidInputError
            As :meth:`predict`.
        """
        return self._linearize(state, dcm, landmarks)[1]

    def noise(
        self, state: Any = None, *, dcm: ArrayLike | None = None, landmarks: ArrayLike | None = None
    ) -> FloatArray:
        """Covariance of the measurement: isotropic, ``sigma^2 I`` for each direction.

        Parameters
        ----------
        state, dcm, landmarks
            As for :meth:`predict`; only the number of landmarks matters here.

        Returns
        -------
        (3 N, 3 N)
            rad^2.
        """
        del state, dcm
        count = self._landmarks(landmarks).shape[-2]
        return np.diag(np.repeat(np.square(np.broadcast_to(self.sigma, count)), 3))

    def simulate(
        self,
        state: Any,
        rng: np.random.Generator | int | None = None,
        *,
        dcm: ArrayLike | None = None,
        landmarks: ArrayLike | None = None,
    ) -> FloatArray:
        """Measurement with noise: each direction disturbed across itself by ``sigma``, then unit again.

        Parameters
        ----------
        state, dcm, landmarks
            As for :meth:`predict`.
        rng : numpy.random.Generator or seed
            Source of the noise.

        Returns
        -------
        (..., 3 N)
            Unit vectors one after another.

        Raises
        ------
        InvalidInputError
            As :meth:`predict`.
        """
        exact = self.predict(state, dcm=dcm, landmarks=landmarks)
        b = exact.reshape((*exact.shape[:-1], -1, 3))
        noise = np.asarray(np.random.default_rng(rng).standard_normal(b.shape))
        noise *= np.broadcast_to(self.sigma, b.shape[-2:-1])[:, np.newaxis]
        noise -= np.einsum("...i,...i->...", noise, b)[..., np.newaxis] * b
        measured: FloatArray = b + noise
        measured /= np.linalg.norm(measured, axis=-1, keepdims=True)
        return measured.reshape(exact.shape)

    def _landmarks(self, landmarks: ArrayLike | None) -> FloatArray:
        if landmarks is None:
            return self.landmarks
        marks = vectors(landmarks, "landmarks")
        if marks.ndim < 2 or (self.sigma.ndim and marks.shape[-2] != len(self.sigma)):
            count = str(len(self.sigma)) if self.sigma.ndim else "N"
            raise InvalidInputError(f"landmarks: expected shape (..., {count}, 3), got {marks.shape}")
        return marks

    def _linearize(
        self, state: Any, dcm: ArrayLike | None, landmarks: ArrayLike | None
    ) -> tuple[FloatArray, FloatArray]:
        return self._ask(state, dcm, self._landmarks(landmarks), name="landmarks", core=2)
