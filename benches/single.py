"""One problem at a time: warm start, no start, outliers; time, ratio and error of everybody."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benches import peers
from benches.clock import interleaved
from benches.scenes import FOCAL, SIGMA, angle_between, scenes

REACHED = 1e-6
"""Attitude error (rad) on a scene without noise below which a contender found the pose."""


@dataclass
class Row:
    """One contender of one table."""

    name: str
    microseconds: float
    minimum: float
    ratio: float
    attitude: float
    position: float
    exact: float
    reached: int
    scenes: int
    note: str


def warm_contenders(n):
    """Factories of contenders that refine a guess 50 m and 5 degrees off."""
    makers = [
        peers.losnav_warm,
        peers.numba_warm,
        lambda s: peers.poselib_warm(s, peers.TIGHT, "PoseLib refine"),
        lambda s: peers.poselib_warm(s, peers.DEFAULTS, "PoseLib refine, its defaults"),
        peers.opencv_warm,
        peers.scipy_warm,
    ]
    return [*makers, peers.oracle_warm] if n <= 50 else makers


def free_contenders(n):
    """Factories of contenders that need no guess."""
    gate = 5 * SIGMA * FOCAL
    makers = [peers.losnav_free]
    if n == 3:
        return [*makers, peers.poselib_p3p]
    flags = ["SQPNP", "EPNP"] if n > 4 else ["SQPNP", "EPNP", "IPPE", "AP3P"]
    makers += [lambda s, flag=flag: peers.opencv_free(s, flag) for flag in flags]
    return [*makers, lambda s: peers.poselib_estimate(s, gate=gate)]


def robust_contenders(_):
    """Factories of contenders that reject outliers."""
    gate = 5 * SIGMA * FOCAL
    return [
        peers.losnav_robust,
        lambda s: peers.poselib_estimate(s, gate=gate),
        lambda s: peers.opencv_ransac(s, gate=gate),
    ]


def measure(makers, n, *, rounds, count, outliers=0.0):
    """Rows of all contenders on ``count`` scenes of ``n`` landmarks; ratios are against the first."""
    noisy = scenes(n, count, outliers=outliers)
    clean = scenes(n, count, outliers=outliers, sigma=0.0)
    optima = [peers.optimum(scene) for scene in noisy]
    truths = [(scene.position, scene.dcm) for scene in clean]
    contenders = [make(noisy) for make in makers]
    exact = [make(clean).answers for make in makers]
    times = interleaved(contenders, rounds)
    rows = []
    for contender, answers, time in zip(contenders, exact, times, strict=True):
        clean_attitude, _ = _errors(answers, truths)
        attitude, position = _errors(contender.answers, optima)
        found = clean_attitude < REACHED
        rows.append(
            Row(
                contender.name,
                1e6 * time.median,
                1e6 * time.minimum,
                time.median / times[0].median,
                _median(attitude[found]),
                _median(position[found]),
                _median(clean_attitude[found]),
                int(found.sum()),
                count,
                contender.note,
            )
        )
    return rows


def _errors(answers, references):
    attitude = [angle_between(a[1], r[1]) for a, r in zip(answers, references, strict=True)]
    position = [
        np.nan if a[0] is None else np.linalg.norm(a[0] - r[0])
        for a, r in zip(answers, references, strict=True)
    ]
    return np.array(attitude), np.array(position)


def _median(values):
    return float(np.median(values)) if len(values) else np.nan
