"""Star trackers of one or many heads: fusion, covariance, layout, alignment, catalogue directions."""

from losnav.star_tracker.covariance import (
    fused_covariance,
    fused_covariance_from_stars,
    fused_information,
    star_information,
)
from losnav.star_tracker.ellipsoid import (
    ellipsoid_points,
    half_width,
    intercept,
    intersection_intercept,
    sandwich_ratio,
)
from losnav.star_tracker.field import boresight_ratio, head_covariance
from losnav.star_tracker.heads import Head
from losnav.star_tracker.mounting import consider_covariance, mounting_bias, mounting_sensitivity
from losnav.star_tracker.star_noise import PixelNoise, QuestNoise, StarNoise
from losnav.star_tracker.sweep import SeparationSweep, separation_boresights, separation_sweep

__all__ = [
    "Head",
    "PixelNoise",
    "QuestNoise",
    "SeparationSweep",
    "StarNoise",
    "boresight_ratio",
    "consider_covariance",
    "ellipsoid_points",
    "fused_covariance",
    "fused_covariance_from_stars",
    "fused_information",
    "half_width",
    "head_covariance",
    "intercept",
    "intersection_intercept",
    "mounting_bias",
    "mounting_sensitivity",
    "sandwich_ratio",
    "separation_boresights",
    "separation_sweep",
    "star_information",
]
