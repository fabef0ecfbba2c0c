"""Heliocentric navigation by the direction to the Sun alone, and what an observability degree says of it.

A spacecraft measures the unit vector to the Sun every half hour and estimates position and velocity with an
extended Kalman filter on two-body dynamics. The publication predicts how well that can go from the
observability degree of the Lie derivatives of its measurement, at one point of the orbit.

    z = -r/|r| + noise,   Q(X) = [dh; dL_f h; ...; dL_f^5 h] (18, 6),   degree = sigma_min(Q)/sigma_max(Q)

Source: Chang Xiaohua, Cui Pingyuan, Cui Hutao, "An observability analysis method of deep space autonomous
navigation system", Journal of Harbin Institute of Technology 42(11), 2010, 1681-1685.

What the publication leaves open, and what is used here:

* Its equations are lost in the only copy there is. Derivatives of orders 0 to 5 of all three components: the
  reading that has its dips at the aphelion from an eccentricity of 0.6 on.
* The unit of length that makes the state dimensionless is not given: 1 AU. With the orbit's own semi-major
  axis the degree would not depend on the semi-major axis at all.
* System 1 goes back in time from the start, towards the perihelion where the degree is low; system 2 forward
  through the aphelion where it is high.
* First error of 6e5 km and 0.05 km/s, norm or per axis: per axis, 1-sigma. The final errors do not depend on
  it.
* Process noise "1e-15 I" without a unit: none. Per step in km and km/s it is negligible; the other readings
  are in claim 7e.
* Sun directions are corrected for aberration before they reach the filter; claims 12 tell what becomes of
  the filter otherwise.

The truth is a two-body orbit. Left out: planets, radiation pressure, the offset of the Sun's photocentre.
"""

from __future__ import annotations

import concurrent.futures
import math
import os
from dataclasses import asdict, dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import losnav as ln
from losnav.campaign import Progress, run_campaign
from losnav.constants import AU, SUN_MU
from losnav.errors import InvalidInputError
from losnav.scenarios.sun_line_of_sight.arcs import Arc, fly
from losnav.scenarios.sun_line_of_sight.orbit import orbit_state

if TYPE_CHECKING:
    from losnav.scenarios.sun_line_of_sight.result import SunLineOfSightResult

__all__ = ["SunLineOfSight"]

Array = NDArray[np.float64]

_BLOCK = 20  # runs filtered as one batch, and the grain of the checkpoints
_MAY_BE_ZERO = ("inclination", "node", "argument_of_perihelion", "true_anomaly", "acceleration_psd")
_LEAST_EPOCHS = 20


