"""What every field of gravity does the same way: ask the engine, scale, copy."""

from __future__ import annotations

from typing import Any, TypeVar

from losnav import _core
from losnav._arrays import ArrayLike, FloatArray, finite
from losnav.errors import InvalidInputError

Self = TypeVar("Self", bound="Field")


class Field:
    """The engine's side of a model."""

    _field: _core.GravityField

    def potential(self, r: ArrayLike) -> FloatArray:
        """Potential ``U``, positive, zero at infinity (of a uniform field: at the origin).

        Parameters
        ----------
        r : (..., 3)
            Places, body-fixed axes, m.

        Returns
        -------
        (...)
            m^2/s^2.

        Raises
        ------
        InvalidInputError
            On a wrong shape, NaN, infinity, or a place where the field is not finite.
        """
        return self._field.potential(r)

    def acceleration(self, r: ArrayLike) -> FloatArray:
        """Acceleration ``g``, the gradient of the potential.

        Parameters
        ----------
        r : (..., 3)
            Places, body-fixed axes, m.

        Returns
        -------
        (..., 3)
            Body-fixed axes, m/s^2.

        Raises
        ------
        InvalidInputError
            On a wrong shape, NaN, infinity, or a place where the field is not finite.
        """
        return self._field.acceleration(r)

    def gradient(self, r: ArrayLike) -> FloatArray:
        """Gradient of the acceleration, ``dg/dr``, symmetric.

        Parameters
        ----------
        r : (..., 3)
            Places, body-fixed axes, m.

        Returns
        -------
        (..., 3, 3)
            1/s^2.

        Raises
        ------
        InvalidInputError
            On a wrong shape, NaN, infinity, or a place where the field is not finite.
        """
        return self._field.gradient(r)

    def scaled(self: Self, factor: float) -> Self:
        """Same field times a number; ``factor * field`` is the same.

        Parameters
        ----------
        factor : float
            Not negative. A filter whose gravity is 20 % short of the truth has ``0.8 * truth``.

        Returns
        -------
        the same kind of field
            With ``factor`` times the mass, acceleration or density.

        Raises
        ------
        InvalidInputError
            If the factor is negative or not finite.
        """
        number = finite(factor, "factor")
        if number.ndim or number < 0.0:
            raise InvalidInputError(f"factor: expected a number >= 0, got {factor!r}")
        return self._times(float(number))

    def __mul__(self: Self, factor: float) -> Self:
        """Times a number."""
        return self.scaled(factor)

    __rmul__ = __mul__

    def _times(self: Self, factor: float) -> Self:
        raise NotImplementedError

    def _make(self) -> _core.GravityField:
        """The engine's field."""
        raise NotImplementedError

    def _hold_field(self) -> None:
        object.__setattr__(self, "_field", self._make())

    # What the engine holds is made again on the other side.
    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_field"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._hold_field()
