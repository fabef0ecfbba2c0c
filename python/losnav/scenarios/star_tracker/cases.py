"""The configurations of heads that are simulated."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from losnav import star_tracker

if TYPE_CHECKING:
    from losnav.scenarios.star_tracker import StarTracker

__all__ = ["Case", "all_cases"]

Array = NDArray[np.float64]
Heads: TypeAlias = "tuple[star_tracker.Head, ...]"

_FEW = {
    "two stars in each head": (2, 2, 2),
    "two stars, one, none": (2, 1, 0),
    "one star in each head": (1, 1, 1),
    "one star in two heads": (1, 1, 0),
}


@dataclass(frozen=True)
class Case:
    """One configuration: heads, and how many stars each of them sees.

    Attributes
    ----------
    key : str
        Name of its arrays.
    title : str
        Name in tables and figures.
    heads : tuple of Head
    stars : tuple of int
        Stars in each head.
    images : int
        Images in each run.
    """

    key: str
    title: str
    heads: tuple[star_tracker.Head, ...]
    stars: tuple[int, ...]
    images: int = 1


def all_cases(scenario: StarTracker) -> list[Case]:
    """Every configuration of the campaign; a new one belongs at the end, so that the others keep their
    random numbers."""
    s, sigma, full = scenario, scenario.star_sigma, (scenario.stars,) * 3

    def heads(boresights: Array, noise: float | star_tracker.StarNoise = sigma) -> Heads:
        return tuple(star_tracker.Head.looking(z, fov=s.fov, noise=noise) for z in boresights)

    square = star_tracker.separation_boresights(math.pi / 2)
    cases = [
        Case("single", "single head", heads(square[:1]), full[:1]),
        Case("orthogonal", "three heads, 90° apart", heads(square), full),
    ]
    for angle in s.check_angles:
        name, boresights = _degrees(angle), star_tracker.separation_boresights(angle)
        cases.append(Case(f"symmetric {name}", f"three heads, {name} apart", heads(boresights), full))
    for angle in s.third_angles:
        boresights = star_tracker.separation_boresights(angle, 3, "asymmetric", s.pair_angle)
        title = f"pair {_degrees(s.pair_angle)}, third at {_degrees(angle)}"
        cases.append(Case(f"asymmetric {_degrees(angle)}", title, heads(boresights), full))
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    cases.append(Case("tetrahedral", "four heads, tetrahedral", heads(corners), (s.stars,) * 4))
    for title, stars in _FEW.items():
        cases.append(Case(f"few {'+'.join(map(str, stars))}", title, heads(square), stars))
    weighted = tuple(
        star_tracker.Head.looking(z, fov=s.fov, noise=ratio * sigma)
        for z, ratio in zip(square, s.noise_ratios, strict=True)
    )
    cases.append(Case("weighted", "heads of unequal noise", weighted, full))
    pixel = star_tracker.PixelNoise.from_fov(s.fov, s.pixels, s.centroid_sigma)
    cases.append(Case("pixel", "three heads, white pixel noise", heads(square, pixel), full, s.pixel_images))
    return cases


def _degrees(angle: float) -> str:
    return f"{math.degrees(angle):.4g}°"
