"""A star tracker of several heads whose star images are fused into one attitude.

Every head measures directions of stars in its own axes; the mountings bring all of them into one frame, where
one Wahba problem gives the attitude.

    min over A of ½ Σ_n Σ_i (1/σ_ni²) ‖S_n b_ni − A r_ni‖²,     P = (Σ_n S_n P_n⁻¹ S_n')⁻¹

Source: Xiong Yazhou, Wu Yanpeng, Cheng Huiyan, "Attitude determination accuracy of multi-head star tracker
based on star-image fusion", Journal of Chinese Inertial Technology 24(5), 2016, 612–618.

What the publication leaves open, and what is used here:

* Its table of head parameters is lost: a field of 20° on 1024 pixels, centroids good to 0.1 pixel and 8 stars
  give 2.5″ across and 17.5″ about the boresight.
* Mountings take head axes to fusion axes; the fusion frame is that of head 1 unless a claim says otherwise.
* Symmetric geometry: head 1 looks along z, the others at equal angles from it and from each other, placed
  so that at 90° they look along x and y. Asymmetric: two heads at a fixed angle, the third equally far from
  both.
* Stars are spread evenly over the detector, and identified without error.

Left out: star identification, motion during the exposure, catalogue errors, and any filter.
"""

from __future__ import annotations

import concurrent.futures
import math
import os
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from losnav.campaign import Progress, run_campaign
from losnav.errors import InvalidInputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from losnav.scenarios.star_tracker.result import StarTrackerResult

__all__ = ["StarTracker"]

Vector = tuple[float, float, float]

_ARCSEC = math.radians(1 / 3600)
_BLOCK = 50  # runs solved as one batch, and the grain of the checkpoints


