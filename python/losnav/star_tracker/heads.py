"""A head of a star tracker: how it is mounted, what it sees, how well it measures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from losnav._arrays import ArrayLike, FloatArray, finite, rotations, units
from losnav._arrays import covariances as checked_covariances
from losnav.errors import InvalidInputError
from losnav.star_tracker._rotation import mounting_of, unit
from losnav.star_tracker.field import Shape, checked_shape, detector_points, head_covariance, whole
from losnav.star_tracker.star_noise import QuestNoise, StarNoise, field, information_of_directions

__all__ = ["Head"]


@dataclass(frozen=True, eq=False)
class Head:
    """One optical head: mounting, field, noise.

    Parameters
    ----------
    mounting : (3, 3)
        Fusion from head, ``S_n``: its third column is the boresight in fusion axes.
    fov : float, optional
        Full field of view from edge to edge, rad.
    noise : float, QuestNoise, PixelNoise or StarNoise
        A number is the 1-sigma noise per axis of every star, rad. With the default, estimates are the same
        but covariances are in units of an unknown noise.
    name : str
        What messages call this head; by default its number, counted from 0.
    mounting_covariance : (3, 3), optional
        Covariance of the mounting's error ``mu`` in fusion axes, rad^2: the true mounting is
        ``exp(-[mu x]) mounting``. None means perfect.

    Raises
    ------
    InvalidInputError
        On a mounting that is no rotation, a field not in (0, pi), or noise that is not positive.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> arcsec = np.radians(1 / 3600)
    >>> head = ln.star_tracker.Head.looking([1.0, 0.0, 0.0], fov=np.radians(20), noise=7.03 * arcsec)
    >>> head.boresight
    array([1., 0., 0.])
    >>> (np.sqrt(np.diag(head.covariance(stars=8))) / arcsec).round(2)      # head axes, 8 stars
    array([ 2.5 ,  2.5 , 17.51])
    """

    mounting: FloatArray
    fov: float | None = None
    noise: float | StarNoise = 1.0
    name: str = ""
    mounting_covariance: FloatArray | None = None

    def __post_init__(self) -> None:
        mounting = rotations(self.mounting, "mounting")
        if mounting.shape != (3, 3):
            raise InvalidInputError(f"mounting: expected shape (3, 3), got {mounting.shape}")
        object.__setattr__(self, "mounting", _frozen(mounting))
        if self.fov is not None:
            object.__setattr__(self, "fov", field(self.fov))
        if not isinstance(self.noise, StarNoise):
            try:
                object.__setattr__(self, "noise", QuestNoise(self.noise))
            except InvalidInputError as error:
                raise InvalidInputError(
                    "noise: expected a noise model or the 1-sigma noise of a star, a positive number, "
                    f"got {self.noise!r}"
                ) from error
        if self.mounting_covariance is not None:
            spread = checked_covariances(self.mounting_covariance, "mounting_covariance")
            if spread.shape != (3, 3):
                raise InvalidInputError(f"mounting_covariance: expected shape (3, 3), got {spread.shape}")
            object.__setattr__(self, "mounting_covariance", _frozen(spread))

    @classmethod
    def looking(
        cls,
        boresight: ArrayLike,
        fov: float | None = None,
        noise: float | StarNoise = 1.0,
        name: str = "",
        mounting_covariance: ArrayLike | None = None,
    ) -> Head:
        """A head that looks along a direction of the fusion frame, turned there from +z the short way.

        Parameters
        ----------
        boresight : (3,)
            Direction in fusion axes, of any length but zero.
        fov, noise, name, mounting_covariance
            As for :class:`Head`.

        Returns
        -------
        Head

        Raises
        ------
        InvalidInputError
            On bad arguments.

        Examples
        --------
        >>> import losnav as ln
        >>> ln.star_tracker.Head.looking([0.0, 1.0, 0.0]).mounting + 0.0
        array([[ 1.,  0.,  0.],
               [ 0.,  0.,  1.],
               [ 0., -1.,  0.]])
        """
        axis = finite(boresight, "boresight")
        if axis.shape != (3,):
            raise InvalidInputError(f"boresight: expected shape (3,), got {axis.shape}")
        return cls(mounting_of(axis), fov, noise, name, mounting_covariance)  # type: ignore[arg-type]

    @property
    def boresight(self) -> FloatArray:
        """Optical axis in fusion axes, ``(3,)``: the third column of the mounting."""
        return self.mounting[:, 2]

    @property
    def model(self) -> StarNoise:
        """The noise model."""
        return cast(StarNoise, self.noise)

    def information(self, body_vectors: ArrayLike) -> FloatArray:
        """Information of stars about the head's attitude, by the head's noise model.

        Parameters
        ----------
        body_vectors : (..., N, 3)
            Unit vectors in head axes; N may be 0.

        Returns
        -------
        (..., 3, 3)
            Head axes, 1/rad^2; equation (X14) for :class:`QuestNoise`.

        Raises
        ------
        InvalidInputError
            On vectors that are not unit.

        Examples
        --------
        >>> import losnav as ln
        >>> head = ln.star_tracker.Head.looking([0.0, 0.0, 1.0], noise=0.5)
        >>> head.information([[0.0, 0.0, 1.0]]).diagonal()
        array([4., 4., 0.])
        """
        b = units(body_vectors, "body_vectors")
        return information_of_directions(b, self.model.covariance(b))

    def covariance(self, stars: int, shape: Shape = "square") -> FloatArray:
        """Attitude covariance expected of so many stars spread over the field, :func:`head_covariance`.

        Parameters
        ----------
        stars : int
            Number of stars, at least 2.
        shape : {"square", "circle"}
            Of the detector.

        Returns
        -------
        (3, 3)
            Head axes, rad^2.

        Raises
        ------
        InvalidInputError
            If the head has no ``fov``, or on fewer than two stars.

        Examples
        --------
        >>> import numpy as np
        >>> import losnav as ln
        >>> head = ln.star_tracker.Head.looking([0.0, 0.0, 1.0], fov=np.radians(20), noise=1.0)
        >>> np.sqrt(np.diag(head.covariance(stars=100))).round(3)
        array([0.101, 0.101, 0.705])
        """
        if self.fov is None:
            raise InvalidInputError("fov: expected a head with a field of view, got None")
        return head_covariance(self.fov, stars, self.model, shape=shape)

    def stars(self, count: int, rng: np.random.Generator | int, shape: Shape = "square") -> FloatArray:
        """Random directions spread evenly over the detector.

        Parameters
        ----------
        count : int
            Number of stars.
        rng : numpy.random.Generator or int
            Source of randomness, or its seed.
        shape : {"square", "circle"}
            Of the detector.

        Returns
        -------
        (count, 3)
            Unit vectors in head axes.

        Raises
        ------
        InvalidInputError
            If the head has no ``fov``, or the count is negative.

        Examples
        --------
        >>> import numpy as np
        >>> import losnav as ln
        >>> stars = ln.star_tracker.Head.looking([1.0, 0.0, 0.0], fov=np.radians(20)).stars(5, rng=1)
        >>> bool((stars[:, 2] > np.cos(np.radians(15))).all())
        True
        """
        if self.fov is None:
            raise InvalidInputError("fov: expected a head with a field of view, got None")
        number = whole(count, "count", 0)
        generator = np.random.default_rng(rng)
        flat = detector_points(generator, number, checked_shape(shape))
        plane = math.tan(0.5 * self.fov) * flat
        return unit(np.concatenate([plane, np.ones((number, 1))], axis=1))

    def measure(self, body_vectors: ArrayLike, rng: np.random.Generator | int) -> FloatArray:
        """Directions with noise of this head's model.

        Parameters
        ----------
        body_vectors : (..., 3)
            True unit vectors in head axes.
        rng : numpy.random.Generator or int
            Source of randomness, or its seed.

        Returns
        -------
        (..., 3)
            Unit vectors.

        Raises
        ------
        InvalidInputError
            On vectors that are not unit.

        Examples
        --------
        >>> import numpy as np
        >>> import losnav as ln
        >>> head = ln.star_tracker.Head.looking([0.0, 0.0, 1.0], noise=1e-5)
        >>> measured = head.measure(np.broadcast_to([0.0, 0.0, 1.0], (10_000, 3)), rng=1)
        >>> (measured.std(axis=0) / 1e-5).round(1)
        array([1., 1., 0.])
        """
        spread = self.model.covariance(body_vectors)
        true = unit(finite(body_vectors, "body_vectors"))
        values, axes = np.linalg.eigh(spread)
        white = np.random.default_rng(rng).standard_normal(true.shape)
        root = axes * np.sqrt(np.maximum(values, 0.0))[..., np.newaxis, :]
        return unit(true + np.einsum("...ij,...j->...i", root, white))


def checked_heads(heads: Sequence[Head]) -> list[Head]:
    """At least one head; bare mountings are welcome."""
    try:
        entries = list(heads)
    except TypeError as error:
        raise InvalidInputError(f"heads: expected a sequence of Head, got {type(heads).__name__}") from error
    if not entries:
        raise InvalidInputError("heads: expected at least one Head, got none")
    mounted = []
    for n, entry in enumerate(entries):
        if isinstance(entry, Head):
            mounted.append(entry)
            continue
        try:
            mounted.append(Head(entry))
        except InvalidInputError as error:
            raise InvalidInputError(f"heads[{n}]: expected a Head or its mounting; {error}") from error
    return mounted


def _frozen(array: FloatArray) -> FloatArray:
    own = np.array(array)
    own.flags.writeable = False
    return own
