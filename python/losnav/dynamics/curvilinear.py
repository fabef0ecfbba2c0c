"""Relative motion along the orbit's circle."""

from __future__ import annotations

from dataclasses import dataclass

from losnav.dynamics.listed import Listed, hold_numbers


@dataclass(frozen=True)
class CurvilinearClohessyWiltshire(Listed):
    """Clohessy-Wiltshire in coordinates that bend with the orbit, for separations of many kilometres.

    State ``[r v]``, ``(..., 6)``: as for :class:`ClohessyWiltshire`, Cartesian in the target's orbital frame,
    so that sensors and measurements are the same. Inside a step it goes over to the coordinates of
    :func:`losnav.orbits.curvilinear_from_lvlh`, where a distance along the track is no error of the linear
    equations, and back. The control acts along the coordinate lines: in the axes of the chaser's own
    orbital frame.

    Parameters
    ----------
    mean_motion : float
        Of the target, ``sqrt(mu / a^3)``, rad/s.
    radius : float
        Of the target's orbit, m.
    acceleration_psd : float
        Spectral density of the disturbing acceleration on each axis, m^2/s^3.

    Raises
    ------
    InvalidInputError
        If a parameter is out of range.

    Examples
    --------
    >>> import losnav as ln
    >>> rate = float(ln.orbits.mean_motion(ln.constants.EARTH_MU, 7.0e6))
    >>> behind = ln.orbits.lvlh_from_curvilinear([-160e3, 0, 0, 0, 0, 0], 7.0e6)  # on the target's own orbit
    >>> bent = ln.dynamics.CurvilinearClohessyWiltshire(rate, 7.0e6)
    >>> abs(bent.propagate(behind, 5000.0) - behind).max() < 1e-6  # stays there
    np.True_
    >>> straight = ln.dynamics.ClohessyWiltshire(rate)
    >>> abs(straight.propagate(behind, 5000.0) - behind).max() > 40e3
    np.True_
    """

    mean_motion: float
    radius: float
    acceleration_psd: float = 0.0

    def __post_init__(self) -> None:
        hold_numbers(self, positive=("radius",), at_least_zero=("mean_motion", "acceleration_psd"))

    def _parameters(self) -> list[float]:
        return [self.mean_motion, self.radius, self.acceleration_psd]
