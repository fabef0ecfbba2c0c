"""Landing on a small body by IMU, landmark camera and velocimeter, when gravity is hardly known.

The lander flies the Apollo polynomial to 30 m above a site at the tip of Eros. An inertial unit at 10 Hz is
corrected once a second by the pixels of three mapped landmarks and by the velocity in body axes; the filter's
gravity is wrong by up to 100 %. Compared are extended Kalman filters and a predictive filter that estimates
the model error from the last innovation.

    r' = v,    v' = C f + g(r) - 2 w x v - w x (w x (rho + r)) + d,    q' = q (x) [w_b, 0]/2 - [w, 0] (x) q/2

Source: Ji Hongxia, Zong Hua, Huang Xiangyu, "Precise landing autonomous navigation for small bodies based on
an improved predictive filter", Journal of Deep Space Exploration 6(3), 2019. Its equations, tables and
figures are lost; what the text leaves open, and what is used here:

* Site, start, instruments and guidance parameters: the tip of Eros at 2 degrees of latitude, from 2 km to
  30 m in 600 s, a navigation-grade unit; see :class:`SmallBodyLanding`.
* "x % uncertainty of gravity": the filter's field is ``(1 - x)`` times the true one.
* The process noise of the extended Kalman filter: that of the inertial unit alone ("tight"), which is the
  reading under which the published comparison comes out as published.
* The landmark error of 1 m per axis: constant over a run, as maps err. The published filter takes it for
  white noise.
* The centrifugal term is about the centre of mass; about the site it would be wrong by a third of gravity.
* Guidance sees the true state, so that all filters see the same flight and the same measurements.

Truth: harmonics of degree 4 with five coefficients (the published field), or a polyhedron of constant density
in the study of near-surface gravity. Left out: occlusion, image processing, thruster noise, scale factors.
"""

from __future__ import annotations

import concurrent.futures
import math
import os
from dataclasses import asdict, dataclass, fields
from typing import TYPE_CHECKING, Any

import numpy as np

from losnav.campaign import Progress, run_campaign
from losnav.dynamics import Imu
from losnav.errors import InvalidInputError

if TYPE_CHECKING:
    from losnav.scenarios.small_body_landing.estimators import Navigator
    from losnav.scenarios.small_body_landing.result import SmallBodyLandingResult

__all__ = ["SmallBodyLanding"]

Vector = tuple[float, float, float]

_BLOCK = 15  # runs filtered as one batch, and the grain of the checkpoints
_GRADES = ("navigation", "tactical", "mems")
_MAY_BE_ZERO = (
    "longitude",
    "landmark_sigma",
    "attitude_amplitude",
    "latitude",
    "bias_walk",
)
_ANY_SIGN = ("latitude", "longitude", "c20", "c22", "c40", "c42", "c44")


