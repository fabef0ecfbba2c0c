"""What an inertial measurement unit makes of a true descent.

    f_m = f + b_a + n_a,    w_m = w + b_g + n_g,    n of 1-sigma N/sqrt(dt) per sample (N: a noise density)

The biases start at their turn-on values and walk by ``K sqrt(dt)`` a step. Left out: scale factors,
misalignment, quantisation, the unit's own bandwidth.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator, SeedSequence, default_rng

from losnav._arrays import FloatArray
from losnav.errors import InvalidInputError

if TYPE_CHECKING:
    from losnav.dynamics import Imu
    from losnav.landing.descent import Descent

__all__ = ["InertialMeasurements", "measure_inertial", "streams"]


def streams(seeds: Sequence[SeedSequence], stream: int) -> list[Generator]:
    """One generator for each run, independent of those of every other stream.

    Draws of one source of error then do not depend on whether, or how much, another one draws.

    Parameters
    ----------
    seeds : sequence of SeedSequence
        One for each run, such as ``SeedSequence(seed).spawn(runs)``; they are not changed.
    stream : int
        Number of the source of error, from 0.

    Returns
    -------
    list of numpy.random.Generator

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> seeds = np.random.SeedSequence(1).spawn(3)
    >>> first, again = (ln.landing.streams(seeds, 0)[1].standard_normal() for _ in range(2))
    >>> first == again
    True
    """
    return [
        default_rng(SeedSequence(entropy=seed.entropy, spawn_key=(*seed.spawn_key, stream))) for seed in seeds
    ]


@dataclass(frozen=True, eq=False)
class InertialMeasurements:
    """Samples of all runs, and the biases in them.

    Attributes
    ----------
    specific_force, angular_rate : (runs, ..., T, 3) arrays
        Body axes, m/s^2 and rad/s: the ``controls`` of a filter.
    accelerometer_bias, gyroscope_bias : (runs, T + 1, 3) arrays
        True biases at the times of the descent; those of a sample are in it.
    """

    specific_force: FloatArray
    angular_rate: FloatArray
    accelerometer_bias: FloatArray
    gyroscope_bias: FloatArray


def measure_inertial(descent: Descent, imu: Imu, rngs: Sequence[Generator]) -> InertialMeasurements:
    """Samples of a descent with the errors of a grade of instrument (L4).

    Parameters
    ----------
    descent : Descent
        One trajectory for all runs, or one for each: (runs, T + 1, 3).
    imu : Imu
        Noise densities and 1-sigma turn-on biases.
    rngs : sequence of Generator
        One for each run.

    Returns
    -------
    InertialMeasurements

    Raises
    ------
    InvalidInputError
        If the descent's batch does not fit the runs.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> site, field = ln.dynamics.Site.inertial(), ln.gravity.Uniform([0.0, 0.0, -1.6])
    >>> fall = ln.landing.simulate_descent(site, field, [0.0, 0.0, 500.0], [0.0, 0.0, 0.0], duration=10.0)
    >>> rngs = ln.landing.streams(np.random.SeedSequence(0).spawn(4), 0)
    >>> ln.landing.measure_inertial(fall, ln.dynamics.Imu.navigation(), rngs).specific_force.shape
    (4, 100, 3)
    """
    runs, steps = len(rngs), len(descent.angular_rate)
    if descent.specific_force.ndim > 2 and descent.specific_force.shape[0] != runs:
        raise InvalidInputError(
            f"descent: expected one trajectory, or one for each of {runs} runs, got "
            f"{descent.specific_force.shape[:-2]}"
        )
    normal = np.stack([rng.standard_normal((4, steps + 1, 3)) for rng in rngs])
    root = np.sqrt(descent.step)
    biases, samples = [], []
    grades = (
        (
            descent.specific_force,
            imu.velocity_random_walk,
            imu.accelerometer_bias,
            imu.accelerometer_bias_walk,
        ),
        (descent.angular_rate, imu.angle_random_walk, imu.gyroscope_bias, imu.gyroscope_bias_walk),
    )
    for k, (exact, density, turn_on, walk) in enumerate(grades):
        # The last row is the bias at the end of the last step, which no sample has.
        steps_of_bias = normal[:, 2 + k] * (walk * root)
        steps_of_bias[:, 0] = normal[:, 2 + k, 0] * turn_on
        bias = np.cumsum(steps_of_bias, axis=1)
        biases.append(bias)
        samples.append(exact + bias[:, :-1] + normal[:, k, :-1] * (density / root))
    return InertialMeasurements(*samples, *biases)