@dataclass(frozen=True, kw_only=True)
class SunLineOfSight:
    """Parameters of the flight; the defaults are the published ones where there are any.

    Attributes
    ----------
    semi_major_axis, eccentricity : float
        Orbit about the Sun, m and -.
    inclination, node, argument_of_perihelion, true_anomaly : float
        Its orientation to the ecliptic, and where both arcs start, rad.
    sigma : float
        1-sigma noise of each component of the direction, rad.
    sampling : float
        Time between measurements, s.
    duration : float
        Length of each arc, s.
    initial_position_error, initial_velocity_error : float
        1-sigma of the first estimate per axis, m and m/s.
    acceleration_psd : float
        Process noise of the filter: spectral density of the disturbing acceleration per axis, m²/s³.
    published_noise : float
        The published process noise, a number without a unit.
    large_factor : float
        How much larger the first error is in the study of large errors.
    iterations : int
        Linearisations of each measurement in the iterated filter of that study.
    doppler_sigma : float
        1-sigma noise of the radial velocity in the study of Doppler, m/s.
    mu : float
        Gravitational parameter of the Sun, m³/s².
    unit_length : float
        What makes the state dimensionless, m.
    order : int
        Highest Lie derivative in the observability matrix, at least 3.
    semi_major_axes, eccentricities, inclinations : tuple of float
        Orbits of the curves of the degree, m, - and rad.
    arcs : int
        Arcs, spread evenly over the orbit, on which indices are compared with the bound.
    horizon : float
        Time over which the horizon-weighted index looks, s.
    """

    semi_major_axis: float = 2e11
    eccentricity: float = 0.25
    inclination: float = math.radians(23.0)
    node: float = math.radians(1.16)
    argument_of_perihelion: float = math.radians(108.89)
    true_anomaly: float = math.radians(104.48)
    sigma: float = 5e-5
    sampling: float = 1800.0
    duration: float = 1.8e7
    initial_position_error: float = 6e8
    initial_velocity_error: float = 50.0
    acceleration_psd: float = 0.0
    published_noise: float = 1e-15
    large_factor: float = 20.0
    iterations: int = 4
    doppler_sigma: float = 1.0
    mu: float = SUN_MU
    unit_length: float = AU
    order: int = 5
    semi_major_axes: tuple[float, ...] = (1e11, 1.5e11, 2e11, 2.5e11, 3e11, 4e11, 5e11)
    eccentricities: tuple[float, ...] = (0.05, 0.25, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    inclinations: tuple[float, ...] = tuple(math.radians(i) for i in (0.0, 23.0, 45.0, 90.0, 135.0))
    arcs: int = 12
    horizon: float = 60 * 86400.0

    def __post_init__(self) -> None:
        for field in fields(self):
            value, default = getattr(self, field.name), field.default
            if isinstance(default, tuple):
                object.__setattr__(self, field.name, _floats(field.name, value))
            elif isinstance(default, float):
                zero = field.name in _MAY_BE_ZERO
                if not (_number(value) and (value > 0 or (zero and value >= 0))):
                    least = "a number >= 0" if zero else "a positive number"
                    raise InvalidInputError(f"{field.name}: expected {least}, got {value!r}")
            elif isinstance(default, int):
                fewest = {"order": 3, "arcs": 3}.get(field.name, 1)
                if isinstance(value, bool) or not isinstance(value, int) or value < fewest:
                    raise InvalidInputError(f"{field.name}: expected an integer >= {fewest}, got {value!r}")
        eccentricities = ("eccentricity", (self.eccentricity,)), ("eccentricities", self.eccentricities)
        for name, values in eccentricities:
            if max(values) >= 1.0:
                raise InvalidInputError(f"{name}: expected less than 1, got {getattr(self, name)}")
        if self.duration < _LEAST_EPOCHS * self.sampling:
            raise InvalidInputError(
                f"duration: expected at least {_LEAST_EPOCHS} samplings of {self.sampling:g} s, "
                f"got {self.duration:g} s"
            )

    @property
    def name(self) -> str:
        """Name of the scenario."""
        return "sun-line-of-sight"

    @property
    def period(self) -> float:
        """Period of the orbit, s."""
        return 2 * math.pi * math.sqrt(self.semi_major_axis**3 / self.mu)

    @property
    def dynamics(self) -> ln.dynamics.TwoBody:
        """The filter's model of motion."""
        return ln.dynamics.TwoBody(self.mu, self.acceleration_psd)

    @property
    def sensor(self) -> ln.sensors.SunDirection:
        """The Sun sensor, its directions corrected for aberration."""
        return ln.sensors.SunDirection(self.sigma)

    @property
    def prior(self) -> Array:
        """Covariance of the first estimate, (6, 6), m² and m²/s²."""
        sigmas = np.repeat([self.initial_position_error, self.initial_velocity_error], 3)
        return np.diag(sigmas**2)

    @property
    def start(self) -> Array:
        """State where both arcs start, (6,), m and m/s."""
        return orbit_state(self, self.true_anomaly)

    @cached_property
    def backward(self) -> Arc:
        """System 1: back in time, through the perihelion."""
        return fly(self, -1)

    @cached_property
    def forward(self) -> Arc:
        """System 2: forward, through the aphelion."""
        return fly(self, 1)

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
    ) -> SunLineOfSightResult:
        """Filter both arcs, and the variations, with fresh errors.

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
        SunLineOfSightResult
            With ``table()``, ``claims()``, ``plot(path)`` and the arrays of all runs.

        Raises
        ------
        InvalidInputError
            If ``runs`` or ``seed`` is out of range, or ``out`` holds another campaign.

        Examples
        --------
        >>> import losnav as ln
        >>> flight = ln.scenarios.load("sun-line-of-sight", sampling=36000.0)
        >>> result = flight.run(runs=4, seed=1)
        >>> result.arrays["backward_error"].shape                       # runs, epochs kept, components
        (4, 100, 6)
        """
        from losnav.scenarios.sun_line_of_sight.result import SunLineOfSightResult
        from losnav.scenarios.sun_line_of_sight.study import SunTask

        arrays = run_campaign(
            SunTask(self),
            runs,
            seed=seed,
            block=_BLOCK,
            executor=executor,
            out=out,
            resume=resume,
            progress=progress,
            describe={"scenario": self.name, **self.parameters()},
        )
        return SunLineOfSightResult(self, runs, seed, arrays)


def _number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


def _floats(name: str, values: object) -> tuple[float, ...]:
    try:
        row = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        row = np.empty(0)
    if row.ndim != 1 or row.size == 0 or not np.isfinite(row).all() or row.min() < 0.0:
        raise InvalidInputError(f"{name}: expected numbers >= 0, got {values!r}")
    return tuple(float(x) for x in row)
