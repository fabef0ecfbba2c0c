"""One block of Monte Carlo landings, solved as batches.

1. Descent. All landings of the block advance together, one batch for each epoch, each warm-started with its
   own previous estimate, with three estimators on the same measurements: the converged maximum-likelihood
   estimate ("ml"), and the publication's GLSDC ("glsdc") and Levenberg–Marquardt ("lm") with the
   publication's stop test.
2. Cold starts. At a few epochs, guesses scattered widely about the truth, for Gauss–Newton and
   Levenberg–Marquardt; and the same images without any guess.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import Generator, SeedSequence, default_rng
from numpy.typing import NDArray

import losnav as ln
from losnav.attitude import mrp_from_dcm, rotation_error
from losnav.consistency import chi2_quantile
from losnav.scenarios.landmark_landing.descent import (
    focal_plane_covariance,
    perturb_los,
    rotation_from_vector,
)

if TYPE_CHECKING:
    from losnav.scenarios.landmark_landing import LandmarkLanding

__all__ = ["SUCCESS_NEES", "LandingTask"]

Array = NDArray[np.float64]

#: A pose belongs to the right minimum if its NEES is below the 1 − 10⁻⁹ quantile of chi²(6): noise alone
#: exceeds it once in 10⁹.
SUCCESS_NEES = float(chi2_quantile(1 - 1e-9, 6))


@dataclass(frozen=True)
class LandingTask:
    """The task of the campaign: seeds of a block in, arrays with one row for each landing out."""

    scenario: LandmarkLanding

    def __call__(self, seeds: Sequence[SeedSequence], /) -> dict[str, NDArray[Any]]:
        # One stream for each study, so that a change of one leaves the other's numbers alone.
        streams = [[default_rng(child) for child in seed.spawn(2)] for seed in seeds]
        arrays = self._descents([pair[0] for pair in streams])
        arrays.update(self._cold_starts([pair[1] for pair in streams]))
        return arrays

    def _descents(self, rngs: Sequence[Generator]) -> dict[str, NDArray[Any]]:
        s, descent = self.scenario, self.scenario.descent
        first = np.stack([self._first_guess(rng) for rng in rngs])
        noise = np.stack([rng.standard_normal(descent.los.shape) for rng in rngs])
        drift = np.stack([rng.standard_normal(6) for rng in rngs])
        los = perturb_los(descent.los, noise, s.noise, s.focal_length, s.focal_plane_sigma)
        paper = {"parametrization": "mrp", "cost_tolerance": s.cost_tolerance, "step_tolerance": 0.0}
        paper["max_iterations"] = s.max_iterations
        options: dict[str, dict[str, Any]] = {
            "ml": {"method": "lm"},
            "glsdc": {"method": "gauss-newton", **paper},
            "lm": {"method": "lm", "damping": s.damping, **paper},
        }
        arrays: dict[str, NDArray[Any]] = {"drift": drift}
        for name, option in options.items():
            guess, epochs = first, []
            for k in range(len(descent.times)):
                solution = self._solve(los[:, k], guess=guess, **option)
                epochs.append(self._judge(solution, descent.position[k], descent.dcm[k]))
                guess = np.concatenate([solution.position, solution.mrp], axis=-1)
            arrays |= {f"{name}_{key}": np.stack([e[key] for e in epochs], axis=1) for key in epochs[0]}
        return arrays

    def _first_guess(self, rng: Generator) -> Array:
        s, descent = self.scenario, self.scenario.descent
        offset = rng.standard_normal((2, 3))
        turn = rotation_from_vector(s.guess_attitude_sigma * offset[1])
        position = descent.position[0] + s.guess_position_sigma * offset[0]
        return np.concatenate([position, mrp_from_dcm(turn @ descent.dcm[0])])

    def _solve(self, los: Array, **options: Any) -> ln.PoseSolution:
        s = self.scenario
        if s.noise == "tangent":
            return ln.solve_pose(s.descent.landmarks, los, sigma=s.los_sigma, **options)
        covariance = focal_plane_covariance(los, s.focal_length, s.focal_plane_sigma)
        return ln.solve_pose(s.descent.landmarks, los, covariance=covariance, **options)

    def _judge(self, solution: ln.PoseSolution, position: Array, dcm: Array) -> dict[str, NDArray[Any]]:
        """Errors (true minus estimate), NEES, chi², iterations and termination of a batch of poses."""
        error = np.concatenate([position - solution.position, rotation_error(dcm, solution.dcm)], axis=-1)
        return {
            "error": error,
            "nees": _nees(error, solution.covariance),
            "chi2": np.asarray(solution.chi2),
            "iterations": np.asarray(solution.iterations),
            "converged": np.asarray(solution.converged),
        }

    def _cold_starts(self, rngs: Sequence[Generator]) -> dict[str, NDArray[Any]]:
        s = self.scenario
        descent = s.descent_at([s.sampling * round(t / s.sampling) for t in s.cold_times])
        shape = (len(s.cold_times), len(s.cold_offsets), len(s.cold_angles))
        noise = np.stack([rng.standard_normal(descent.los.shape) for rng in rngs])
        los = perturb_los(descent.los, noise, s.noise, s.focal_length, s.focal_plane_sigma)
        guess = np.stack([self._cold_guesses(rng, descent.position, descent.dcm, shape) for rng in rngs])
        options = {"parametrization": "mrp", "cost_tolerance": s.cold_cost_tolerance, "step_tolerance": 0.0}
        arrays: dict[str, NDArray[Any]] = {}
        for name, method in (("gn", "gauss-newton"), ("lm", "lm")):
            solution = self._solve(
                np.broadcast_to(los[:, :, None, None], (len(rngs), *shape, *los.shape[-2:])),
                guess=guess,
                method=method,
                damping=s.damping,
                max_iterations=s.cold_max_iterations,
                **options,
            )
            judged = self._judge(solution, descent.position[:, None, None], descent.dcm[:, None, None])
            arrays[f"cold_{name}_success"] = judged["nees"] < SUCCESS_NEES
            arrays[f"cold_{name}_converged"] = judged["converged"]
            arrays[f"cold_{name}_iterations"] = judged["iterations"]
        free = self._judge(self._solve(los), descent.position, descent.dcm)
        arrays["free_success"] = free["nees"] < SUCCESS_NEES
        arrays["free_converged"] = free["converged"]
        return arrays

    def _cold_guesses(
        self, rng: Generator, position: Array, dcm: Array, shape: tuple[int, int, int]
    ) -> Array:
        """Guesses (epochs, offsets, angles, 6), normally distributed with the grid's spreads about the
        truth."""
        s = self.scenario
        normal = rng.standard_normal((2, *shape, 3))
        scale = np.linalg.norm(position, axis=-1) / np.linalg.norm(s.initial_position)
        spread = scale[:, None] * np.array(s.cold_offsets)
        turn = rotation_from_vector(np.array(s.cold_angles)[:, None] * normal[1])
        moved = position[:, None, None] + spread[:, :, None, None] * normal[0]
        return np.concatenate([moved, mrp_from_dcm(turn @ dcm[:, None, None])], axis=-1)


def _nees(error: Array, covariance: Array) -> Array:
    """Normalised squared errors e' P⁻¹ e; NaN where the solver has no usable covariance to report."""
    # Symmetric scaling first: the position and attitude blocks differ by ten decades.
    with np.errstate(all="ignore"):
        scale = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
        correlation = covariance / (scale[..., :, None] * scale[..., None, :])
        scaled = error / scale
        # A start that ran off to infinity leaves a covariance that is singular to rounding, or none.
        known = np.isfinite(scaled).all(axis=-1) & (np.nan_to_num(np.linalg.det(correlation)) > 0)
    nees = np.full(error.shape[:-1], np.nan)
    solved = np.linalg.solve(correlation[known], scaled[known][..., None])[..., 0]
    nees[known] = np.sum(scaled[known] * solved, axis=-1)
    nees[nees < 0] = np.nan
    return nees
