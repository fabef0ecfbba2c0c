"""Batches and growth, one process for each number of threads: ``python -m benches.batches --threads 2``.

Prints JSON: nanoseconds for one problem of the batch (median and minimum over interleaved rounds).
"""

from __future__ import annotations

import argparse
import json
import os
import sys


def main(arguments=None):
    """Fix the threads before anything counts the cores, then measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int, required=True)
    parser.add_argument("--rounds", type=int, default=15)
    parser.add_argument("--landmarks", type=int, default=4)
    parser.add_argument("--sizes", type=int, nargs="+", default=[10_000])
    parser.add_argument("--peers", action="store_true")
    options = parser.parse_args(arguments)
    for name in ("RAYON_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[name] = str(options.threads)
    json.dump(
        [measure(options.landmarks, size, options.rounds, options.peers) for size in options.sizes],
        sys.stdout,
    )


def measure(n, size, rounds, with_peers):
    """Times of one batch size."""
    import numpy as np

    import losnav as ln
    from benches.clock import Contender, interleaved
    from benches.scenes import SIGMA, batch

    one, los, guess = batch(n, size)
    namespace = {
        "landmarks": one.landmarks,
        "los": los,
        "guess": guess,
        "SIGMA": SIGMA,
        "solve": ln.solve_pose,
    }
    body = "solve(landmarks, los, sigma=SIGMA, guess=guess)"
    contenders = [Contender("losnav", body, namespace, size)]
    solution = ln.solve_pose(one.landmarks, los, sigma=SIGMA, guess=guess)
    report = {"size": size, "landmarks": n, "converged": float(np.mean(solution.converged))}
    if with_peers:
        contenders += _peers(one, los, guess, solution, report)
    times = interleaved(contenders, rounds)
    report["ns"] = {c.name: [1e9 * t.median, 1e9 * t.minimum] for c, t in zip(contenders, times, strict=True)}
    return report


LOOPED = 100
"""Problems of the batch that peers without a batch call solve in a Python loop."""


def _peers(one, los, guess, solution, report):
    import numpy as np
    from tests.oracle.attitude import dcm_from_mrp

    from benches import numba_twin, peers
    from benches.clock import Contender
    from benches.scenes import SIGMA, Scene, angle_between

    out = np.empty((len(los), 31))
    namespace = {"solve": numba_twin.solve_batch, "out": out, "SIGMA": SIGMA}
    namespace |= {"landmarks": one.landmarks, "los": los, "guess": guess}
    twin = Contender("numba prange", "solve(landmarks, los, SIGMA, guess, out)", namespace, len(los))
    numba_twin.solve_batch(one.landmarks, los, SIGMA, guess, out)
    scenes = [
        Scene(
            one.landmarks,
            los[k],
            one.position,
            one.dcm,
            guess[k, :3],
            dcm_from_mrp(guess[k, 3:]),
            one.inliers,
        )
        for k in range(min(LOOPED, len(los)))
    ]
    loops = [
        peers.poselib_warm(scenes, peers.TIGHT, "PoseLib loop"),
        peers.opencv_warm(scenes),
    ]
    dcm, position = solution.dcm, solution.position
    twins = [numba_twin.pose(row) for row in out[: len(scenes)]]
    answers = {"numba prange": twins, **{loop.name: loop.answers for loop in loops}}
    report["difference"] = {
        name: [
            float(np.median([angle_between(c, dcm[k]) for k, (_, c) in enumerate(poses)])),
            float(np.median([np.linalg.norm(p - position[k]) for k, (p, _) in enumerate(poses)])),
        ]
        for name, poses in answers.items()
    }
    return [twin, *loops]


if __name__ == "__main__":
    main()
