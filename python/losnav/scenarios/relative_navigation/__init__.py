"""Relative navigation to a non-cooperative satellite by a range and two angles a minute.

The chaser measures range, azimuth and elevation of the target every minute and estimates the relative state
in the target's orbital frame with an extended Kalman filter on Clohessy-Wiltshire dynamics.

    L = -C r,   ρ = |r|,   α = atan2(L₂, L₁),   β = asin(L₃/ρ);      r chaser minus target, C body from LVLH

Source: Li Litao, Yang Xu, Li Shunli, "Mid-range relative navigation method for non-cooperative target
satellite", Journal of Jilin University (Engineering and Technology Edition) 38(4), 2008, 986 ff.

What the publication leaves open or prints wrongly, and what is used here:

* Φ(1,6) has the wrong sign in print; losnav's :class:`~losnav.dynamics.ClohessyWiltshire` has the right one,
  and claim R1 measures what the printed one costs.
* The prediction of its eq. (10a) lacks the control; its second conclusion needs it.
* As printed the chaser does not approach: with vx = -0.0324 m/s it passes below the target and leaves. The
  opposite sign gives the co-elliptic approach the text speaks of. Both arcs are run.
* Process noise, first covariance, run length and the meaning of "3-sigma" are not given: white acceleration
  of ``acceleration_psd``, 10 m and 0.05 m/s, one orbit, and three times the rms over runs and epochs from
  ``settled`` on.
* Node and argument of latitude are not given: 0 and 0.
* The roll of the camera about the line of sight: its z axis as near to the chaser's nadir as it can be.

The truth is two satellites on separate orbits about an oblate Earth. Left out: drag (relative 1e-8 m/s²
between like bodies), image processing, thruster noise.
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
from losnav.constants import EARTH_J2, EARTH_MU, EARTH_RADIUS
from losnav.errors import InvalidInputError
from losnav.scenarios.relative_navigation.truth import Arc, fly

if TYPE_CHECKING:
    from losnav.scenarios.relative_navigation.result import RelativeNavigationResult

__all__ = ["RelativeNavigation"]

Vector = tuple[float, float, float]

_BLOCK = 50  # runs filtered as one batch, and the grain of the checkpoints
_ARCMINUTE = math.radians(1 / 60)
_MAY_BE_ZERO = (
    "acceleration_psd",
    "aware_psd",
    "control_sigma",
    "control_bias",
    "star_tracker_sigma",
    "gps_position_sigma",
    "gps_velocity_sigma",
    "j2",
    "inclination",
    "node",
    "argument_of_latitude",
    "settled",
)
_FRAMES = ("chaser", "corrected", "target")


@dataclass(frozen=True, kw_only=True)
class RelativeNavigation:
    """Parameters of the rendezvous; the defaults are the published ones where there are any.

    Relative states are chaser minus target in the target's orbital frame: x along track, y along the negative
    orbit normal, z to nadir; the velocity is that seen in the rotating frame.

    Attributes
    ----------
    initial_position, initial_velocity : (x, y, z)
        True relative state at t = 0 as printed, m and m/s.
    approach_velocity : (x, y, z)
        The same with the sign of vx that approaches, m/s.
    filter_position, filter_velocity : (x, y, z)
        The filter's first state, m and m/s.
    prior_position_sigma, prior_velocity_sigma : float
        Its 1-sigma per axis, m and m/s.
    acceleration_psd : float
        Process noise of the filter: spectral density of the disturbing acceleration per axis, m²/s³.
    aware_psd : float
        The same for the filter that predicts with two J2 orbits, m²/s³.
    psd_grid : tuple of float
        Other densities tried on the same measurements, m²/s³.
    sampling : float
        Time between measurements, s.
    duration, short_duration, approach_duration : float
        Length of the printed arc, of its first part that is judged by itself, and of the approach, s.
    settled : float
        Errors count from this time on, s.
    final_window : float
        The "end" of an arc is its last so many seconds.
    range_sigma, angle_sigma : float
        1-sigma noise of range and of each angle, m and rad.
    star_tracker_sigma : float
        1-sigma error of the measured attitude per axis, white, rad.
    gps_position_sigma, gps_velocity_sigma : float
        1-sigma error of the chaser's own orbit per axis, white, m and m/s.
    control_sigma, control_bias : float
        Pointing error of the body about each axis: 1-sigma of a white part, and a constant part, rad.
    frame : {"chaser", "corrected", "target"}
        Which orbital frame the filter takes for the target's: "chaser", the chaser's own from its GPS, as
        published; "corrected", that one turned by first-order small angles of the estimated state; "target",
        the target's true frame.
    altitude, inclination, node, argument_of_latitude : float
        The target's orbit at t = 0, osculating circular, m and rad.
    mu, j2, earth_radius : float
        Gravity of the truth, m³/s², -, m; ``j2=0`` makes it two-body.
    burn_acceleration, burn_start, burn_duration : float
        Manoeuvre of the chaser along +x of the target's frame, m/s², s, s.
    burn_psds : tuple of float
        Process noise of the manoeuvre study, m²/s³.
    control_sigmas, control_biases : tuple of float
        Pointing errors of the attitude-control study, rad.
    star_tracker_sigmas : tuple of float
        Star trackers of the attitude-knowledge study, rad.
    far_position, far_velocity : (x, y, z)
        Relative state at t = 0 of the study of nearly parallel frames, m and m/s.
    far_psds : tuple of float
        Its process noise, m²/s³.
    """

    initial_position: Vector = (-520.0, 10.0, 20.0)
    initial_velocity: Vector = (-0.0324, -0.02, 0.02)
    approach_velocity: Vector = (0.0324, -0.02, 0.02)
    filter_position: Vector = (-510.0, 0.0, 10.0)
    filter_velocity: Vector = (0.0, 0.0, 0.0)
    prior_position_sigma: float = 10.0
    prior_velocity_sigma: float = 0.05
    acceleration_psd: float = 1e-9
    aware_psd: float = 1e-12
    psd_grid: tuple[float, ...] = (0.0, 1e-12, 1e-11, 1e-10, 1e-8)
    sampling: float = 60.0
    duration: float = 6000.0
    short_duration: float = 3000.0
    approach_duration: float = 17400.0
    settled: float = 720.0
    final_window: float = 1200.0
    range_sigma: float = 0.6 / 3
    angle_sigma: float = math.radians(0.1) / 3
    star_tracker_sigma: float = _ARCMINUTE / 3
    gps_position_sigma: float = 45.0 / 3
    gps_velocity_sigma: float = 0.2 / 3
    control_sigma: float = 0.0
    control_bias: float = 0.0
    frame: str = "chaser"
    altitude: float = 780e3
    inclination: float = math.radians(98.5)
    node: float = 0.0
    argument_of_latitude: float = 0.0
    mu: float = EARTH_MU
    j2: float = EARTH_J2
    earth_radius: float = EARTH_RADIUS
    burn_acceleration: float = 2e-3
    burn_start: float = 1800.0
    burn_duration: float = 600.0
    burn_psds: tuple[float, ...] = (1e-9, 1e-7, 1e-6)
    control_sigmas: tuple[float, ...] = tuple(math.radians(a) for a in (0.5, 1.5, 5.0))
    control_biases: tuple[float, ...] = tuple(math.radians(a) for a in (2.0, 5.0))
    star_tracker_sigmas: tuple[float, ...] = tuple(a * _ARCMINUTE / 3 for a in (1.0, 6.0, 30.0))
    far_position: Vector = (-10000.0, 10.0, 20.0)
    far_velocity: Vector = (0.0313, 0.0, 0.0)
    far_psds: tuple[float, ...] = (1e-11, 1e-9, 1e-8, 1e-6)

    def __post_init__(self) -> None:
        for field in fields(self):
            default, value = field.default, getattr(self, field.name)
            if isinstance(default, tuple):
                vector = field.name.endswith(("position", "velocity"))
                value = _floats(field.name, value, 3 if vector else None)
                object.__setattr__(self, field.name, value)
                if not vector and min(value) < 0:
                    raise InvalidInputError(f"{field.name}: expected numbers >= 0, got {value}")
            elif isinstance(default, float):
                least = "a number >= 0" if field.name in _MAY_BE_ZERO else "a positive number"
                if not (_number(value) and (value > 0 or (value == 0 and field.name in _MAY_BE_ZERO))):
                    raise InvalidInputError(f"{field.name}: expected {least}, got {value!r}")
        if self.frame not in _FRAMES:
            raise InvalidInputError(f"frame: expected one of {', '.join(_FRAMES)}, got {self.frame!r}")
        if not 2 * self.sampling <= self.short_duration <= self.duration:
            raise InvalidInputError(
                f"short_duration: expected two samplings ({2 * self.sampling:g} s) to the duration "
                f"({self.duration:g} s), got {self.short_duration:g} s"
            )
        if not self.settled < self.short_duration:
            raise InvalidInputError(
                f"settled: expected less than short_duration, {self.short_duration:g} s, got {self.settled:g}"
            )
        if not self.burn_start + self.burn_duration <= self.duration:
            raise InvalidInputError(
                f"burn_start: expected the burn to end by {self.duration:g} s, got {self.burn_start:g} s and "
                f"{self.burn_duration:g} s of burn"
            )

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return "relative-navigation"

    @property
    def mean_motion(self) -> float:
        """Mean motion of the target, ``sqrt(mu / a^3)``, rad/s."""
        return math.sqrt(self.mu / (self.earth_radius + self.altitude) ** 3)

    @property
    def period(self) -> float:
        """Period of the target, s."""
        return 2 * math.pi / self.mean_motion

    @cached_property
    def printed(self) -> Arc:
        """True motion with the printed initial state."""
        return fly(self, self.initial_position, self.initial_velocity, self.duration)

    @cached_property
    def approach(self) -> Arc:
        """True motion with the other sign of vx."""
        return fly(self, self.initial_position, self.approach_velocity, self.approach_duration)

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
    ) -> RelativeNavigationResult:
        """Repeat every study with fresh measurement noise.

        Parameters
        ----------
        runs : int
            Number of repetitions.
        seed : int
            Run ``k`` draws from ``SeedSequence(seed).spawn(runs)[k]``; all studies of a run share its draws,
            so that their differences are not noise.
        executor, progress, out, resume
            See :func:`losnav.campaign.run_campaign`.

        Returns
        -------
        RelativeNavigationResult
            With ``table()``, ``claims()``, ``plot(path)`` and the arrays of all runs.

        Raises
        ------
        InvalidInputError
            If ``runs`` or ``seed`` is out of range, or ``out`` holds another campaign.

        Examples
        --------
        >>> import losnav as ln
        >>> rendezvous = ln.scenarios.load("relative-navigation", approach_duration=6000.0)
        >>> result = rendezvous.run(runs=5, seed=1)
        >>> result.arrays["printed_error"].shape                          # runs, epochs, components
        (5, 100, 6)
        """
        from losnav.scenarios.relative_navigation.result import RelativeNavigationResult
        from losnav.scenarios.relative_navigation.study import RendezvousTask

        arrays = run_campaign(
            RendezvousTask(self),
            runs,
            seed=seed,
            block=_BLOCK,
            executor=executor,
            out=out,
            resume=resume,
            progress=progress,
            describe={"scenario": self.name, **self.parameters()},
        )
        return RelativeNavigationResult(self, runs, seed, arrays)


def _number(value: object) -> bool:
    return isinstance(value, (int, float)) and math.isfinite(value)


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
