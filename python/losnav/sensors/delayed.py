"""Measurements that arrive late."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from losnav._arrays import finite
from losnav.errors import InvalidInputError


@dataclass(frozen=True)
class Delayed:
    """A sensor whose measurements are known to the filter only some time after they were taken.

    For ``run`` of a filter that keeps a copy of the pose of the exposure (a stochastic clone): the
    measurement stands at the epoch of its exposure, and is used ``latency`` later, against the pose of then.
    Everything else is the sensor's own.

    Parameters
    ----------
    sensor : sensor
        The sensor itself.
    latency : float
        From exposure to use, s; zero or more.

    Raises
    ------
    InvalidInputError
        On a latency that is negative, NaN or infinite, a sensor that is delayed already, or something that is
        no sensor.

    Examples
    --------
    >>> import losnav as ln
    >>> camera = ln.sensors.LandmarkCamera([[10.0, -20.0, 0.0]], 500.0, sigma_px=1.0)
    >>> late = ln.sensors.Delayed(camera, latency=1.5)
    >>> late.latency, late.sensor is camera
    (1.5, True)
    """

    sensor: Any
    latency: float

    def __post_init__(self) -> None:
        latency = finite(self.latency, "latency")
        if latency.ndim or latency < 0.0:
            raise InvalidInputError(f"latency: expected a number of seconds >= 0, got {self.latency!r}")
        if isinstance(self.sensor, Delayed):
            raise InvalidInputError("sensor: this one is delayed already; add the latencies")
        if not callable(getattr(self.sensor, "predict", None)):
            raise InvalidInputError(f"sensor: expected a sensor, got {type(self.sensor).__name__}")
        object.__setattr__(self, "latency", float(latency))
