"""What is left of a mounting error after the mountings have been estimated from the stars of many images."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from losnav import star_tracker
from losnav.attitude import dcm_from_mrp, rotation_error
from losnav.scenarios.star_tracker.study import MISMOUNTED, random_attitudes

if TYPE_CHECKING:
    from losnav.scenarios.star_tracker import StarTracker

__all__ = ["biases_after_alignment"]

Array = NDArray[np.float64]


def biases_after_alignment(scenario: StarTracker, error: Array) -> Array:
    """Bias of the fused attitude of three orthogonal heads, one of which was mounted wrongly, rad.

    Each row is an alignment of its own: new images, new noise.

    Parameters
    ----------
    scenario : StarTracker
    error : (3,)
        Mounting error of one head before the alignment, fusion axes, rad.

    Returns
    -------
    (alignments, 3)
    """
    s = scenario
    boresights = star_tracker.separation_boresights(np.pi / 2)
    true = [star_tracker.Head.looking(z, fov=s.fov, noise=s.star_sigma) for z in boresights]
    believed = list(true)
    # An MRP is a quarter of a small rotation; dcm(mrp) turns the axes by it.
    turned = dcm_from_mrp(error / 4).T @ true[MISMOUNTED].mounting
    believed[MISMOUNTED] = replace(true[MISMOUNTED], mounting=turned)
    rng = np.random.default_rng(s.search_seed + 5)
    mountings = np.stack([head.mounting for head in true])
    left = []
    for _ in range(s.alignments):
        dcm = random_attitudes(rng, s.alignment_frames)
        stars = [head.stars(len(dcm) * s.stars, rng).reshape(len(dcm), s.stars, 3) for head in true]
        body = [head.measure(seen, rng) for head, seen in zip(true, stars, strict=True)]
        reference = [seen @ head.mounting.T @ dcm for head, seen in zip(true, stars, strict=True)]
        # Heads of frames, as they were made; frames of heads, as they are asked for.
        found = star_tracker.align_heads(
            believed, list(zip(*body, strict=True)), list(zip(*reference, strict=True))
        )
        left.append(rotation_error(mountings, found.mountings))
    return star_tracker.mounting_bias([s.head_covariance] * 3, mountings, np.stack(left))
