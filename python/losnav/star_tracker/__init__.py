"""Star trackers of one or many heads: fusion, covariance, layout, alignment, catalogue directions."""

from losnav.star_tracker.alignment import Alignment, align_heads
from losnav.star_tracker.catalogue import (
    aberrate,
    catalogue_covariance,
    catalogue_directions,
    remove_aberration,
)
from losnav.star_tracker.covariance import (
    fused_covariance,
    fused_covariance_from_stars,
    fused_information,
    star_information,
)
from losnav.star_tracker.crosscheck import fuse_attitudes
from losnav.star_tracker.detection import detection_power
from losnav.star_tracker.ellipsoid import (
    ellipsoid_points,
    half_width,
    intercept,
    intersection_intercept,
    sandwich_ratio,
)
from losnav.star_tracker.field import boresight_ratio, head_covariance
from losnav.star_tracker.fused_attitude import FusedAttitude
from losnav.star_tracker.fusion import by_head, fuse
from losnav.star_tracker.heads import Head
from losnav.star_tracker.layout import Layout, optimal_layout, tight_frame
from losnav.star_tracker.mounting import consider_covariance, mounting_bias, mounting_sensitivity
from losnav.star_tracker.selection import select_stars
from losnav.star_tracker.star_noise import PixelNoise, QuestNoise, StarNoise
from losnav.star_tracker.sweep import SeparationSweep, separation_boresights, separation_sweep
from losnav.star_tracker.timing import epoch_covariance, to_epoch

__all__ = [
    "Alignment",
    "FusedAttitude",
    "Head",
    "Layout",
    "PixelNoise",
    "QuestNoise",
    "SeparationSweep",
    "StarNoise",
    "aberrate",
    "align_heads",
    "boresight_ratio",
    "by_head",
    "catalogue_covariance",
    "catalogue_directions",
    "consider_covariance",
    "detection_power",
    "ellipsoid_points",
    "epoch_covariance",
    "fuse",
    "fuse_attitudes",
    "fused_covariance",
    "fused_covariance_from_stars",
    "fused_information",
    "half_width",
    "head_covariance",
    "intercept",
    "intersection_intercept",
    "mounting_bias",
    "mounting_sensitivity",
    "optimal_layout",
    "remove_aberration",
    "sandwich_ratio",
    "select_stars",
    "separation_boresights",
    "separation_sweep",
    "star_information",
    "tight_frame",
    "to_epoch",
]
