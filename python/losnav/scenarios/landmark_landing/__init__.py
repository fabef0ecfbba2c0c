"""Landing on a small body by lines of sight to four known landmarks.

The camera measures the directions of landmarks whose positions are mapped; every image gives position and
attitude by itself.

    b_i = A(σ) (L_i − p)/‖L_i − p‖ + v_i,     min over (p, σ) of ½ Σ (b̃_i − b_i)' W_i (b̃_i − b_i)

Source: Li Shuang, "Line-of-sight measurement based autonomous optical relative navigation algorithms for
asteroid landing and observability analysis", Acta Aeronautica et Astronautica Sinica 30(9), 2009, 1711–1717.

What the publication leaves open, and what is used here:

* The path between the given ends: cubic Hermite curves in position and MRP (:mod:`.descent`).
* The noise "variance 1.0e-6 m²" of the focal plane cannot be a variance (it would be 2e-2 rad): a standard
  deviation of 1e-6 m is used.
* With the published attitude the landmarks lie towards −z of the camera. losnav's lines of sight cover the
  full sphere, so nothing needs turning round; only the field of view is taken about −z.
* The first guess: truth plus 50 m and 5° (1-sigma, per axis); later the previous estimate, not propagated.
* The field of view. The ideal camera sees all landmarks down to touchdown, though they are then 90° off axis.
  The limited camera stops navigating when fewer than ``min_landmarks`` are inside ``half_fov``; from there
  its pose is propagated along the commanded path with the small rate errors given.

Left out: landmark position errors, image processing, gravity and guidance errors, and any filter.
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
from losnav.scenarios.landmark_landing.descent import Descent

if TYPE_CHECKING:
    from losnav.scenarios.landmark_landing.result import LandingResult

__all__ = ["LandmarkLanding"]

Vector = tuple[float, float, float]

_BLOCK = 50  # runs solved as one batch, and the grain of the checkpoints


@dataclass(frozen=True, kw_only=True)
class LandmarkLanding:
    """Parameters of the landing; the defaults are the published ones.

    Attributes
    ----------
    landmarks : tuple of (x, y, z)
        Landmarks in the landing-site frame (Z up, origin at the landing point), m.
    initial_position, initial_velocity : (x, y, z)
        Camera at t = 0 in the site frame, m and m/s.
    initial_mrp : (3,)
        Attitude at t = 0 (camera from site), MRP, dimensionless.
    initial_rate : (3,)
        Body rate at t = 0, rad/s.
    duration : float
        Time of touchdown, s.
    sampling : float
        Time between images, s.
    focal_length : float
        m.
    focal_plane_sigma : float
        1-sigma of an image coordinate, m.
    noise : {"tangent", "focal-plane"}
        "tangent": ``focal_plane_sigma/focal_length`` rad across the LOS in every direction, the publication's
        isotropic model for unit vectors. "focal-plane": white noise of the two image coordinates, whose angle
        shrinks off axis.
    half_fov : float
        Half angle of the limited camera's field of view about −z, rad.
    min_landmarks : int
        The limited camera navigates while it sees at least this many landmarks.
    hold_velocity_sigma : float
        1-sigma of the constant velocity error with which the pose is propagated after that, per axis, m/s.
    hold_rate_sigma : float
        The same for the body rate, rad/s.
    guess_position_sigma, guess_attitude_sigma : float
        1-sigma of the first guess at t = 0 per axis, m and rad.
    damping : float
        First damping of Levenberg–Marquardt, relative to the diagonal of the normal matrix.
    cost_tolerance : float
        The publication's stop test: relative change of the cost between iterations.
    max_iterations : int
        The publication's limit of iterations.
    cold_times : tuple of float
        Epochs of the cold-start study, s (each is moved to the nearest image).
    cold_offsets : tuple of float
        1-sigma of the position of its guesses per axis at the first epoch, m; later it shrinks with the range
        to the site.
    cold_angles : tuple of float
        1-sigma of the attitude of its guesses per axis, rad.
    cold_cost_tolerance, cold_max_iterations : float, int
        Its stop test.
    """

    landmarks: tuple[Vector, ...] = ((32.5, 0.0, 0.0), (0.0, 30.0, 0.0), (-31.5, 0.0, 0.0), (0.0, -30.5, 0.0))
    initial_position: Vector = (-50.0, 50.0, 500.0)
    initial_velocity: Vector = (0.01, -0.075, -0.2)
    initial_mrp: Vector = (0.09, -0.04, 0.03)
    initial_rate: Vector = (math.radians(0.1), math.radians(0.1), math.radians(0.1))
    duration: float = 430.0
    sampling: float = 2.0
    focal_length: float = 0.05
    focal_plane_sigma: float = 1e-6
    noise: str = "tangent"
    half_fov: float = math.radians(45.0)
    min_landmarks: int = 4
    hold_velocity_sigma: float = 2e-3
    hold_rate_sigma: float = 1e-5
    guess_position_sigma: float = 50.0
    guess_attitude_sigma: float = math.radians(5.0)
    damping: float = 1e-3
    cost_tolerance: float = 0.1
    max_iterations: int = 10
    cold_times: tuple[float, ...] = (0.0, 100.0, 200.0, 300.0)
    cold_offsets: tuple[float, ...] = (20.0, 79.0, 150.0, 200.0)
    cold_angles: tuple[float, ...] = tuple(math.radians(a) for a in (5.0, 20.0, 30.0, 40.0))
    cold_cost_tolerance: float = 1e-6
    cold_max_iterations: int = 100

    def __post_init__(self) -> None:
        for name in ("initial_position", "initial_velocity", "initial_mrp", "initial_rate"):
            object.__setattr__(self, name, _floats(name, getattr(self, name), 3))
        if len(self.landmarks) < 4:
            raise InvalidInputError(f"landmarks: expected at least 4 landmarks, got {len(self.landmarks)}")
        object.__setattr__(self, "landmarks", tuple(_floats("landmarks", row, 3) for row in self.landmarks))
        for name in ("cold_times", "cold_offsets", "cold_angles"):
            object.__setattr__(self, name, _floats(name, getattr(self, name)))
        for field in fields(self):
            value = getattr(self, field.name)
            if isinstance(value, (int, float)) and not (math.isfinite(value) and value > 0):
                raise InvalidInputError(f"{field.name}: expected a positive number, got {value!r}")
        if self.noise not in ("tangent", "focal-plane"):
            raise InvalidInputError(f"noise: expected 'tangent' or 'focal-plane', got {self.noise!r}")
        if not self.sampling <= self.duration:
            raise InvalidInputError(
                f"sampling: expected at most the duration, {self.duration:g} s, got {self.sampling:g} s"
            )
        if not all(0.0 <= t <= self.duration for t in self.cold_times):
            raise InvalidInputError(
                f"cold_times: expected times in [0, {self.duration:g}] s, got {self.cold_times}"
            )
        if not self.min_landmarks <= len(self.landmarks):
            raise InvalidInputError(
                f"min_landmarks: expected at most {len(self.landmarks)}, got {self.min_landmarks}"
            )

    @property
    def los_sigma(self) -> float:
        """1-sigma of a LOS on the optical axis, rad."""
        return self.focal_plane_sigma / self.focal_length

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return "landmark-landing"

    @cached_property
    def descent(self) -> Descent:
        """True motion at the image epochs."""
        count = math.floor(self.duration / self.sampling + 1e-9)
        return self.descent_at(self.sampling * np.arange(count + 1))

    def descent_at(self, times: object) -> Descent:
        """True motion at other times (s)."""
        start = np.array([self.initial_position, self.initial_velocity, self.initial_mrp, self.initial_rate])
        return Descent(np.array(self.landmarks), np.asarray(times, dtype=np.float64), self.duration, start)

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
    ) -> LandingResult:
        """Repeat the landing with fresh noise, first guesses and cold starts.

        Parameters
        ----------
        runs : int
            Number of landings.
        seed : int
            Run ``k`` draws from ``SeedSequence(seed).spawn(runs)[k]``.
        executor, progress, out, resume
            See :func:`losnav.campaign.run_campaign`.

        Returns
        -------
        LandingResult
            With ``table()``, ``claims()``, ``plot(path)`` and the arrays of all runs.

        Raises
        ------
        InvalidInputError
            If ``runs`` or ``seed`` is out of range, or ``out`` holds another campaign.

        Examples
        --------
        >>> import losnav as ln
        >>> landing = ln.scenarios.load("landmark-landing", sampling=43.0, cold_times=(0.0,))
        >>> result = landing.run(runs=5, seed=1)
        >>> bool((abs(result.arrays["ml_error"][:, -1, :3]) < 0.01).all())        # millimetres at touchdown
        True
        """
        from losnav.scenarios.landmark_landing.result import LandingResult
        from losnav.scenarios.landmark_landing.study import LandingTask

        arrays = run_campaign(
            LandingTask(self),
            runs,
            seed=seed,
            block=_BLOCK,
            executor=executor,
            out=out,
            resume=resume,
            progress=progress,
            describe={"scenario": self.name, **self.parameters()},
        )
        return LandingResult(self, runs, seed, arrays)


def _floats(name: str, values: object, length: int | None = None) -> tuple[float, ...]:
    expected = "numbers" if length is None else f"{length} numbers"
    try:
        row = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name}: expected {expected}, got {values!r}") from None
    if (
        row.ndim != 1
        or row.size == 0
        or (length is not None and row.size != length)
        or not np.isfinite(row).all()
    ):
        raise InvalidInputError(f"{name}: expected {expected}, finite, got {values!r}")
    return tuple(float(x) for x in row)
