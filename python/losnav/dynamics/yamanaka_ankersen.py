"""Relative motion about an eccentric orbit."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from losnav._arrays import finite
from losnav.dynamics.listed import Listed, hold_numbers
from losnav.errors import InvalidInputError


@dataclass(frozen=True)
class YamanakaAnkersen(Listed):
    """Motion relative to a target on an eccentric orbit, linear in the separation (Yamanaka & Ankersen 2002).

    State ``[r v]``, ``(..., 6)``: chaser minus target, m and m/s, in the target's orbital frame (x along
    track, y along the negative orbit normal, z to nadir), velocity as seen in that rotating frame. Equal to
    :class:`ClohessyWiltshire` at eccentricity 0. The control is an acceleration held in the frame. A step
    depends on when it starts: ``time=``, and a filter's own time, count from where ``true_anomaly`` holds.

    Parameters
    ----------
    mu : float
        Gravitational parameter, m^3/s^2.
    semi_major_axis : float
        Of the target, m.
    eccentricity : float
        Of the target, at least 0 and below 1.
    true_anomaly : float
        Of the target at time 0, rad.
    acceleration_psd : float
        Spectral density of the disturbing acceleration on each axis, m^2/s^3.

    Raises
    ------
    InvalidInputError
        If a parameter is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> orbit = ln.dynamics.YamanakaAnkersen(ln.constants.EARTH_MU, 9.0e6, 0.2, true_anomaly=np.pi)
    >>> state = [-500.0, 10.0, 20.0, 0.03, 0.0, 0.0]
    >>> orbit.propagate(state, 600.0, time=[0.0, 4248.6])[:, 0].round(1)  # from the apoapsis, the periapsis
    array([-476.8, -500.4])
    """

    mu: float
    semi_major_axis: float
    eccentricity: float
    true_anomaly: float = 0.0
    acceleration_psd: float = 0.0

    time_varying: ClassVar[bool] = True

    def __post_init__(self) -> None:
        hold_numbers(
            self, positive=("mu", "semi_major_axis"), at_least_zero=("eccentricity", "acceleration_psd")
        )
        if self.eccentricity >= 1.0:
            raise InvalidInputError(f"eccentricity: expected a number below 1, got {self.eccentricity!r}")
        anomaly = finite(self.true_anomaly, "true_anomaly")
        if anomaly.ndim:
            raise InvalidInputError(f"true_anomaly: expected a number, got shape {anomaly.shape}")
        object.__setattr__(self, "true_anomaly", float(anomaly))

    def _parameters(self) -> list[float]:
        return [
            self.mu,
            self.semi_major_axis,
            self.eccentricity,
            self.true_anomaly,
            self.acceleration_psd,
        ]
