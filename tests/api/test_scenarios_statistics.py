"""Distribution functions and intervals behind the verdicts, against SciPy."""

from __future__ import annotations

import numpy as np
import pytest

from losnav.consistency import (
    binomial_interval,
    bootstrap_interval,
    chi2_cdf,
    chi2_quantile,
    chi2_sf,
    nees_bounds,
)
from losnav.errors import InvalidInputError

# Both sides sum the same series; what is left is the rounding of a·log x − log Γ(a), a term as large as dof.
RELATIVE_FLOOR, RELATIVE_PER_DOF = 1e-11, 1e-15

DOFS = np.array([1.0, 2.0, 2.5, 6.0, 50.0, 394.0, 9000.0, 1.3e6])


def test_chi2_tails_match_scipy():
    stats = pytest.importorskip("scipy.stats")
    for dof in DOFS:
        x = dof + np.sqrt(2 * dof) * np.linspace(-3, 30, 40)
        x = x[x > 0]
        np.testing.assert_allclose(
            chi2_cdf(x, dof), stats.chi2.cdf(x, dof), rtol=RELATIVE_FLOOR + RELATIVE_PER_DOF * dof
        )
        tail = stats.chi2.sf(x, dof)
        np.testing.assert_allclose(chi2_sf(x, dof), tail, rtol=1e-9 + 3e-15 * dof, atol=1e-300)


def test_chi2_quantile_inverts_the_tails():
    stats = pytest.importorskip("scipy.stats")
    p = np.array([1e-12, 5e-4, 0.1, 0.5, 0.975, 0.9995, 1 - 1e-9])
    for dof in DOFS:
        np.testing.assert_allclose(
            chi2_quantile(p, dof), stats.chi2.ppf(p, dof), rtol=RELATIVE_FLOOR + RELATIVE_PER_DOF * dof
        )


def test_chi2_limits():
    assert chi2_cdf(0.0, 3) == 0.0
    assert chi2_sf(-1.0, 3) == 1.0
    assert chi2_cdf(np.inf, 3) == 1.0
    assert np.isnan(chi2_cdf(np.nan, 3))
    assert chi2_quantile(0.0, 3) == 0.0
    assert np.isinf(chi2_quantile(1.0, 3))


@pytest.mark.parametrize(
    "call", [lambda: chi2_cdf(1.0, 0), lambda: chi2_quantile(1.5, 2), lambda: nees_bounds(6, 0)]
)
def test_chi2_bad_arguments(call):
    with pytest.raises(InvalidInputError):
        call()


def test_nees_bounds_are_the_published_band():
    low, high = nees_bounds(6, runs=1500)
    assert (round(low, 2), round(high, 2)) == (5.71, 6.30)


def test_nees_bounds_cover():
    rng = np.random.default_rng(1)
    means = rng.chisquare(6, size=(20000, 5)).mean(axis=1)
    low, high = nees_bounds(6, runs=5, confidence=0.95)
    share = np.mean((means >= low) & (means <= high))
    assert abs(share - 0.95) < 4 * np.sqrt(0.95 * 0.05 / 20000)


@pytest.mark.parametrize(
    ("k", "n"), [(0, 10), (10, 10), (3, 17), (500, 1000), (997, 1000), (63994, 64000), (1, 1)]
)
@pytest.mark.parametrize("confidence", [0.9, 0.999])
def test_binomial_interval_matches_scipy(k, n, confidence):
    stats = pytest.importorskip("scipy.stats")
    expected = stats.binomtest(k, n).proportion_ci(confidence, method="exact")
    np.testing.assert_allclose(binomial_interval(k, n, confidence), expected, rtol=1e-9, atol=1e-14)


@pytest.mark.parametrize(("k", "n"), [(-1, 3), (4, 3), (0, 0)])
def test_binomial_interval_bad_counts(k, n):
    with pytest.raises(InvalidInputError):
        binomial_interval(k, n)


def test_bootstrap_covers_the_mean():
    rng = np.random.default_rng(2)
    hits = 0
    for k in range(200):
        low, high = bootstrap_interval(rng.exponential(size=100), resamples=300, seed=k)
        hits += low < 1.0 < high
    # Percentile intervals of a skewed sample of 100 cover a little under 95 %.
    assert 0.87 < hits / 200 < 0.99


def test_bootstrap_is_reproducible_and_needs_samples():
    x = np.arange(20.0)
    assert bootstrap_interval(x, np.median) == bootstrap_interval(x, np.median)
    with pytest.raises(InvalidInputError):
        bootstrap_interval([])
    with pytest.raises(InvalidInputError):
        bootstrap_interval(x, confidence=1.0)
