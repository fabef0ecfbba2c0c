"""Arcs of the orbit, the bound along them, and what indices of one point say of it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import losnav as ln
from losnav.constants import AU
from losnav.scenarios.sun_line_of_sight.orbit import canonical, degree, horizon_index, orbit_state

if TYPE_CHECKING:
    from losnav.scenarios.sun_line_of_sight import SunLineOfSight

__all__ = [
    "Arc",
    "Comparison",
    "PerStep",
    "Sights",
    "bound",
    "compare",
    "fly",
    "more_information",
    "noise_readings",
    "rank_correlation",
    "rss",
]

Array = NDArray[np.float64]

# Arcs are compared on measurements this far apart, s, each as good as those it stands for.
_COARSE = 7200.0
# States of an arc at which the pointwise indices are averaged.
_LOOKS = 126
_KM = 1e3
# Radii of circles in the ecliptic, m; the planets start at longitude 0.
_PLANETS = {"Sun": 0.0, "Earth": AU, "Jupiter": 5.203 * AU}


@dataclass(frozen=True, eq=False)
class Arc:
    """True motion at the measurement epochs.

    Attributes
    ----------
    name : str
    times : (T,) array
        Epochs, s; negative ones are before the start.
    truth : (T, 6) array
        True states, m and m/s.
    """

    name: str
    times: Array
    truth: Array


def fly(scenario: SunLineOfSight, sign: int) -> Arc:
    """The arc forward (``sign = 1``) or back in time from the start."""
    count = round(scenario.duration / scenario.sampling)
    times = sign * scenario.sampling * np.arange(count + 1)
    truth = scenario.dynamics.trajectory(scenario.start, times)
    return Arc("forward" if sign > 0 else "backward", np.asarray(times[1:]), np.asarray(truth[1:]))


def rss(covariance: Array) -> tuple[Array, Array]:
    """Root of the summed variances of position and of velocity, (...)."""
    variances = np.diagonal(covariance, axis1=-2, axis2=-1)
    return np.sqrt(variances[..., :3].sum(axis=-1)), np.sqrt(variances[..., 3:].sum(axis=-1))


@lru_cache(maxsize=16)
def bound(scenario: SunLineOfSight, name: str, doppler: bool = False) -> Array:
    """Cramér-Rao bound along one of the two arcs, (T, 6, 6)."""
    s, arc = scenario, getattr(scenario, name)
    sensors: list[Any] = [s.sensor, *([ln.sensors.RangeRate(s.doppler_sigma)] if doppler else [])]
    return ln.observability.crlb(s.dynamics, sensors, s.start, arc.times, s.prior, start=0.0)


@dataclass(frozen=True)
class PerStep:
    """A motion with the same process noise every step, as published: a user's own model.

    Attributes
    ----------
    motion : losnav.dynamics.TwoBody
    position_noise, velocity_noise : float
        1-sigma per axis and step, m and m/s.
    """

    motion: ln.dynamics.TwoBody
    position_noise: float
    velocity_noise: float

    def propagate(self, state: Any, dt: float, control: Any = None) -> Array:
        """As the motion."""
        return self.motion.propagate(state, dt, control)

    def transition(self, state: Any, dt: float, control: Any = None) -> Array:
        """As the motion."""
        return self.motion.transition(state, dt, control)

    def process_noise(self, state: Any, dt: float) -> Array:
        """Q of one step, whatever its length."""
        return np.diag(np.repeat([self.position_noise**2, self.velocity_noise**2], 3))


@lru_cache(maxsize=4)
def noise_readings(scenario: SunLineOfSight) -> dict[str, dict[str, float]]:
    """Bound on the final position error, m, for what the published process noise may mean."""
    s, root = scenario, float(np.sqrt(scenario.published_noise))
    second = float(np.sqrt(s.sampling))
    (au, *_, au_speed), _ = canonical(s, AU)
    (own, *_, own_speed), _ = canonical(s, s.semi_major_axis)
    readings = {
        "km, km/s per step": (_KM, _KM),
        "km, km/s per root of a second": (_KM * second, _KM * second),
        "AU per step": (au, au_speed),
        "semi-major axis per step": (own, own_speed),
    }
    found: dict[str, dict[str, float]] = {}
    for words, (length, speed) in readings.items():
        model = PerStep(ln.dynamics.TwoBody(s.mu), root * length, root * speed)
        found[words] = {}
        for arc in (s.backward, s.forward):
            p = ln.observability.crlb(model, s.sensor, s.start, arc.times, s.prior, start=0.0)
            found[words][arc.name] = float(rss(p[-1])[0])
    return found


# --- more to look at -----------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Sights:
    """Directions to the Sun and to planets on circles: a user's own sensor, told the time."""

    names: tuple[str, ...]
    sigmas: tuple[float, ...]
    mu: float

    def jacobian(self, state: Array, time: float) -> Array:
        """Rows of the directions one after another."""
        radius = np.array([_PLANETS[name] for name in self.names])
        angle = np.sqrt(self.mu / np.maximum(radius, AU) ** 3) * time
        places = (radius * np.array([np.cos(angle), np.sin(angle), np.zeros_like(angle)])).T
        return ln.sensors.LineOfSight(places, self.sigmas).jacobian(state, dcm=np.eye(3))

    def noise(self, state: Array, time: float) -> Array:
        """Isotropic; the part along a direction meets no derivative."""
        return np.diag(np.repeat(np.square(self.sigmas), 3))


