"""pytest-benchmark's standard output of the same calls: ``pytest benches --benchmark-group-by=func``.

``benches/run.py`` interleaves the contenders and is what RESULTS.md reports; here each runs by itself.
"""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("cv2")
pytest.importorskip("poselib")
pytest.importorskip("numba")

import losnav as ln
from benches import single
from benches.scenes import SIGMA, angle_between, batch, scenes

COUNT = 8
SAME = 1e-6
"""Attitude error (rad) within which all agree on scenes without noise."""


def _run(benchmark, make, n, outliers=0.0):
    contender = make(scenes(n, COUNT, outliers=outliers))
    exact = scenes(n, COUNT, outliers=outliers, sigma=0.0)
    found = [
        angle_between(answer[1], scene.dcm) < SAME
        for answer, scene in zip(make(exact).answers, exact, strict=True)
    ]
    benchmark.extra_info["scenes solved"] = f"{sum(found)} of {COUNT}"
    code = compile(contender.statement, contender.name, "exec")
    benchmark(exec, code, contender.namespace)
    assert contender.name != "losnav" or all(found)


@pytest.mark.parametrize("n", [4, 8, 50, 1000])
@pytest.mark.parametrize("k", range(6))
def test_warm(benchmark, n, k):
    """A guess 50 m and 5 degrees off."""
    _run(benchmark, single.warm_contenders(n)[k], n)


@pytest.mark.parametrize("n", [3, 4, 8, 50])
@pytest.mark.parametrize("k", range(2))
def test_guess_free(benchmark, n, k):
    """No guess: losnav and the strongest peer."""
    _run(benchmark, single.free_contenders(n)[k], n)


@pytest.mark.parametrize("n", [50, 200])
@pytest.mark.parametrize("k", range(3))
def test_robust(benchmark, n, k):
    """Two in five directions wrong."""
    _run(benchmark, single.robust_contenders(n)[k], n, outliers=0.4)


def test_batch(benchmark):
    """10,000 problems of four landmarks on all cores."""
    one, los, guess = batch(4, 10_000)
    solution = benchmark(lambda: ln.solve_pose(one.landmarks, los, sigma=SIGMA, guess=guess))
    assert np.mean(solution.converged) > 0.99
