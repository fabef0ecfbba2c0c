"""Spherical harmonics of any degree."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np

from losnav import _core
from losnav._arrays import ArrayLike, FloatArray, as_float64, finite, hold_numbers
from losnav.errors import InvalidInputError
from losnav.gravity.field import Field


class BrillouinWarning(UserWarning):
    """Harmonics were used where the series need not converge."""


@dataclass(frozen=True, eq=False, init=False, repr=False)
class Harmonics(Field):
    """Spherical harmonics of any degree (G1).

    ``U = mu/r (1 + sum (radius/r)^n P_nm(sin lat) (C_nm cos m lon + S_nm sin m lon))``.

    Coefficients are either *unnormalised* (the default, as in this formula; no Condon-Shortley phase) or
    *fully normalised* (``normalized=True``, or :meth:`from_normalized`), as tables are published: ``C =
    C_normalized sqrt((2 - [m = 0]) (2n + 1) (n - m)!/(n + m)!)``. Taking one for the other is wrong by 2.2 at
    C20 and by 2.6e-2 at C44; ``repr`` says which it is.

    The series converges outside the sphere around the body and need not inside: the first call at a place
    inside it warns, with numbers. Inside, use :class:`Polyhedron`.

    Parameters
    ----------
    mu : float
        Gravitational parameter, m^3/s^2.
    radius : float
        Radius of reference the coefficients go with, m.
    c, s : (N + 1, N + 1)
        Coefficients, degree first; zero above the diagonal, ``s`` also in its first column. ``c[0, 0]`` is 1;
        0 there is taken as 1.
    normalized : bool
        Are they fully normalised?
    brillouin_radius : float, optional
        Radius of the smallest sphere about the centre of mass that holds the body, m; ``radius`` unless
        given. 0: no warning.

    Raises
    ------
    InvalidInputError
        On numbers out of range or wrong shapes.

    Examples
    --------
    >>> import losnav as ln
    >>> c = [[1, 0, 0], [0, 0, 0], [-0.117, 0, 0.056]]
    >>> field = ln.gravity.Harmonics(4.46275e5, 16e3, c, [[0, 0, 0]] * 3)
    >>> field
    Harmonics(mu=446275.0, radius=16000.0, degree 2, unnormalised)
    >>> field.acceleration([20e3, 0.0, 0.0]).round(9)
    array([-0.00160088,  0.        ,  0.        ])
    """

    mu: float
    radius: float
    c: FloatArray
    s: FloatArray
    normalized: bool
    brillouin_radius: float

    def __init__(
        self,
        mu: float,
        radius: float,
        c: ArrayLike,
        s: ArrayLike,
        *,
        normalized: bool = False,
        brillouin_radius: float | None = None,
    ) -> None:
        cosine, sine = _coefficients(c, "c"), _coefficients(s, "s")
        if cosine.shape != sine.shape:
            raise InvalidInputError(f"s: expected the shape of c, {cosine.shape}, got {sine.shape}")
        if sine[:, 0].any():
            raise InvalidInputError("s: expected zeros in the first column, order 0 has no sine")
        if cosine[0, 0] not in (0.0, 1.0):
            raise InvalidInputError(f"c[0, 0]: expected 1, mu being a number of its own, got {cosine[0, 0]}")
        cosine[0, 0] = 1.0
        limit = radius if brillouin_radius is None else brillouin_radius
        held = {"mu": mu, "radius": radius, "c": cosine, "s": sine, "normalized": bool(normalized)}
        for name, value in {**held, "brillouin_radius": limit, "_quiet": limit == 0.0}.items():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False
            object.__setattr__(self, name, value)
        hold_numbers(self, positive=("radius",), at_least_zero=("mu", "brillouin_radius"))
        self._hold_field()

    @classmethod
    def from_normalized(
        cls, mu: float, radius: float, c: ArrayLike, s: ArrayLike, *, brillouin_radius: float | None = None
    ) -> Harmonics:
        """Field of fully normalised coefficients.

        Parameters
        ----------
        mu, radius, c, s, brillouin_radius
            As for the class.

        Returns
        -------
        Harmonics
            With ``normalized=True``.

        Raises
        ------
        InvalidInputError
            As the class.
        """
        return cls(mu, radius, c, s, normalized=True, brillouin_radius=brillouin_radius)

    @property
    def degree(self) -> int:
        """The highest degree."""
        return len(self.c) - 1

    def coefficients(self, *, normalized: bool) -> tuple[FloatArray, FloatArray]:
        """Coefficients in the normalisation that is asked for.

        Parameters
        ----------
        normalized : bool
            Fully normalised, or unnormalised?

        Returns
        -------
        c, s : (N + 1, N + 1)
            Coefficients.
        """
        if normalized == self.normalized:
            return self.c, self.s
        factor = normalization(self.degree)
        if normalized:
            with np.errstate(divide="ignore", invalid="ignore"):
                inverse = np.where(factor > 0.0, 1.0 / factor, 0.0)
            return self.c * inverse, self.s * inverse
        return self.c * factor, self.s * factor

    def truncated(self, degree: int) -> Harmonics:
        """Field up to a lower degree.

        Parameters
        ----------
        degree : int
            From 0, a point mass, to that of this field.

        Returns
        -------
        Harmonics
            Without the higher terms.

        Raises
        ------
        InvalidInputError
            If the degree is not among them.
        """
        if not 0 <= degree <= self.degree:
            raise InvalidInputError(f"degree: expected 0 to {self.degree}, got {degree!r}")
        kept = slice(degree + 1)
        return self._with(self.mu, self.c[kept, kept], self.s[kept, kept])

    def rotated(self, longitude: float) -> Harmonics:
        """Same body in axes turned about z.

        Parameters
        ----------
        longitude : float
            Where the new x axis is in the old axes, rad.

        Returns
        -------
        Harmonics
            ``new.acceleration(R r) = R old.acceleration(r)``, ``R`` taking old components to new ones. At
            ``atan2(S22, C22)/2`` the long axis of the body becomes x, and ``S22 = 0``.

        Raises
        ------
        InvalidInputError
            If the angle is not a finite number.
        """
        angle = finite(longitude, "longitude")
        if angle.ndim:
            raise InvalidInputError(f"longitude: expected a number, got shape {angle.shape}")
        phase = np.arange(self.degree + 1) * angle
        cos, sin = np.cos(phase), np.sin(phase)
        return self._with(self.mu, self.c * cos + self.s * sin, self.s * cos - self.c * sin)

    def potential(self, r: ArrayLike) -> FloatArray:
        """As of every field."""
        self._look(r)
        return super().potential(r)

    def acceleration(self, r: ArrayLike) -> FloatArray:
        """As of every field."""
        self._look(r)
        return super().acceleration(r)

    def gradient(self, r: ArrayLike) -> FloatArray:
        """As of every field."""
        self._look(r)
        return super().gradient(r)

    def __repr__(self) -> str:
        kind = "fully normalised" if self.normalized else "unnormalised"
        return f"Harmonics(mu={self.mu}, radius={self.radius}, degree {self.degree}, {kind})"

    def _look(self, r: ArrayLike) -> None:
        """Warn, once, if a place is inside the sphere."""
        if getattr(self, "_quiet", False):
            return
        places = as_float64(r, "r")
        if places.size and places.shape[-1:] == (3,):
            self._approach(float(np.sqrt(np.min(np.sum(places * places, axis=-1)))))

    def _approach(self, distance: float) -> None:
        """The same, of a distance from the centre."""
        if getattr(self, "_quiet", False) or not distance < self.brillouin_radius:
            return
        object.__setattr__(self, "_quiet", True)
        growth = (self.brillouin_radius / max(distance, 1e-300)) ** (self.degree + 2)
        warnings.warn(
            f"harmonics of degree {self.degree} used {distance:.0f} m from the centre, inside the sphere of "
            f"{self.brillouin_radius:.0f} m around the body (Brillouin), where the series need not converge: "
            f"the first degree left out is {growth:.2g} times what it is on the sphere. At 20 m above Eros "
            "degree 4 is wrong by 15 to 40 % at the tips, tenfold elsewhere. Use gravity.Polyhedron, or say "
            "brillouin_radius=0 if this is known",
            BrillouinWarning,
            stacklevel=4,
        )

    def _with(self, mu: float, c: FloatArray, s: FloatArray) -> Harmonics:
        options = {"normalized": self.normalized, "brillouin_radius": self.brillouin_radius}
        return Harmonics(mu, self.radius, c, s, **options)  # type: ignore[arg-type]

    def _times(self, factor: float) -> Harmonics:
        return self._with(factor * self.mu, self.c, self.s)

    def _make(self) -> _core.GravityField:
        rows, columns = np.tril_indices(self.degree + 1)
        c, s = self.coefficients(normalized=True)
        table = np.stack([c[rows, columns], s[rows, columns]], axis=-1)
        return _core.GravityField.harmonics(self.mu, self.radius, table)


def normalization(degree: int) -> FloatArray:
    """Factors ``sqrt((2 - [m = 0]) (2n + 1) (n - m)!/(n + m)!)``, ``C = factor * C_normalized``.

    Parameters
    ----------
    degree : int
        The highest degree.

    Returns
    -------
    (degree + 1, degree + 1)
        Zero above the diagonal.

    Examples
    --------
    >>> from losnav.gravity.harmonics import normalization
    >>> normalization(2).round(4)
    array([[1.    , 0.    , 0.    ],
           [1.7321, 1.7321, 0.    ],
           [2.2361, 1.291 , 0.6455]])
    """
    factor = np.zeros((degree + 1, degree + 1))
    for n in range(degree + 1):
        factor[n, 0] = np.sqrt(2.0 * n + 1.0)
        for m in range(1, n + 1):
            factor[n, m] = factor[n, m - 1] * np.sqrt((2.0 if m == 1 else 1.0) / ((n + m) * (n - m + 1.0)))
    return factor


def _coefficients(value: ArrayLike, name: str) -> FloatArray:
    """A copy of a square table that is zero above its diagonal."""
    table: FloatArray = finite(value, name).copy()
    if table.ndim != 2 or table.shape[0] != table.shape[1] or not table.size:
        raise InvalidInputError(f"{name}: expected shape (N + 1, N + 1), got {table.shape}")
    if np.triu(table, 1).any():
        n, m = (int(i) for i in np.argwhere(np.triu(table, 1))[0])
        raise InvalidInputError(f"{name}[{n}, {m}]: expected 0, degree {n} has no order {m}")
    return table