@dataclass(frozen=True, kw_only=True)
class StarTracker:
    """Parameters of the star tracker.

    Attributes
    ----------
    fov : float
        Full field of view of a head from edge to edge, square, rad.
    pixels : int
        Width of its detector, pixels.
    centroid_sigma : float
        1-sigma of a star's image coordinate, pixels.
    stars : int
        Stars in each head.
    unequal_sigmas : tuple of (x, y, z)
        1-sigma of the attitude of three unequal heads about their own axes (z: boresight), rad.
    check_angles : tuple of float
        Separations of the symmetric geometry that are simulated beside 90°, rad, in (0, 120°].
    sweep_step : float
        Step of the separation in sweeps and figures, rad.
    pair_angle : float
        Angle between the two fixed heads of the asymmetric geometry, rad.
    third_angles : tuple of float
        Angles of the third head from both of them that are simulated, rad, in [pair/2, 180° − pair/2].
    noise_ratios : tuple of (1, 2, 3)
        Star noise of the three heads relative to ``star_sigma`` where weighting is tested.
    mounting_error : float
        Error of one head's mounting about one axis, rad.
    alignment_frames : int
        Images from which the mountings are estimated where alignment is tested.
    alignments : int
        Number of such alignments.
    pixel_images : int
        Images each run takes with white pixel noise instead of white angular noise.
    star_fields : int
        Random sets of star fields for which the best separation is sought.
    search_cases : int
        Random sets of heads with which the properties are tried.
    search_seed : int
        Seed of these searches (the campaign has its own).
    """

    fov: float = math.radians(20.0)
    pixels: int = 1024
    centroid_sigma: float = 0.1
    stars: int = 8
    unequal_sigmas: tuple[Vector, ...] = (
        (3 * _ARCSEC, 3 * _ARCSEC, 24 * _ARCSEC),
        (4 * _ARCSEC, 4 * _ARCSEC, 30 * _ARCSEC),
        (5 * _ARCSEC, 5 * _ARCSEC, 40 * _ARCSEC),
    )
    check_angles: tuple[float, ...] = tuple(math.radians(a) for a in (30.0, 60.0, 120.0))
    sweep_step: float = math.radians(0.5)
    pair_angle: float = math.radians(43.0)
    third_angles: tuple[float, ...] = tuple(math.radians(a) for a in (43.0, 90.0, 140.0))
    noise_ratios: Vector = (1.0, 3.0, 10.0)
    mounting_error: float = 5 * _ARCSEC
    alignment_frames: int = 100
    alignments: int = 20
    pixel_images: int = 20
    star_fields: int = 200
    search_cases: int = 20000
    search_seed: int = 5

    def __post_init__(self) -> None:
        rows = tuple(_floats("unequal_sigmas", row, 3) for row in self.unequal_sigmas)
        if len(rows) != 3:
            raise InvalidInputError(f"unequal_sigmas: expected three heads, got {len(rows)}")
        object.__setattr__(self, "unequal_sigmas", rows)
        for name, length in (("check_angles", None), ("third_angles", None), ("noise_ratios", 3)):
            object.__setattr__(self, name, _floats(name, getattr(self, name), length))
        for field in fields(self):
            values = np.asarray(getattr(self, field.name), dtype=np.float64)
            if field.name != "search_seed" and not (np.isfinite(values).all() and (values > 0).all()):
                raise InvalidInputError(
                    f"{field.name}: expected positive numbers, got {getattr(self, field.name)!r}"
                )
        _within("fov", self.fov, 0.0, math.radians(120.0))
        _within("pair_angle", self.pair_angle, 0.0, math.pi)
        _within("sweep_step", self.sweep_step, 0.0, math.radians(10.0))
        for angle in self.check_angles:
            _within("check_angles", angle, 0.0, math.radians(120.0))
        for angle in self.third_angles:
            _within("third_angles", angle, self.pair_angle / 2, math.pi - self.pair_angle / 2)
        counts = {"stars": 2, "star_fields": 2, "search_cases": 10, "alignment_frames": 2, "alignments": 2}
        for name, least in counts.items():
            if not getattr(self, name) >= least:
                raise InvalidInputError(f"{name}: expected at least {least}, got {getattr(self, name)}")

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return "star-tracker"

    @property
    def star_sigma(self) -> float:
        """1-sigma of a star's direction per axis, rad: the centroid's times the mean angle of a pixel."""
        return self.centroid_sigma * self.fov / self.pixels

    @cached_property
    def head_covariance(self) -> NDArray[np.float64]:
        """Attitude covariance of one head in its own axes (boresight z), stars spread evenly, rad²."""
        from losnav import star_tracker

        return star_tracker.head_covariance(self.fov, self.stars, self.star_sigma)

    @property
    def head_sigma(self) -> float:
        """1-sigma of one head's attitude across its boresight, rad: ``s`` of the formulas."""
        return float(np.sqrt(self.head_covariance[0, 0]))

    @property
    def boresight_ratio(self) -> float:
        """How much worse a head knows the rotation about its boresight: ``k`` of the formulas."""
        return float(np.sqrt(self.head_covariance[2, 2] / self.head_covariance[0, 0]))

    def parameters(self) -> dict[str, Any]:
        """All parameters as a dictionary."""
        return asdict(self)

    def run(  # noqa: PLR0917 - the contract's order
        self,
        runs: int = 100,
        seed: int = 0,
        executor: concurrent.futures.Executor | None = None,
        progress: bool | Progress = False,
        out: str | os.PathLike[str] | None = None,
        resume: bool = False,
    ) -> StarTrackerResult:
        """Repeat every configuration of heads with fresh attitudes, star fields and noise.

        Parameters
        ----------
        runs : int
            Number of runs; each takes one image with every configuration.
        seed : int
            Run ``k`` draws from ``SeedSequence(seed).spawn(runs)[k]``.
        executor, progress, out, resume
            See :func:`losnav.campaign.run_campaign`.

        Returns
        -------
        StarTrackerResult
            With ``table()``, ``claims()``, ``plot(path)`` and the arrays of all runs.

        Raises
        ------
        InvalidInputError
            If ``runs`` or ``seed`` is out of range, or ``out`` holds another campaign.

        Examples
        --------
        >>> import losnav as ln
        >>> tracker = ln.scenarios.load("star-tracker", check_angles=(1.5707963267948966,))
        >>> result = tracker.run(runs=20, seed=1)
        >>> [f"{row['1-sigma x']:.1f}" for row in result.table().records()[:2]]    # arcsec: 1 head, 3 heads
        ['2.6', '1.8']
        """
        from losnav.scenarios.star_tracker.result import StarTrackerResult
        from losnav.scenarios.star_tracker.study import StarTrackerTask

        arrays = run_campaign(
            StarTrackerTask(self),
            runs,
            seed=seed,
            block=_BLOCK,
            executor=executor,
            out=out,
            resume=resume,
            progress=progress,
            describe={"scenario": self.name, **self.parameters()},
        )
        return StarTrackerResult(self, runs, seed, arrays)


def _within(name: str, value: float, low: float, high: float) -> None:
    """Refuse an angle outside the limits; rounding of a conversion from degrees is forgiven."""
    if not low - 1e-12 <= value <= high + 1e-12:
        raise InvalidInputError(
            f"{name}: expected {math.degrees(low):g} to {math.degrees(high):g} deg, got "
            f"{math.degrees(value):g} deg"
        )


def _floats(name: str, values: object, length: int | None = None) -> tuple[float, ...]:
    expected = "numbers" if length is None else f"{length} numbers"
    try:
        row = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name}: expected {expected}, got {values!r}") from None
    if row.ndim != 1 or row.size == 0 or (length is not None and row.size != length):
        raise InvalidInputError(f"{name}: expected {expected}, got {values!r}")
    return tuple(float(x) for x in row)
