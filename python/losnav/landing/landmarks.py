"""A catalogue of landmarks round a site, which of them are seen and used, and what a camera makes of them.

    p = C_cb (dcm (L - r) - l),    [u v] = f [p_x/p_z  p_y/p_z] + c + noise              (pinhole)

Of the landmarks in view a front end keeps the three that span the largest triangle of the image: with three
the geometry decides everything. Left out: occlusion by terrain, illumination, distortion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import Generator, default_rng

from losnav._arrays import ArrayLike, FloatArray, positive, vectors
from losnav.errors import InvalidInputError

if TYPE_CHECKING:
    from losnav.navigation_state import NavState
    from losnav.sensors import LandmarkCamera

__all__ = ["ImageMeasurements", "choose_landmarks", "measure_images", "ring_landmarks"]

Indices = np.ndarray[Any, np.dtype[np.intp]]
Flags = np.ndarray[Any, np.dtype[np.bool_]]


def ring_landmarks(
    rings: int = 13,
    per_ring: int = 8,
    *,
    first: float = 8.0,
    growth: float = 1.6,
    height: float = 0.05,
    rng: Generator | int | None = 0,
) -> FloatArray:
    """Landmarks on rings that grow geometrically: some are in view from every altitude.

    Parameters
    ----------
    rings, per_ring : int
        How many, and landmarks evenly spaced on each.
    first, growth : float
        Radius of the innermost ring, m, and from one ring to the next.
    height : float
        Heights are uniform within this share of the ring's radius.
    rng : numpy.random.Generator or seed
        Source of the heights.

    Returns
    -------
    (rings * per_ring, 3)
        Site frame (East, North, Up), m, innermost ring first.

    Raises
    ------
    InvalidInputError
        On counts below 1 or lengths that are not positive.

    Examples
    --------
    >>> import losnav as ln
    >>> ln.landing.ring_landmarks().shape
    (104, 3)
    """
    for name, count in (("rings", rings), ("per_ring", per_ring)):
        if not isinstance(count, int) or count < 1:
            raise InvalidInputError(f"{name}: expected a whole number, at least 1, got {count!r}")
    start, ratio = float(positive(first, "first")), float(positive(growth, "growth"))
    radius = np.repeat(start * ratio ** np.arange(rings), per_ring)
    angle = np.tile(2.0 * np.pi * np.arange(per_ring) / per_ring, rings)
    up = height * radius * default_rng(rng).uniform(-1.0, 1.0, radius.size)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), up], axis=-1)


def choose_landmarks(camera: LandmarkCamera, state: NavState) -> Indices:
    """The three landmarks that span the largest triangle of each image.

    Parameters
    ----------
    camera : LandmarkCamera
        With its catalogue, mounting and image size.
    state : NavState of shape (T,)
        Where the images are taken.

    Returns
    -------
    (T, 3) of int
        Indices into the camera's landmarks, rising; -1 in the whole row where fewer than three are in view.

    Raises
    ------
    InvalidInputError
        If the state is not a row of states.

    Examples
    --------
    >>> import losnav as ln
    >>> camera = ln.sensors.LandmarkCamera(ln.landing.ring_landmarks(), 500.0, 1.0, image_size=(1024, 1024))
    >>> heights = [[0.0, 0.0, 900.0], [0.0, 0.0, 90.0]]
    >>> states = ln.NavState.from_dcm(heights, [0.0, 0.0, -1.0], ln.landing.NADIR)
    >>> ln.landing.choose_landmarks(camera, states) // 8  # rings
    array([[10, 10, 10],
           [ 6,  6,  6]])
    """
    _row(state)
    pixels = _pixels(camera, camera.landmarks, state)
    chosen = np.full((len(state), 3), -1, dtype=np.intp)
    for k, visible in enumerate(camera.visible(state)):
        candidates = np.flatnonzero(visible)
        if len(candidates) >= 3:
            chosen[k] = np.sort(candidates[_largest_triangle(pixels[k, candidates])])
    return chosen


@dataclass(frozen=True, eq=False)
class ImageMeasurements:
    """Images of all runs.

    Attributes
    ----------
    pixels : (runs, T, 2 N) array
        ``[u0 v0 u1 v1 ...]`` of all N landmarks of the camera; NaN where one is not used. The ``z`` of a
        filter.
    wrong : (runs, T, N) array of bool
        Pixels that belong to another landmark than they are said to.
    """

    pixels: FloatArray
    wrong: Flags


def measure_images(
    camera: LandmarkCamera,
    state: NavState,
    chosen: Indices,
    rngs: Sequence[Generator],
    *,
    landmarks: ArrayLike | None = None,
    mismatches: float = 0.0,
) -> ImageMeasurements:
    """Pixels of the chosen landmarks with noise (L5).

    Parameters
    ----------
    camera : LandmarkCamera
        Its landmarks are the map; its ``sigma_px`` is the noise.
    state : NavState of shape (T,)
        True states at the exposures.
    chosen : (T, 3) of int
        See :func:`choose_landmarks`; -1 is no landmark.
    rngs : sequence of Generator
        One for each run.
    landmarks : (N, 3) or (runs, N, 3), optional
        Where the landmarks truly are, if not where the map says.
    mismatches : float
        Share of the pixels that are those of another landmark in view.

    Returns
    -------
    ImageMeasurements

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity or a share outside [0, 1).
    """
    _row(state)
    runs, count, (epochs, corners) = len(rngs), len(camera.landmarks), chosen.shape
    truth = camera.landmarks if landmarks is None else vectors(landmarks, "landmarks")
    if truth.shape not in ((count, 3), (runs, count, 3)):
        raise InvalidInputError(
            f"landmarks: expected shape ({count}, 3) or ({runs}, {count}, 3), got {truth.shape}"
        )
    if epochs != len(state):
        raise InvalidInputError(f"chosen: expected {len(state)} rows, got {epochs}")
    if not 0.0 <= mismatches < 1.0:
        raise InvalidInputError(f"mismatches: expected a share in [0, 1), got {mismatches:g}")
    noise = np.stack([rng.standard_normal((epochs, corners, 2)) for rng in rngs])
    # What is imaged in place of each chosen landmark: itself, or by mistake another.
    imaged = np.broadcast_to(chosen, (runs, epochs, corners))
    if mismatches > 0.0:
        imaged = _mistaken(camera.visible(state), imaged, rngs, mismatches)
    each = np.broadcast_to(truth, (runs, count, 3))
    exact = _pixels(camera, each[np.arange(runs)[:, np.newaxis, np.newaxis], np.maximum(imaged, 0)], state)
    pixels = np.full((runs, epochs, count, 2), np.nan)
    wrong = np.zeros((runs, epochs, count), dtype=np.bool_)
    epoch, corner = np.nonzero(chosen >= 0)
    index = chosen[epoch, corner]
    sigma = np.broadcast_to(camera.sigma_px, (count,))[index, np.newaxis]
    pixels[:, epoch, index] = exact[:, epoch, corner] + sigma * noise[:, epoch, corner]
    wrong[:, epoch, index] = imaged[:, epoch, corner] != index
    return ImageMeasurements(pixels.reshape(runs, epochs, 2 * count), wrong)


def _row(state: NavState) -> None:
    if len(state.shape) != 1:
        raise InvalidInputError(f"state: expected a row of states, got shape {state.shape}")


def _pixels(camera: LandmarkCamera, landmarks: FloatArray, state: NavState) -> FloatArray:
    """Pixels (..., T, N, 2) of landmarks (N, 3) or (..., T, N, 3); those behind the camera mean nothing."""
    body = np.einsum("tij,...tnj->...tni", state.dcm, landmarks - state.position[:, np.newaxis])
    x, y, z = np.moveaxis((body - camera.lever_arm) @ camera.camera_from_body.T, -1, 0)
    with np.errstate(divide="ignore", invalid="ignore"):
        plane = np.stack([x / z, y / z], axis=-1)
    return np.asarray(camera.focal_length_px * plane + camera.principal_point)


def _mistaken(seen: Flags, chosen: Indices, rngs: Sequence[Generator], share: float) -> Indices:
    """The chosen landmarks (runs, T, 3) with a share of them replaced by others in view (T, N)."""
    imaged = np.array(chosen)
    for run, rng in enumerate(rngs):
        draws = rng.random((*chosen.shape[1:], 2))
        for epoch, corner in np.argwhere((draws[..., 0] < share) & (chosen[run] >= 0)):
            others = np.setdiff1d(np.flatnonzero(seen[epoch]), [chosen[run, epoch, corner]])
            imaged[run, epoch, corner] = others[int(draws[epoch, corner, 1] * len(others))]
    return imaged


def _largest_triangle(pixels: FloatArray) -> Indices:
    """Indices of the three points (n, 2) that span the largest triangle; they are corners of the hull."""
    hull = _hull(pixels)
    if len(hull) < 3:
        hull = np.arange(len(pixels))
    triples = hull[np.array(list(combinations(range(len(hull)), 3)), dtype=np.intp)]
    a, b, c = np.moveaxis(pixels[triples], 1, 0)
    area = np.abs((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))
    return np.asarray(triples[int(area.argmax())])


def _hull(pixels: FloatArray) -> Indices:
    """Convex hull by the monotone chain, indices of its corners."""
    order = np.lexsort((pixels[:, 1], pixels[:, 0]))
    xy = pixels.tolist()
    corners: list[int] = []
    for sequence in (order.tolist(), order[::-1].tolist()):
        chain: list[int] = []
        for k in sequence:
            while len(chain) > 1 and _turn(xy[chain[-2]], xy[chain[-1]], xy[k]) <= 0.0:
                chain.pop()
            chain.append(k)
        corners += chain[:-1]
    return np.array(corners, dtype=np.intp)


def _turn(a: list[float], b: list[float], c: list[float]) -> float:
    """Twice the signed area of a triangle."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
