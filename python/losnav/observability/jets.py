"""Numbers that carry a power series in time, and its gradient, through plain NumPy.

A user's model or sensor is called with an array of dtype ``object`` of :class:`Jet`: indexing, arithmetic,
``np.sqrt``, ``np.sin``, ``@``, ``np.cross``, ``np.linalg.norm`` and the like work on it element by element.
"""

from __future__ import annotations

from typing import Any, NoReturn

import numpy as np

from losnav._arrays import FloatArray

__all__ = ["Jet"]

# Whole powers up to here are products: they need no positive base.
_WHOLE = 64


class Jet:
    """``x(t + tau) = sum_k x_k tau^k`` as far as it is known, each coefficient with its gradient.

    ``coefficients`` is ``(orders known, 1 + N)``: values first, then derivatives along ``N`` directions.
    """

    __slots__ = ("coefficients",)

    def __init__(self, coefficients: FloatArray) -> None:
        self.coefficients = coefficients

    @property
    def value(self) -> float:
        """The number itself; comparisons go by it."""
        return float(self.coefficients[0, 0])

    def integral(self, start: FloatArray) -> Jet:
        """``start + integral of self``, known to one order more; ``start`` is ``(1 + N,)``."""
        orders = np.arange(1, len(self.coefficients) + 1)[:, np.newaxis]
        return Jet(np.vstack([start, self.coefficients / orders]))

    # --- arithmetic ------------------------------------------------------------------------------------

    def __neg__(self) -> Jet:
        return Jet(-self.coefficients)

    def __pos__(self) -> Jet:
        return self

    def __add__(self, other: Any) -> Any:
        if isinstance(other, Jet):
            known = min(len(self.coefficients), len(other.coefficients))
            return Jet(self.coefficients[:known] + other.coefficients[:known])
        if isinstance(other, np.ndarray):
            return NotImplemented
        shifted = self.coefficients.copy()
        shifted[0, 0] += other
        return Jet(shifted)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, np.ndarray) else self + (-other)

    def __rsub__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, np.ndarray) else (-self) + other

    def __mul__(self, other: Any) -> Any:
        if isinstance(other, Jet):
            return Jet(_product(self.coefficients, other.coefficients))
        return NotImplemented if isinstance(other, np.ndarray) else Jet(self.coefficients * other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        if isinstance(other, Jet):
            return self * other.reciprocal()
        return NotImplemented if isinstance(other, np.ndarray) else Jet(self.coefficients / other)

    def __rtruediv__(self, other: Any) -> Any:
        return NotImplemented if isinstance(other, np.ndarray) else self.reciprocal() * other

    def __pow__(self, exponent: Any) -> Any:
        if isinstance(exponent, np.ndarray):
            return NotImplemented
        if isinstance(exponent, Jet):
            return (self.log() * exponent).exp()
        power = float(exponent)
        if power.is_integer() and 0.0 <= power <= _WHOLE:
            result = self * 0.0 + 1.0
            for _ in range(int(power)):
                result = result * self
            return result
        return self._power(power)

    def __rpow__(self, base: Any) -> Any:
        return NotImplemented if isinstance(base, np.ndarray) else (self * float(np.log(base))).exp()

    def __mod__(self, period: float) -> Jet:
        return self + (-period * float(np.floor(self.value / period)))  # type: ignore[no-any-return]

    def __abs__(self) -> Jet:
        return -self if self.value < 0.0 else self

    def __bool__(self) -> bool:
        return self.value != 0.0

    def __float__(self) -> NoReturn:
        raise TypeError(
            "a power series is no plain number: let the state flow through NumPy's functions as it comes, "
            "not through math.*, float() or an array of dtype float"
        )

    def __lt__(self, other: Any) -> bool:
        return self.value < _plain(other)

    def __le__(self, other: Any) -> bool:
        return self.value <= _plain(other)

    def __gt__(self, other: Any) -> bool:
        return self.value > _plain(other)

    def __ge__(self, other: Any) -> bool:
        return self.value >= _plain(other)

    def __repr__(self) -> str:
        return f"Jet({self.value:.6g}, order {len(self.coefficients) - 1})"

    # --- what NumPy calls on the elements of an object array -------------------------------------------

    def conjugate(self) -> Jet:
        """Itself: it is real."""
        return self

    def sqrt(self) -> Jet:
        """Square root."""
        return self._power(0.5)

    def square(self) -> Jet:
        """Square."""
        return Jet(_product(self.coefficients, self.coefficients))

    def reciprocal(self) -> Jet:
        """One over it."""
        return self._power(-1.0)

    def fabs(self) -> Jet:
        """Absolute value."""
        return abs(self)

    def exp(self) -> Jet:
        """Exponential, by ``e' = a' e``."""
        e = self._started(np.exp(self.value), np.exp(self.value))
        for k in range(1, len(e)):
            e[k] = self._turned(e, k)
        return Jet(e)

    def log(self) -> Jet:
        """Natural logarithm."""
        return self._integrated(np.log(self.value), self.reciprocal())

    def sin(self) -> Jet:
        """Sine."""
        return self._sine_cosine()[0]

    def cos(self) -> Jet:
        """Cosine."""
        return self._sine_cosine()[1]

    def tan(self) -> Jet:
        """Tangent."""
        sine, cosine = self._sine_cosine()
        return sine / cosine  # type: ignore[no-any-return]

    def arctan(self) -> Jet:
        """Inverse tangent."""
        return self._integrated(np.arctan(self.value), (self.square() + 1.0).reciprocal())

    def arcsin(self) -> Jet:
        """Inverse sine."""
        return self._integrated(np.arcsin(self.value), (1.0 - self.square())._power(-0.5))

    def arccos(self) -> Jet:
        """Inverse cosine."""
        return self._integrated(np.arccos(self.value), -(1.0 - self.square())._power(-0.5))

    def arctan2(self, x: Any) -> Jet:
        """Angle of the vector ``(x, self)``: a quarter turn off where the quotient would overflow."""
        other = x if isinstance(x, Jet) else self * 0.0 + x
        flat = abs(other.value) >= abs(self.value)
        turn = (self / other).arctan() if flat else -(other / self).arctan()
        return turn + (np.arctan2(self.value, other.value) - turn.value)  # type: ignore[no-any-return]

    def hypot(self, other: Any) -> Jet:
        """Length of the vector ``(self, other)``."""
        return (self.square() + other * other).sqrt()  # type: ignore[no-any-return]

    def sinh(self) -> Jet:
        """Hyperbolic sine."""
        return (self.exp() - (-self).exp()) * 0.5  # type: ignore[no-any-return]

    def cosh(self) -> Jet:
        """Hyperbolic cosine."""
        return (self.exp() + (-self).exp()) * 0.5  # type: ignore[no-any-return]

    def tanh(self) -> Jet:
        """Hyperbolic tangent."""
        return self.sinh() / self.cosh()  # type: ignore[no-any-return]

    # --- recursions ------------------------------------------------------------------------------------

    def _started(self, value: float, derivative: float) -> FloatArray:
        """Room for a function of it, the first coefficient in place."""
        out = np.zeros_like(self.coefficients)
        out[0] = derivative * self.coefficients[0]
        out[0, 0] = value
        return out

    def _turned(self, other: FloatArray, k: int) -> FloatArray:
        """Coefficient ``k`` of the integral of ``self' other``."""
        j = np.arange(1, k + 1)
        return _summed(j / k, self.coefficients[j], other[k - j])

    def _integrated(self, value: float, derivative: Jet) -> Jet:
        """A function of it from its derivative, ``f' = a' g``."""
        f = self._started(value, derivative.value)
        for k in range(1, len(f)):
            f[k] = self._turned(derivative.coefficients, k)
        return Jet(f)

    def _sine_cosine(self) -> tuple[Jet, Jet]:
        s, c = np.sin(self.value), np.cos(self.value)
        sine, cosine = self._started(s, c), self._started(c, -s)
        for k in range(1, len(sine)):
            sine[k], cosine[k] = self._turned(cosine, k), -self._turned(sine, k)
        return Jet(sine), Jet(cosine)

    def _power(self, p: float) -> Jet:
        """``w = a^p`` by ``k a_0 w_k = sum_j (p j - (k - j)) a_j w_{k-j}``."""
        a = self.coefficients
        base = self.value
        w = self._started(base**p, p * base ** (p - 1.0))
        inverse = -a[:1] / base**2
        inverse[0, 0] = 1.0 / base
        for k in range(1, len(w)):
            j = np.arange(1, k + 1)
            w[k] = _product(inverse, _summed((p * j - (k - j)) / k, a[j], w[k - j])[np.newaxis])[0]
        return Jet(w)


def _plain(other: Any) -> float:
    return other.value if isinstance(other, Jet) else float(other)


def _summed(weights: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    """``sum_j weights_j a_j b_j`` of numbers with gradients."""
    scaled = weights * a[:, 0]
    total = scaled @ b
    total[1:] += (weights * b[:, 0]) @ a[:, 1:]
    return np.asarray(total)


def _product(a: FloatArray, b: FloatArray) -> FloatArray:
    """Coefficients of the product, as far as both are known."""
    known = min(len(a), len(b))
    a, b = a[:known], b[:known]
    out = np.zeros_like(a)
    for j in range(known):
        out[j:] += a[j, 0] * b[: known - j]
        out[j:, 1:] += b[: known - j, :1] * a[j, 1:]
    return out