@dataclass(frozen=True, kw_only=True)
class SmallBodyLanding:
    """Parameters of the landing.

    Positions and velocities are in the site frame: East, North, Up, origin at the site, turning with it.

    Attributes
    ----------
    latitude, longitude, site_radius : float
        The site in the body's principal axes, rad and m from the centre of mass.
    mu, reference_radius, rotation_rate : float
        The body: m³/s², m, rad/s (NEAR15A, Eros).
    c20, c22, c40, c42, c44 : float
        Unnormalised coefficients of the true field in principal axes (NEAR15A turned by -9.418 degrees).
    shape : str
        File of the polyhedron for the study of near-surface gravity and the figures, or "" for the built-in,
        made-up one; see :mod:`~losnav.scenarios.small_body_landing.shape`.
    start_position, start_velocity : (x, y, z)
        True state at t = 0, m and m/s.
    target_position, target_velocity, target_acceleration : (x, y, z)
        What guidance steers to, m, m/s, m/s².
    duration : float
        Flight time, s.
    guidance_hold : float
        The last command stands for the last so many seconds.
    attitude_amplitude : float
        Amplitude of the sway about each axis, rad; at rest x is East, y South, z down.
    attitude_periods : (x, y, z)
        Periods of the sway, s.
    imu : {"navigation", "tactical", "mems"}
        Grade of the inertial unit.
    imu_step : float
        Sampling of the inertial unit, s.
    sampling : float
        Time between epochs of camera and velocimeter, s.
    focal_length, pixel_pitch : float
        Camera, m.
    image_size : float
        Width and height of the image, px.
    pixel_sigma, velocimeter_sigma : float
        1-sigma noise, px and m/s.
    landmark_sigma : float
        1-sigma error of the map per axis, constant over a run, m.
    landmark_rings, landmarks_per_ring, first_ring, ring_growth, landmark_height : float
        Catalogue: rings of landmarks, radius of the first, m, ratio from ring to ring, and heights as a share
        of the radius.
    position_sigma, velocity_sigma, attitude_sigma : float
        1-sigma initial error per axis, m, m/s, rad; the filters know it.
    gravity_errors : tuple of float
        Shares by which the filters' gravity is too small.
    predictive_weight : float
        Weight W of the predictive filter, s⁴/m².
    tuned_noise : float
        White acceleration the tuned filter assumes, square root of its density, m/s²/√Hz.
    equal_gain_noise : float
        The same for the filter whose velocity gain is the predictive filter's.
    bias_walk : float
        Random walk of the accelerometers' bias in the filter that has one, m/s²/√s.
    disturbance_sigma, disturbance_time : float
        Gauss-Markov acceleration of the filter that estimates one, m/s² and s.
    settled : float
        Averages count from this time on, s.
    final_window : float
        The "end" of a descent is its last so many seconds.
    converged_position, converged_velocity, converged_attitude : float
        Errors below which a filter counts as converged, m, m/s, rad.
    outage_start, outage_duration, outage_images : float
        Outage of the velocimeter, and time between images meanwhile, s.
    latencies : tuple of float
        Ages of the images when they reach the filter, s.
    large_position, large_attitude : float
        Initial errors of the study of lost filters, 1-sigma per axis, m and rad.
    lost_position : float
        Filters further off at the end are lost, m.
    """

    latitude: float = math.radians(2.0)
    longitude: float = 0.0
    site_radius: float = 15116.0
    mu: float = 4.46275472004e5
    reference_radius: float = 16e3
    rotation_rate: float = math.radians(1639.389232) / 86400.0
    c20: float = -1.173082e-01
    c22: float = 5.619833e-02
    c40: float = 3.879445e-02
    c42: float = -4.031146e-03
    c44: float = 4.094922e-04
    shape: str = ""
    start_position: Vector = (400.0, -300.0, 2000.0)
    start_velocity: Vector = (-1.0, 0.7, -5.0)
    target_position: Vector = (0.0, 0.0, 30.0)
    target_velocity: Vector = (0.0, 0.0, -0.1)
    target_acceleration: Vector = (0.0, 0.0, 0.0)
    duration: float = 600.0
    guidance_hold: float = 5.0
    attitude_amplitude: float = math.radians(3.0)
    attitude_periods: Vector = (120.0, 170.0, 230.0)
    imu: str = "navigation"
    imu_step: float = 0.1
    sampling: float = 1.0
    focal_length: float = 3.5e-3
    pixel_pitch: float = 7e-6
    image_size: float = 1024.0
    pixel_sigma: float = 1.0
    velocimeter_sigma: float = 0.01
    landmark_sigma: float = 1.0
    landmark_rings: float = 13.0
    landmarks_per_ring: float = 8.0
    first_ring: float = 8.0
    ring_growth: float = 1.6
    landmark_height: float = 0.05
    position_sigma: float = 50.0
    velocity_sigma: float = 1.0
    attitude_sigma: float = math.radians(1.0)
    gravity_errors: tuple[float, ...] = (0.0, 0.2, 0.5, 1.0)
    predictive_weight: float = 1e4
    tuned_noise: float = 4e-3
    equal_gain_noise: float = 7.16e-3
    bias_walk: float = 1e-5
    disturbance_sigma: float = 5e-3
    disturbance_time: float = 3000.0
    settled: float = 100.0
    final_window: float = 10.0
    converged_position: float = 5.0
    converged_velocity: float = 0.05
    converged_attitude: float = math.radians(0.2)
    outage_start: float = 120.0
    outage_duration: float = 200.0
    outage_images: float = 30.0
    latencies: tuple[float, ...] = (0.0, 1.0, 3.0)
    large_position: float = 500.0
    large_attitude: float = math.radians(30.0)
    lost_position: float = 10.0

    def __post_init__(self) -> None:
        for field in fields(self):
            default, value = field.default, getattr(self, field.name)
            if isinstance(default, tuple):
                vector = len(default) == 3 and field.name != "latencies"
                value = _floats(field.name, value, 3 if vector else None)
                object.__setattr__(self, field.name, value)
            elif isinstance(default, float) and not _allowed(field.name, value):
                least = "a number" if field.name in _ANY_SIGN else "a positive number"
                least = "a number >= 0" if field.name in _MAY_BE_ZERO[1:3] else least
                raise InvalidInputError(f"{field.name}: expected {least}, got {value!r}")
        if self.imu not in _GRADES:
            raise InvalidInputError(f"imu: expected one of {', '.join(_GRADES)}, got {self.imu!r}")
        if not isinstance(self.shape, str):
            raise InvalidInputError(f"shape: expected the name of a file, got {self.shape!r}")
        for name in ("gravity_errors", "latencies", "attitude_periods"):
            if min(getattr(self, name)) < 0:
                raise InvalidInputError(f"{name}: expected numbers >= 0, got {getattr(self, name)}")
        for name, whole in (("sampling", self.imu_step), ("duration", self.sampling)):
            self._multiple(name, getattr(self, name), whole)
        for latency in self.latencies:
            self._multiple("latencies", latency, self.sampling)
        self._multiple("outage_images", self.outage_images, self.sampling)
        self._fits()

    def _multiple(self, name: str, value: float, whole: float) -> None:
        if not math.isclose(value / whole, round(value / whole), abs_tol=1e-9):
            raise InvalidInputError(f"{name}: expected a multiple of {whole:g} s, got {value:g} s")

    def _fits(self) -> None:
        """Windows inside the flight."""
        for name in ("settled", "final_window", "guidance_hold"):
            if not getattr(self, name) < self.duration:
                raise InvalidInputError(
                    f"{name}: expected less than the duration, {self.duration:g} s, got "
                    f"{getattr(self, name):g}"
                )
        if not self.outage_start + self.outage_duration <= self.duration:
            raise InvalidInputError(
                f"outage_start: expected the outage to end by {self.duration:g} s, got "
                f"{self.outage_start:g} s "
                f"and {self.outage_duration:g} s of outage"
            )
        if min(self.landmark_rings, self.landmarks_per_ring) < 1:
            raise InvalidInputError("landmark_rings: expected at least one ring of one landmark")

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return "small-body-landing"

    @property
    def focal_length_px(self) -> float:
        """Focal length, px."""
        return self.focal_length / self.pixel_pitch

    @property
    def unit(self) -> Imu:
        """The inertial unit."""
        made: Imu = getattr(Imu, self.imu)()
        return made

    @property
    def filters(self) -> tuple[Navigator, ...]:
        """The filters that are compared, in the order of the arrays."""
        from losnav.scenarios.small_body_landing.estimators import navigators

        return navigators(self)

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
    ) -> SmallBodyLandingResult:
        """Repeat every study with fresh noise.

        Parameters
        ----------
        runs : int
            Number of repetitions.
        seed : int
            Run ``k`` draws from ``SeedSequence(seed).spawn(runs)[k]``; all filters and studies of a run share
            its draws, so that their differences are not noise.
        executor, progress, out, resume
            See :func:`losnav.campaign.run_campaign`.

        Returns
        -------
        SmallBodyLandingResult
            With ``table()``, ``claims()``, ``plot(path)`` and the arrays of all runs.

        Raises
        ------
        InvalidInputError
            If ``runs`` or ``seed`` is out of range, or ``out`` holds another campaign.

        Examples
        --------
        >>> import losnav as ln
        >>> landing = ln.scenarios.load("small-body-landing", gravity_errors=(0.0, 1.0))
        >>> [navigator.name for navigator in landing.filters][:3]
        ['EKF, tight', 'predictive', 'EKF, tuned']
        """
        from losnav.scenarios.small_body_landing.result import SmallBodyLandingResult
        from losnav.scenarios.small_body_landing.study import LandingTask

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
        return SmallBodyLandingResult(self, runs, seed, arrays)


def _allowed(name: str, value: object) -> bool:
    if not (isinstance(value, (int, float)) and math.isfinite(value)):
        return False
    return name in _ANY_SIGN or value > 0 or (value == 0 and name in _MAY_BE_ZERO)


def _floats(name: str, values: object, length: int | None = None) -> tuple[float, ...]:
    expected = "numbers" if length is None else f"{length} numbers"
    try:
        row = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InvalidInputError(f"{name}: expected {expected}, got {values!r}") from None
    wrong = row.ndim != 1 or row.size == 0 or (length is not None and row.size != length)
    if wrong or not np.isfinite(row).all():
        raise InvalidInputError(f"{name}: expected {expected}, finite, got {values!r}")
    return tuple(float(x) for x in row)
