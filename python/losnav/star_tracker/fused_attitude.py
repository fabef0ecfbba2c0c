"""What a fusion returns: the attitude, how well it is known, and which heads stand behind it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from losnav import attitude
from losnav._arrays import FloatArray
from losnav.consistency import chi2_sf

__all__ = ["FusedAttitude"]

BoolArray = npt.NDArray[np.bool_]
ARCSEC = float(np.radians(1.0 / 3600.0))


@dataclass(frozen=True, eq=False, repr=False)
class FusedAttitude:
    """Attitude of the fusion frame from several heads; every array has the batch shape ``(...)``.

    Attributes
    ----------
    dcm : (..., 3, 3)
        Fusion from reference; NaN where no head had an attitude.
    covariance : (..., 3, 3)
        Of ``dalpha`` in fusion axes, rad^2, of the heads used.
    chi2 : (...)
        Of the heads used about the fused attitude.
    dof : (...)
        ``3 (heads used - 1)``.
    head_chi2 : (..., N)
        Of each head against the fusion of the others in use, 3 degrees of freedom; NaN where a head has no
        attitude or no other has.
    disagreement : (..., N, 3)
        Head less the fusion of the others in use: ``dalpha`` in fusion axes, rad.
    used, blind : (..., N) bool
        Heads behind the answer; heads without an attitude.
    suspects, excluded : (..., N) bool
        Heads without which the others agree, where some contradict; and those of them that were left out.
    decided : (...) bool
        Which heads are wrong is known: none contradicts, or one set of suspects alone explains it. Otherwise
        at least one of the suspects is wrong, and the geometry cannot tell which.
    consistent : (...) bool
        The heads in use agree. False where nobody is above suspicion, as always with two heads.
    converged : (...) bool
        There is an attitude and the iteration arrived at it.
    names : tuple of str
        Of the heads.
    """

    dcm: FloatArray
    covariance: FloatArray
    chi2: FloatArray
    dof: npt.NDArray[np.int64]
    head_chi2: FloatArray
    disagreement: FloatArray
    used: BoolArray
    blind: BoolArray
    suspects: BoolArray
    excluded: BoolArray
    decided: BoolArray
    consistent: BoolArray
    converged: BoolArray
    names: tuple[str, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Batch shape; ``()`` for one problem."""
        return self.dcm.shape[:-2]

    @property
    def quaternion(self) -> FloatArray:
        """``(..., 4)``, scalar last, ``w >= 0``."""
        return self._converted(attitude.quaternion_from_dcm, 4)

    @property
    def mrp(self) -> FloatArray:
        """Modified Rodrigues parameters ``(..., 3)``."""
        return self._converted(attitude.mrp_from_dcm, 3)

    @property
    def information(self) -> FloatArray:
        """Inverse of the covariance, 1/rad^2."""
        return np.asarray(np.linalg.inv(self.covariance))

    @property
    def loss(self) -> FloatArray:
        """``chi2 / 2``."""
        return np.asarray(0.5 * self.chi2)

    @property
    def rank(self) -> npt.NDArray[np.int64]:
        """Axes about which the attitude is known: 3, or 0 where no head had one."""
        return np.where(self.used.any(axis=-1), 3, 0)

    @property
    def free_axis(self) -> FloatArray:
        """NaN ``(..., 3)``: heads with attitudes of their own leave no axis free."""
        return np.full((*self.shape, 3), np.nan)

    @property
    def p_value(self) -> FloatArray:
        """Probability of a larger ``chi2`` if all heads in use are right, ``(...)``; 1 without redundancy."""
        return np.asarray(np.where(self.dof > 0, chi2_sf(self.chi2, np.maximum(self.dof, 1)), 1.0))

    @property
    def head_p_value(self) -> FloatArray:
        """Probability of a larger ``head_chi2`` if that head and the others are right, ``(..., N)``."""
        return np.asarray(chi2_sf(self.head_chi2, 3))

    @property
    def suspected(self) -> tuple[str, ...]:
        """Names of the suspects (of one problem)."""
        return tuple(n for n, suspect in zip(self.names, self.suspects, strict=True) if suspect)

    @property
    def faulty(self) -> tuple[str, ...]:
        """Names of the heads that must be wrong: the suspects, if nothing else explains the contradiction."""
        return self.suspected if self.decided else ()

    def __getitem__(self, index: Any) -> FusedAttitude:
        """One problem of a batch, or several."""
        return self._changed(lambda array: np.asarray(array[index]))

    def reshaped(self, shape: tuple[int, ...]) -> FusedAttitude:
        """The same problems in another batch shape.

        Parameters
        ----------
        shape : tuple of int
            As many problems as now.

        Returns
        -------
        FusedAttitude
        """
        lead = len(self.shape)
        return self._changed(lambda array: np.reshape(array, (*shape, *array.shape[lead:])))

    def __repr__(self) -> str:
        if self.shape:
            return (
                f"FusedAttitude(shape={self.shape}, converged {int(self.converged.sum())} of "
                f"{self.converged.size}, consistent {int(self.consistent.sum())})"
            )
        sigma = np.sqrt(np.diag(self.covariance)) / ARCSEC
        spread = ", ".join(f"{s:.3g}" for s in sigma)
        return (
            f"FusedAttitude({int(self.used.sum())} of {len(self.names)} heads, 1-sigma [{spread}] arcsec, "
            f"chi2={self.chi2:.4g} for {self.dof} dof, consistent={bool(self.consistent)})"
        )

    def __str__(self) -> str:
        if self.shape:
            return repr(self)
        return "\n".join([repr(self), *(_sentence(self, n) for n in range(len(self.names)))])

    def _changed(self, function: Callable[[Any], Any]) -> FusedAttitude:
        arrays = [f.name for f in fields(self) if f.name != "names"]
        changes: dict[str, Any] = {name: function(getattr(self, name)) for name in arrays}
        return replace(self, **changes)

    def _converted(self, function: Any, size: int) -> FloatArray:
        seen = self.used.any(axis=-1)
        result = np.full((*self.shape, size), np.nan)
        result[seen] = function(self.dcm[seen])
        return result


def _sentence(fused: FusedAttitude, n: int) -> str:
    """One line on one head."""
    head = f"head {fused.names[n]}"
    if fused.blind[n]:
        return f"{head}: blind, no attitude"
    if np.isnan(fused.head_chi2[n]):
        return f"{head}: used, nothing to compare it with"
    numbers = (
        f"chi2 {fused.head_chi2[n]:.4g} for 3 dof, p = {float(fused.head_p_value[n]):.2g}, off by "
        f"{np.linalg.norm(fused.disagreement[n]) / ARCSEC:.3g} arcsec"
    )
    state = "left out" if fused.excluded[n] else "used"
    if not fused.suspects[n]:
        return f"{head}: {state} ({numbers})"
    if fused.decided:
        return f"{head}: {state}, contradicts the others ({numbers})"
    return f"{head}: {state}, {' or '.join(fused.suspected)} is wrong ({numbers})"
