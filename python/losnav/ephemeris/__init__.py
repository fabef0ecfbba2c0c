"""Where planets and asteroids are: your own tables and functions, approximate planets, JPL kernels.

Times are seconds on any one clock, positions metres in the frame of the states that are to see or feel the
body: heliocentric ones for :class:`losnav.sensors.BodyDirection` and :class:`losnav.dynamics.ThirdBody`.
"""

from losnav.ephemeris.kernels import from_jpl
from losnav.ephemeris.planets import PLANET_MU, approximate_planet
from losnav.ephemeris.table import Ephemeris

__all__ = ["PLANET_MU", "Ephemeris", "approximate_planet", "from_jpl"]