@lru_cache(maxsize=4)
def more_information(scenario: SunLineOfSight) -> tuple[tuple[str, float, float], ...]:
    """What more to look at is worth on the forward arc: words, bound on position (m) and velocity (m/s)."""
    s, times = scenario, scenario.forward.times
    every = max(1, round(_COARSE / s.sampling))
    kept = times[every - 1 :: every]
    rows = []
    for rate in (None, 1.0, 0.01):
        sensors = [s.sensor, *([] if rate is None else [ln.sensors.RangeRate(rate)])]
        words = "Sun" if rate is None else f"Sun, Doppler {rate:g} m/s"
        rows.append((words, ln.observability.crlb(s.dynamics, sensors, s.start, kept, s.prior, start=0.0)))
    for names, sigmas in (
        (("Sun", "Earth"), (s.sigma, 5e-5)),
        (("Sun", "Earth"), (s.sigma, 5e-6)),
        (("Earth", "Jupiter"), (5e-6, 5e-6)),
    ):
        sights = Sights(names, sigmas, s.mu)
        words = ", ".join(f"{n} {sigma:g} rad" for n, sigma in zip(names, sigmas, strict=True))
        p = ln.observability.crlb(s.dynamics, sights, s.start, kept, s.prior, start=0.0, time=kept)
        rows.append((words, p))
    ends = [(words, rss(p[-1])) for words, p in rows]
    return tuple((words, float(position), float(velocity)) for words, (position, velocity) in ends)


# --- indices against the bound -------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Comparison:
    """Indices of arcs that start all around the orbit, and the bound at their ends, (arcs,) each.

    Attributes
    ----------
    anomaly : array
        True anomaly at the start, rad.
    degree : array
        Mean observability degree along the arc.
    horizon : array
        Mean horizon-weighted smallest singular value.
    gramian : array
        Smallest singular value of the root of the Gramian of the arc, canonical units.
    condition : array
        Its smallest over its largest.
    position, velocity : array
        Bound at the end of the arc, m and m/s, rss.
    """

    anomaly: Array
    degree: Array
    horizon: Array
    gramian: Array
    condition: Array
    position: Array
    velocity: Array

    def correlations(self, index: str) -> tuple[float, float]:
        """Rank correlation of an index with the bounds on position and velocity."""
        values = getattr(self, index)
        return rank_correlation(values, self.position), rank_correlation(values, self.velocity)


@lru_cache(maxsize=4)
def compare(scenario: SunLineOfSight) -> Comparison:
    """Fly the arcs of the comparison, all at once."""
    s = scenario
    every = max(1, round(_COARSE / s.sampling))
    times = np.arange(0.0, s.duration + 1.0, every * s.sampling)
    sensor = ln.sensors.SunDirection(s.sigma / np.sqrt(every))
    anomaly = 2 * np.pi * np.arange(s.arcs) / s.arcs
    start = orbit_state(s, anomaly)
    path = s.dynamics.trajectory(start, times)[:, :: max(1, len(times) // _LOOKS)]
    sizes, _ = canonical(s)
    p = ln.observability.crlb(s.dynamics, sensor, start, times, s.prior)[:, -1]
    root = ln.observability.gramian(s.dynamics, sensor, start, times, root=True, scale=sizes)
    values = np.linalg.svd(root, compute_uv=False)
    position, velocity = rss(p)
    return Comparison(
        anomaly=anomaly,
        degree=degree(s, path).mean(axis=1),
        horizon=horizon_index(s, path).mean(axis=1),
        gramian=np.asarray(values[:, -1]),
        condition=values[:, -1] / values[:, 0],
        position=position,
        velocity=velocity,
    )


def rank_correlation(a: Array, b: Array) -> float:
    """Spearman's rank correlation of two samples without ties."""
    ranks = [np.argsort(np.argsort(x)).astype(float) for x in (a, b)]
    return float(np.corrcoef(ranks)[0, 1])
