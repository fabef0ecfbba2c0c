"""The simplest fields: a point mass, and the same acceleration everywhere."""

from __future__ import annotations

from dataclasses import dataclass

from losnav import _core
from losnav._arrays import ArrayLike, FloatArray, hold_numbers, vectors
from losnav.errors import InvalidInputError
from losnav.gravity.field import Field


@dataclass(frozen=True)
class PointMass(Field):
    """All mass in the origin: ``U = mu/r``.

    Parameters
    ----------
    mu : float
        Gravitational parameter, m^3/s^2; zero for no gravity at all.

    Raises
    ------
    InvalidInputError
        If ``mu`` is negative, NaN or infinite.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.gravity.PointMass(4.46275e5).acceleration([20e3, 0.0, 0.0]).round(9)
    array([-0.00111569, -0.        , -0.        ])
    """

    mu: float

    def __post_init__(self) -> None:
        hold_numbers(self, at_least_zero=("mu",))
        self._hold_field()

    def _times(self, factor: float) -> PointMass:
        return PointMass(factor * self.mu)

    def _make(self) -> _core.GravityField:
        return _core.GravityField.point_mass(self.mu)


@dataclass(frozen=True, eq=False, init=False)
class Uniform(Field):
    """Same acceleration everywhere, ``U = g . r``: for data taken in a laboratory, with ``Site.inertial()``.

    Parameters
    ----------
    acceleration : (3,)
        m/s^2; on the Earth with z up about ``[0, 0, -9.81]``.

    Raises
    ------
    InvalidInputError
        On a wrong shape, NaN or infinity.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.gravity.Uniform([0.0, 0.0, -9.81]).acceleration([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    array([[ 0.  ,  0.  , -9.81],
           [ 0.  ,  0.  , -9.81]])
    """

    value: FloatArray

    def __init__(self, acceleration: ArrayLike) -> None:
        value = vectors(acceleration, "acceleration").copy()
        if value.shape != (3,):
            raise InvalidInputError(f"acceleration: expected shape (3,), got {value.shape}")
        value.flags.writeable = False
        object.__setattr__(self, "value", value)
        self._hold_field()

    def _times(self, factor: float) -> Uniform:
        return Uniform(factor * self.value)

    def _make(self) -> _core.GravityField:
        x, y, z = self.value.tolist()
        return _core.GravityField.uniform((x, y, z))
