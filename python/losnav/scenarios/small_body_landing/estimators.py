"""The filters that are compared, and one run of each over a block of measurements."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import losnav as ln
from losnav.dynamics import GaussMarkov, Imu, Strapdown
from losnav.scenarios.small_body_landing.sensing import Measured

if TYPE_CHECKING:
    from losnav.scenarios.small_body_landing import SmallBodyLanding

__all__ = ["Estimate", "Navigator", "estimate", "navigators"]

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Navigator:
    """A filter.

    Attributes
    ----------
    name : str
    noise : float
        White acceleration beyond that of the inertial unit, m/s²/√Hz.
    biases : bool
        Whether the biases of the inertial unit are estimated.
    bias_walk : float
        Random walk of the accelerometers' bias, m/s²/√s.
    disturbance : GaussMarkov, optional
        Acceleration that is estimated.
    weight : float, optional
        Weight of the predictive stage, s⁴/m²; None is an extended Kalman filter.
    map_errors : str
        What becomes of the errors of the map; see :class:`~losnav.sensors.LandmarkCamera`.
    options : dict
        Further options of the filter.
    """

    name: str
    noise: float = 0.0
    biases: bool = False
    bias_walk: float = 0.0
    disturbance: GaussMarkov | None = None
    weight: float | None = None
    map_errors: str = "white"
    options: dict[str, Any] = field(default_factory=dict)

    def model(self, measured: Measured, gravity: Any, unit: Imu) -> Strapdown:
        """Its dynamics."""
        grade = Imu(unit.velocity_random_walk, unit.angle_random_walk, accelerometer_bias_walk=self.bias_walk)
        return Strapdown(
            measured.flight.site,
            gravity,
            grade,
            biases=self.biases,
            acceleration=self.disturbance,
            acceleration_psd=self.noise**2,
        )

    def sigmas(self, first: Array, unit: Imu) -> Array:
        """First 1-sigma of all its errors, from those of position, velocity and attitude (9,)."""
        parts = [first]
        if self.biases:
            parts.append(np.repeat([unit.accelerometer_bias, unit.gyroscope_bias], 3))
        if self.disturbance is not None:
            parts.append(np.full(3, self.disturbance.sigma))
        return np.concatenate(parts)


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a filter made of a block of runs, at the epochs.

    Attributes
    ----------
    error : (runs, T, 9) array
        True minus estimate: position, velocity, attitude; m, m/s, rad.
    sigma : (runs, T, 9) array
        The filter's own 1-sigma.
    nees : (runs, T) array
        Of the nine.
    disturbance : (runs, T, 3) array
        Estimated acceleration or model error, site axes, m/s².
    """

    error: Array
    sigma: Array
    nees: Array
    disturbance: Array


def navigators(scenario: SmallBodyLanding) -> tuple[Navigator, ...]:
    """The filters of the comparison, in the order of the arrays."""
    s = scenario
    return (
        Navigator("EKF, tight"),
        Navigator("predictive", weight=s.predictive_weight),
        Navigator("EKF, tuned", noise=s.tuned_noise),
        Navigator("EKF, bias constant", biases=True),
        Navigator("EKF, bias walks", biases=True, bias_walk=s.bias_walk),
        Navigator("EKF, acceleration", disturbance=GaussMarkov(s.disturbance_sigma, s.disturbance_time)),
        Navigator("EKF, equal gain", noise=s.equal_gain_noise),
    )


def first_sigmas(scenario: SmallBodyLanding) -> Array:
    """1-sigma of the first estimates, (9,)."""
    s = scenario
    return np.repeat([s.position_sigma, s.velocity_sigma, s.attitude_sigma], 3)


def estimate(
    navigator: Navigator,
    measured: Measured,
    gravity: Any,
    *,
    sigmas: Array | None = None,
    unit: Imu | None = None,
    pixels: Array | None = None,
    velocity: Array | None = None,
    latency: float = 0.0,
) -> Estimate:
    """Filter a block of runs.

    Parameters
    ----------
    navigator : Navigator
    measured : Measured
    gravity : object
        The filter's field.
    sigmas : (9,) array, optional
        1-sigma of the first errors, true and assumed; the scenario's if None.
    unit : Imu, optional
        Inertial unit assumed; the scenario's if None.
    pixels, velocity : arrays, optional
        In place of the measured ones.
    latency : float
        Age of the images when they are used, s.
    """
    flight, s = measured.flight, measured.flight.scenario
    grade = s.unit if unit is None else unit
    first = first_sigmas(s) if sigmas is None else sigmas
    deviations = navigator.sigmas(first, grade)
    start, covariance = measured.first(first), np.diag(deviations**2)
    model = navigator.model(measured, gravity, grade)
    ekf: Any
    if navigator.weight is None:
        ekf = ln.ExtendedKalmanFilter(model, start, covariance, **navigator.options)
    else:
        ekf = ln.PredictiveFilter(model, start, covariance, weight=navigator.weight, **navigator.options)
    camera: Any = flight.camera(navigator.map_errors)
    if latency > 0:
        camera = ln.sensors.Delayed(camera, latency)
    sensors = [
        (camera, measured.pixels if pixels is None else pixels),
        (flight.velocimeter, measured.velocity if velocity is None else velocity),
    ]
    log = ekf.run(
        flight.times, sensors, controls=measured.controls, substeps=flight.descent.stride(s.sampling)
    )
    found = log.state.acceleration if navigator.weight is None else log.model_error
    return _judged(flight.state.minus(log.state, 9), log, np.asarray(found))


def _judged(error: Array, log: Any, found: Array) -> Estimate:
    covariance = np.asarray(log.covariance)[..., :9, :9]
    with np.errstate(invalid="ignore"):
        sigma = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    nees = np.einsum("...i,...i->...", error, _solved(covariance, error))
    return Estimate(error, sigma, nees, found)


def _solved(covariance: Array, error: Array) -> Array:
    try:
        return np.asarray(np.linalg.solve(covariance, error[..., np.newaxis])[..., 0])
    except np.linalg.LinAlgError:
        return np.full_like(error, np.nan)
