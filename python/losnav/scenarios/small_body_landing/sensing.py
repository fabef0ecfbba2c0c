"""What the instruments of a block of runs deliver along a flight."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from losnav import landing
from losnav.dynamics import Imu
from losnav.navigation_state import NavState
from losnav.scenarios.small_body_landing.truth import Flight

__all__ = ["Measured", "measure"]

Array = NDArray[np.float64]

# Streams of random numbers: one for each source of error.
_INERTIAL, _MAP, _PIXELS, _VELOCIMETER, _START = range(5)


@dataclass(frozen=True, eq=False)
class Measured:
    """Measurements of a block of runs.

    Attributes
    ----------
    flight : Flight
    controls : (runs, samples, 6) array
        Specific force and angular rate, m/s² and rad/s.
    pixels : (runs, T, 2 N) array
        Of the landmarks of ``flight.camera()``, NaN where one is not used, px.
    velocity : (runs, T, 3) array
        Body axes, m/s.
    start_errors : (runs, 9) array
        Unit normal numbers: the first errors of the filters in sigmas, position, velocity, attitude.
    accelerometer_bias : (runs, T, 3) array
        In the samples, body axes, m/s².
    """

    flight: Flight
    controls: Array
    pixels: Array
    velocity: Array
    start_errors: Array
    accelerometer_bias: Array

    def first(self, sigmas: Array) -> NavState:
        """First estimates with errors of 1-sigma ``sigmas`` (9,): m, m/s, rad."""
        return self.flight.start.inject(-self.start_errors * sigmas)


def measure(
    flight: Flight,
    seeds: Sequence[SeedSequence],
    *,
    imu: Imu | None = None,
    mismatches: float = 0.0,
    map_sigma: float | None = None,
) -> Measured:
    """Measure a flight with the scenario's instruments and map, or another inertial unit or map error (m)."""
    s = flight.scenario
    spread = s.landmark_sigma if map_sigma is None else map_sigma
    unit = s.unit if imu is None else imu
    inertial = landing.measure_inertial(flight.descent, unit, landing.streams(seeds, _INERTIAL))
    landmarks = flight.catalogue[flight.used]
    # The map errs where it stands; drawn for all of it, so that a landmark's error is always the same.
    errors = _normal(seeds, _MAP, flight.catalogue.shape)[:, flight.used]
    images = landing.measure_images(
        flight.camera(),
        flight.state,
        flight.chosen,
        landing.streams(seeds, _PIXELS),
        landmarks=landmarks + spread * errors,
        mismatches=mismatches,
    )
    exact = flight.velocimeter.predict(flight.state)
    velocity = exact + s.velocimeter_sigma * _normal(seeds, _VELOCIMETER, exact.shape)
    controls = np.concatenate([inertial.specific_force, inertial.angular_rate], axis=-1)
    first = _normal(seeds, _START, (9,))
    bias = inertial.accelerometer_bias[:, flight.descent.every(s.sampling)]
    return Measured(flight, controls, images.pixels, velocity, first, bias)


def _normal(seeds: Sequence[SeedSequence], stream: int, shape: Any) -> Array:
    return np.stack([rng.standard_normal(shape) for rng in landing.streams(seeds, stream)])
