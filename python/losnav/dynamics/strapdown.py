"""Inertial navigation by accelerometers and gyroscopes fixed to the body."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from losnav._arrays import FloatArray, as_float64
from losnav.dynamics.imu import GaussMarkov, Imu
from losnav.dynamics.listed import hold_numbers
from losnav.dynamics.site import Site
from losnav.errors import InvalidInputError


@dataclass(frozen=True)
class Strapdown:
    """Position, velocity and attitude from what an inertial measurement unit shows, above a turning body.

    State :class:`losnav.NavState` in the axes of the site; control ``(specific_force, angular_rate)`` in body
    axes, as measured. Errors ``[dr dv da]``, then ``[db_a db_g]`` with ``biases``, then ``[dd]`` with
    ``acceleration``: 9, 12, 15 or 18.

    Parameters
    ----------
    site : Site
        The frame: where it is on the body, and how it turns.
    gravity : gravity model
        Of :mod:`losnav.gravity`, in the axes of the body; ``Uniform`` with ``Site.inertial()``.
    imu : Imu
        How noisy the unit is.
    biases : bool
        Are its biases estimated?
    acceleration : GaussMarkov, optional
        Is an acceleration that the model lacks estimated, and how does it behave?
    acceleration_psd : float
        Spectral density of a white acceleration that nobody models, on each axis, m^2/s^3; it adds to the
        noise of the accelerometers.

    Raises
    ------
    InvalidInputError
        If one of them is of the wrong kind or out of range.
    """

    site: Site
    gravity: Any
    imu: Imu
    biases: bool = True
    acceleration: GaussMarkov | None = None
    acceleration_psd: float = 0.0

    def __post_init__(self) -> None:
        for name, kind in (("site", Site), ("imu", Imu)):
            if not isinstance(getattr(self, name), kind):
                got = type(getattr(self, name)).__name__
                raise InvalidInputError(f"{name}: expected a {kind.__name__}, got {got}")
        if not (self.acceleration is None or isinstance(self.acceleration, GaussMarkov)):
            got = type(self.acceleration).__name__
            raise InvalidInputError(f"acceleration: expected a GaussMarkov or None, got {got}")
        hold_numbers(self, at_least_zero=("acceleration_psd",))
        object.__setattr__(self, "biases", bool(self.biases))

    @property
    def state_size(self) -> int:
        """Components of the error: 9, 12, 15 or 18."""
        return 9 + 6 * self.biases + 3 * (self.acceleration is not None)

    def _site_numbers(self) -> list[float]:
        """The frame as the engine takes it: matrix, centre, rate."""
        parts = (self.site.site_from_fixed, self.site.center, self.site.angular_velocity)
        return [float(value) for part in parts for value in np.ravel(part)]

    def _noise_numbers(self) -> list[float]:
        """Spectral densities, then deviation and time constant of the acceleration."""
        imu, markov = self.imu, self.acceleration or GaussMarkov(0.0, 1.0)
        return [
            imu.velocity_random_walk**2 + self.acceleration_psd,
            imu.angle_random_walk**2,
            imu.accelerometer_bias_walk**2,
            imu.gyroscope_bias_walk**2,
            markov.sigma,
            markov.time_constant,
        ]


def numbers_of(control: Any) -> FloatArray:
    """``(specific_force, angular_rate)`` or ``(..., 6)`` as one array."""
    if isinstance(control, tuple) and len(control) == 2:
        force, rate = (as_float64(part, "control") for part in control)
        for name, part in (("specific_force", force), ("angular_rate", rate)):
            if part.ndim < 1 or part.shape[-1] != 3:
                raise InvalidInputError(f"control: expected {name} of shape (..., 3), got {part.shape}")
        try:
            shape = np.broadcast_shapes(force.shape, rate.shape)
        except ValueError as error:
            raise InvalidInputError(
                f"control: shapes {force.shape} and {rate.shape} do not broadcast"
            ) from error
        return np.concatenate([np.broadcast_to(force, shape), np.broadcast_to(rate, shape)], axis=-1)
    array = as_float64(control, "control")
    if array.ndim < 1 or array.shape[-1] != 6:
        raise InvalidInputError(
            f"control: expected (specific_force, angular_rate) or shape (..., 6), got {array.shape}"
        )
    return array
