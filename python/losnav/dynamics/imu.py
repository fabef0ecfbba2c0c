"""How noisy an inertial measurement unit is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from losnav.dynamics.listed import hold_numbers

#: Standard gravity, m/s^2, exact (CGPM 1901): the unit accelerometers are sold by.
STANDARD_GRAVITY = 9.80665
_MICRO_G = 1e-6 * STANDARD_GRAVITY
_DEGREE_PER_HOUR = np.radians(1.0) / 3600.0
_DEGREE_PER_ROOT_HOUR = np.radians(1.0) / 60.0


@dataclass(frozen=True)
class Imu:
    """Noise of accelerometers and gyroscopes: ``f_m = f + b_a + n_a``, ``w_m = w + b_g + n_g`` (L4).

    White noise is given by its density: a sample over ``dt`` has ``velocity_random_walk / sqrt(dt)`` on each
    axis. Biases are constant from turn-on, or walk.

    Parameters
    ----------
    velocity_random_walk : float
        Noise density of the specific force, m/s^2/sqrt(Hz) = m/s/sqrt(s).
    angle_random_walk : float
        Noise density of the angular rate, rad/s/sqrt(Hz) = rad/sqrt(s).
    accelerometer_bias_walk, gyroscope_bias_walk : float
        What drives the biases, m/s^2/sqrt(s) and rad/s/sqrt(s); 0 for constant ones.
    accelerometer_bias, gyroscope_bias : float
        1-sigma of the biases at turn-on, m/s^2 and rad/s per axis: for the first covariance, and for
        simulated units.

    Raises
    ------
    InvalidInputError
        If a number is negative, NaN or infinite.

    Examples
    --------
    >>> import losnav as ln
    >>> print(f"{ln.dynamics.Imu.navigation().angle_random_walk:.4g} rad/sqrt(s)")  # 0.01 deg/sqrt(h)
    2.909e-06 rad/sqrt(s)
    """

    velocity_random_walk: float
    angle_random_walk: float
    accelerometer_bias_walk: float = 0.0
    gyroscope_bias_walk: float = 0.0
    accelerometer_bias: float = 0.0
    gyroscope_bias: float = 0.0

    def __post_init__(self) -> None:
        hold_numbers(self, at_least_zero=tuple(self.__dataclass_fields__))

    @classmethod
    def navigation(cls) -> Imu:
        """Navigation grade: gyroscopes 0.1 deg/h, 0.01 deg/sqrt(h); accelerometers 50 ug, 10 ug/sqrt(Hz).

        Returns
        -------
        Imu
            In SI units.
        """
        return cls._graded(10.0, 0.01, 50.0, 0.1)

    @classmethod
    def tactical(cls) -> Imu:
        """Tactical grade: gyroscopes 1 deg/h, 0.07 deg/sqrt(h); accelerometers 300 ug, 50 ug/sqrt(Hz).

        Returns
        -------
        Imu
            In SI units.
        """
        return cls._graded(50.0, 0.07, 300.0, 1.0)

    @classmethod
    def mems(cls) -> Imu:
        """Micromechanical: gyroscopes 10 deg/h, 0.15 deg/sqrt(h); accelerometers 1 mg, 100 ug/sqrt(Hz).

        Returns
        -------
        Imu
            In SI units.
        """
        return cls._graded(100.0, 0.15, 1000.0, 10.0)

    @classmethod
    def _graded(cls, white: float, walk: float, micro_g: float, degree_hour: float) -> Imu:
        """From micro-g/sqrt(Hz), degrees/sqrt(h), micro-g and degrees/h."""
        return cls(
            velocity_random_walk=white * _MICRO_G,
            angle_random_walk=walk * _DEGREE_PER_ROOT_HOUR,
            accelerometer_bias=micro_g * _MICRO_G,
            gyroscope_bias=degree_hour * _DEGREE_PER_HOUR,
        )


@dataclass(frozen=True)
class GaussMarkov:
    """A disturbance that forgets: first-order Gauss-Markov process ``dd/dt = -d/time_constant + n``.

    Its standard deviation settles at ``sigma``, its correlation falls by ``e`` in ``time_constant``; the
    noise density is ``2 sigma^2 / time_constant``.

    Parameters
    ----------
    sigma : float
        Standard deviation of each axis, in the unit of what is disturbed (an acceleration: m/s^2).
    time_constant : float
        s.

    Raises
    ------
    InvalidInputError
        If ``sigma`` is negative or ``time_constant`` not positive.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.dynamics.GaussMarkov(sigma=1e-3, time_constant=3000.0)
    GaussMarkov(sigma=0.001, time_constant=3000.0)
    """

    sigma: float
    time_constant: float

    def __post_init__(self) -> None:
        hold_numbers(self, positive=("time_constant",), at_least_zero=("sigma",))
