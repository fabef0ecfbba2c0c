"""What a filter leaves behind of an arc."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from losnav._arrays import FloatArray
from losnav._core import ArcRecord
from losnav.filters.backward import Travelled

__all__ = ["FilterLog"]

_FIELDS = ("state", "covariance", "nis", "accepted", "innovation")


class FilterLog:
    """An arc, or many at once: what the filter believed at every epoch, after the updates.

    Made by :meth:`ExtendedKalmanFilter.run`. Arrays are put in order when first asked for, so what is not
    looked at costs nothing. ``(...)`` is ``()`` for one arc and ``(runs,)`` for many.

    Attributes
    ----------
    time : (T,) array
        Epochs, s.
    state : (..., T, N) array
        States.
    covariance : (..., T, N, N) array
        Covariances of their errors, true minus estimate.
    innovation : (..., T, M) array
        Measured minus expected before the update, angles wrapped; NaN where nothing was measured. The
        sensors one after another.
    innovations : tuple of (..., T, M_i) arrays
        The same, sensor by sensor.
    nis : (..., T, sensors) array
        Innovations squared and normalised by their predicted covariances; NaN where nothing was measured.
    accepted : (..., T, sensors) bool array
        Which measurements were used.
    dof : (sensors,) int array
        Degrees of freedom of ``nis``: the rank of each sensor's measurement.
    sigma : (..., T, N) array
        Standard deviations, the roots of the diagonals of ``covariance``.
    """

    __slots__ = ("_arrays", "_journey", "_record", "_rows", "dof", "time")

    time: FloatArray
    dof: npt.NDArray[np.intp]

    def __init__(
        self,
        time: FloatArray,
        rows: Sequence[int],
        dof: Sequence[int] | npt.NDArray[np.intp],
        source: ArcRecord | dict[str, npt.NDArray[Any]],
        journey: Travelled,
    ) -> None:
        self.time = time
        self.dof = np.asarray(dof, dtype=np.intp)
        self._rows = tuple(rows)
        self._record = source if isinstance(source, ArcRecord) else None
        self._arrays: dict[str, npt.NDArray[Any]] = {} if isinstance(source, ArcRecord) else dict(source)
        self._journey = journey

    @property
    def state(self) -> FloatArray:
        return self._array("state")

    @property
    def covariance(self) -> FloatArray:
        return self._array("covariance")

    @property
    def innovation(self) -> FloatArray:
        return self._array("innovation")

    @property
    def innovations(self) -> tuple[FloatArray, ...]:
        whole, ends = self.innovation, np.cumsum(self._rows)
        starts = ends - np.asarray(self._rows, dtype=np.intp)
        return tuple(whole[..., a:b] for a, b in zip(starts, ends, strict=True))

    @property
    def nis(self) -> FloatArray:
        return self._array("nis")

    @property
    def accepted(self) -> npt.NDArray[np.bool_]:
        return self._array("accepted")

    @property
    def sigma(self) -> FloatArray:
        variances: FloatArray = np.diagonal(self.covariance, axis1=-2, axis2=-1)
        return np.sqrt(variances)

    def smooth(self) -> FilterLog:
        """The same arc in the light of all of it (Rauch, Tung & Striebel 1965).

        Returns
        -------
        FilterLog
            States and covariances given every measurement of the arc; innovations as they were.

        Notes
        -----
        For a linear model this is the batch least-squares solution of the arc. Where a predicted covariance
        is not positive definite (a component without uncertainty), the step back changes nothing.
        """
        if self._record is not None:
            return FilterLog(self.time, self._rows, self.dof, self._record.smooth(), self._journey)
        state, covariance = self._journey.back(self.time, self.state, self.covariance)
        arrays = {**self._arrays, "state": state, "covariance": covariance}
        return FilterLog(self.time, self._rows, self.dof, arrays, self._journey)

    def _array(self, name: str) -> npt.NDArray[Any]:
        if name not in self._arrays and self._record is not None:
            self._arrays[name] = getattr(self._record, name)()
        return self._arrays[name]

    def __repr__(self) -> str:
        shape = self.state.shape
        runs = "one arc" if len(shape) == 2 else f"{shape[0]} arcs"
        used, seen = int(self.accepted.sum()), int(np.isfinite(self.nis).sum())
        return (
            f"FilterLog({runs}, {shape[-2]} epochs, {shape[-1]} states, {used} of {seen} measurements used)"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        arrays = {name: self._array(name) for name in _FIELDS}
        return FilterLog, (self.time, self._rows, self.dof, arrays, self._journey)
