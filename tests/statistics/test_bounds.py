"""Filters reach the Cramér-Rao bound and do not beat it: Monte Carlo, exact bands."""

import numpy as np
import pytest
from scipy.stats import chi2

import losnav as ln
from losnav.constants import SUN_MU
from losnav.observability import crlb
from tests.conftest import BAND
from tests.statistics.bands import nees, nees_band

EYE = np.eye(3)
SUN = ln.dynamics.TwoBody(SUN_MU)
DIRECTION = ln.sensors.LineOfSight([[0.0, 0.0, 0.0]], 5e-5)
DOPPLER = ln.sensors.RangeRate(1.0)
# a = 2e11 m, e = 0.25, at f = 104.48 deg.
TRUTH = np.array([-1.64944791e11, -1.04625341e11, -4.29843085e10, 8.79318667e3, -2.22608140e4, -9.52278052e3])
PRIOR = np.diag([6e8**2] * 3 + [50.0**2] * 3)
RUNS = 200


@pytest.mark.parametrize("sign", [-1, 1], ids=["back", "forth"])
@pytest.mark.parametrize("sensors", [[DIRECTION], [DIRECTION, DOPPLER]], ids=["sun", "sun and doppler"])
def test_errors_of_a_filter_have_the_covariance_of_the_bound(sign, sensors):
    rng = np.random.default_rng(11)
    times = sign * np.arange(0.0, 1.8e7 + 1, 7200.0)
    truth = SUN.trajectory(TRUTH, times)
    first = TRUTH + rng.standard_normal((RUNS, 6)) * np.sqrt(np.diag(PRIOR))
    told = np.broadcast_to(truth, (RUNS, *truth.shape))
    measured = [(s, s.simulate(told, rng, dcm=EYE)) for s in sensors]
    log = ln.ExtendedKalmanFilter(SUN, first, PRIOR).run(times, measured, dcm=EYE)
    bound = crlb(SUN, sensors, TRUTH, times, PRIOR, dcm=EYE)
    error = truth - log.state
    for k in (len(times) // 2, len(times) - 1):
        scale = np.sqrt(np.diagonal(bound[k]))
        inverse = np.linalg.inv(bound[k] / scale / scale[:, None])
        low, high = nees_band(6, RUNS)
        assert low < nees(error[:, k] / scale, inverse).mean() < high
        # Six looks at the same runs: Bonferroni.
        square = np.mean((error[:, k] / scale) ** 2, axis=0) * RUNS
        assert (square > chi2.ppf(BAND / 12, RUNS)).all()
        assert (square < chi2.ppf(1 - BAND / 12, RUNS)).all()
