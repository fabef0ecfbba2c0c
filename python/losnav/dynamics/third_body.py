"""Bodies that pull a spacecraft on its way about another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from losnav._arrays import FloatArray, hold_numbers
from losnav.ephemeris import Ephemeris
from losnav.errors import InvalidInputError


@dataclass(frozen=True)
class ThirdBody:
    """A body that pulls: its gravitational parameter and where it is.

    Parameters
    ----------
    mu : float
        Gravitational parameter, m^3/s^2; of the planets in ``losnav.ephemeris.PLANET_MU``.
    ephemeris : losnav.Ephemeris
        Its path from the centre of the model it is given to, on the clock of the filter.

    Raises
    ------
    InvalidInputError
        If ``mu`` is not positive, or the path is no ephemeris.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> times = np.linspace(0.0, 4e7, 50)
    >>> path = ln.Ephemeris.sampled(lambda t: ln.ephemeris.approximate_planet("jupiter", t), times)
    >>> jupiter = ln.dynamics.ThirdBody(ln.ephemeris.PLANET_MU["jupiter"], path)
    >>> model = ln.dynamics.TwoBody(ln.constants.SUN_MU, third_bodies=[jupiter])
    >>> state = [2.0e11, 0.0, 0.0, 0.0, 2.5e4, 1.0e3]
    >>> alone = ln.dynamics.TwoBody(ln.constants.SUN_MU)
    >>> off = model.propagate(state, 1.5e7, time=1e6) - alone.propagate(state, 1.5e7)
    >>> bool(1e7 < np.linalg.norm(off[:3]) < 1e8)  # tens of thousands of kilometres in half a year
    True
    """

    mu: float
    ephemeris: Ephemeris

    def __post_init__(self) -> None:
        hold_numbers(self, positive=("mu",))
        if not isinstance(self.ephemeris, Ephemeris):
            raise InvalidInputError(
                "ephemeris: expected a losnav.Ephemeris (of a function: Ephemeris.sampled(function, times)), "
                f"got {type(self.ephemeris).__name__}"
            )

    def pull(self, position: FloatArray, time: FloatArray) -> FloatArray:
        """Acceleration of a place relative to the centre, ``(..., 3)``, m/s^2."""
        there = self.ephemeris(time)[..., :3]
        away = position - there
        direct = away / np.linalg.norm(away, axis=-1, keepdims=True) ** 3
        pull: FloatArray = -self.mu * (direct + there / np.linalg.norm(there, axis=-1, keepdims=True) ** 3)
        return pull

    def stretches(self) -> FloatArray:
        """``(pieces, 28)`` for the engine: parameter, pieces left, and the ephemeris."""
        table = self.ephemeris._table()
        left = np.arange(len(table), 0, -1.0)
        return np.column_stack([np.full(len(table), self.mu), left, table])
