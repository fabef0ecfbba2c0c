"""One block of Monte Carlo runs: every configuration, fused from its stars, all runs as one batch.

1. Draw a random attitude and, for each head, stars spread evenly over its detector; measure them with the
   noise of the head.
2. Solve one Wahba problem over all heads (image-level fusion).
3. On the same stars, where a claim asks for it: combine the attitudes of the heads (attitude-level fusion);
   weigh all stars alike; assume a wrong mounting.
4. For heads given by their accuracy alone, draw attitudes and combine them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.random import Generator, SeedSequence, default_rng
from numpy.typing import NDArray

import losnav as ln
from losnav import star_tracker
from losnav.attitude import dcm_from_mrp, dcm_from_quaternion, rotation_error
from losnav.scenarios.star_tracker.cases import Case, all_cases

if TYPE_CHECKING:
    from losnav.scenarios.star_tracker import StarTracker

__all__ = ["ATTITUDE_LEVEL", "MISMOUNTED", "StarTrackerTask", "mounting_errors", "random_attitudes"]

Array = NDArray[np.float64]
_Solution: TypeAlias = "ln.AttitudeSolution | star_tracker.FusedAttitude"

#: Configurations whose heads are also combined by their attitudes.
ATTITUDE_LEVEL = ("orthogonal", "few 2+2+2", "few 2+1+0")
#: Number of the head that is mounted wrongly.
MISMOUNTED = 1


@dataclass(frozen=True)
class Images:
    """Images of one configuration, run by run.

    Attributes
    ----------
    dcm : (runs, images, 3, 3)
        True attitude, fusion frame from catalogue.
    body, reference : one array (runs, images, N_n, 3) for each head
        Measured directions in head axes, and true ones in the catalogue's.
    """

    dcm: Array
    body: list[Array]
    reference: list[Array]


def mounting_errors(scenario: StarTracker) -> dict[str, Array]:
    """Mounting error of head 2, across and about its boresight, fusion axes, rad."""
    return {"across": scenario.mounting_error * np.eye(3)[1], "about": scenario.mounting_error * np.eye(3)[0]}


@dataclass(frozen=True)
class StarTrackerTask:
    """The task of the campaign: seeds of a block in, arrays with one row for each run out."""

    scenario: StarTracker

    @cached_property
    def cases(self) -> list[Case]:
        return all_cases(self.scenario)

    def __call__(self, seeds: Sequence[SeedSequence], /) -> dict[str, NDArray[Any]]:
        # One stream for each configuration, so that a change of one leaves the others' numbers alone.
        streams = [[default_rng(child) for child in seed.spawn(len(self.cases) + 2)] for seed in seeds]
        arrays = self._unequal([stream[0] for stream in streams])
        for k, case in enumerate(self.cases):
            rngs = [stream[k + 2] for stream in streams]
            images = _images(case, rngs)
            arrays |= _judged(case.key, images.dcm, _fuse(case.heads, images))
            if case.key == "pixel":
                # Every star with the sigma of one on the axis, as if all noise were the same angle.
                alike = tuple(replace(head, noise=_on_axis(head)) for head in case.heads)
                arrays |= _judged("pixel alike", images.dcm, _fuse(alike, images))
            if case.key in ATTITUDE_LEVEL:
                arrays |= _judged(f"{case.key} attitudes", images.dcm, _attitude_level(case, images))
            if case.key == "weighted":
                alike = tuple(replace(head, noise=self.scenario.star_sigma) for head in case.heads)
                arrays |= _judged("weighted alike", images.dcm, _fuse(alike, images))
            if case.key == "orthogonal":
                for name, error in mounting_errors(self.scenario).items():
                    heads = _mismounted(case.heads, error)
                    arrays |= _judged(f"mismounted {name}", images.dcm, _fuse(heads, images))
        return arrays

    def _unequal(self, rngs: Sequence[Generator]) -> dict[str, NDArray[Any]]:
        """Orthogonal heads that are known by the accuracy of their attitudes only."""
        heads = next(case.heads for case in self.cases if case.key == "orthogonal")
        sigmas = np.array(self.scenario.unequal_sigmas)
        dcm = np.stack([random_attitudes(rng, 1) for rng in rngs])
        error = sigmas * np.stack([rng.standard_normal((1, len(heads), 3)) for rng in rngs])
        mountings = np.stack([head.mounting for head in heads])
        # The error is true minus estimate: the estimate is turned back by it.
        attitudes = dcm_from_mrp(-error / 4) @ np.swapaxes(mountings, -1, -2) @ dcm[:, :, None]
        covariances = sigmas[..., None] ** 2 * np.eye(3)
        fused = star_tracker.fuse_attitudes(heads, attitudes, covariances, exclude=False)
        return _judged("unequal", dcm, fused)


def random_attitudes(rng: Generator, count: int) -> Array:
    """Random attitudes, all orientations alike, (count, 3, 3)."""
    quaternion = rng.standard_normal((count, 4))
    return dcm_from_quaternion(quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True))


def _images(case: Case, rngs: Sequence[Generator]) -> Images:
    dcm = np.stack([random_attitudes(rng, case.images) for rng in rngs])
    body, reference = [], []
    for head, count in zip(case.heads, case.stars, strict=True):
        true = np.stack([head.stars(case.images * count, rng) for rng in rngs])
        true = true.reshape(len(rngs), case.images, count, 3)
        body.append(np.stack([head.measure(stars, rng) for stars, rng in zip(true, rngs, strict=True)]))
        reference.append(true @ head.mounting.T @ dcm)
    return Images(dcm, body, reference)


def _fuse(heads: Sequence[star_tracker.Head], images: Images) -> ln.AttitudeSolution:
    return star_tracker.fuse(heads, images.body, images.reference)


def _on_axis(head: star_tracker.Head) -> float:
    return float(head.model.sigma([0.0, 0.0, 1.0]))


def _attitude_level(case: Case, images: Images) -> star_tracker.FusedAttitude:
    """Fusion of the attitudes of those heads that have one: two stars or more."""
    shape = (*images.dcm.shape[:2], len(case.heads), 3, 3)
    attitudes, covariances = np.full(shape, np.nan), np.full(shape, np.nan)
    for n, head in enumerate(case.heads):
        if case.stars[n] >= 2:
            stars = images.body[n]
            alone = ln.solve_attitude(stars, images.reference[n], sigma=head.model.sigma(stars))
            attitudes[:, :, n], covariances[:, :, n] = alone.dcm, alone.covariance
    return star_tracker.fuse_attitudes(case.heads, attitudes, covariances, exclude=False)


def _mismounted(heads: Sequence[star_tracker.Head], error: Array) -> tuple[star_tracker.Head, ...]:
    """The heads as a user believes them to be, when the true mounting of one is turned by ``error``."""
    wrong = heads[MISMOUNTED]
    # An MRP is a quarter of a small rotation; dcm(mrp) turns the axes by it.
    believed = dcm_from_mrp(error / 4).T @ wrong.mounting
    return tuple(replace(head, mounting=believed) if head is wrong else head for head in heads)


def _judged(key: str, dcm: Array, solution: _Solution) -> dict[str, NDArray[Any]]:
    """Errors (true minus estimate) in fusion axes, 1-sigma and NEES of every image."""
    error = rotation_error(dcm, solution.dcm)
    covariance = np.asarray(solution.covariance)
    solved = np.linalg.solve(covariance, error[..., None])[..., 0]
    return {
        f"{key}_error": error,
        f"{key}_sigma": np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1)),
        f"{key}_nees": np.sum(error * solved, axis=-1),
    }
