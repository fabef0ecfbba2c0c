"""Named tolerances with their reasons, the folder of real measurements, hypothesis profiles."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

REPOSITORY = Path(__file__).resolve().parents[1]

# --- tolerances -------------------------------------------------------------------------------------

# A chain of about ten double-precision operations on numbers of order one.
ROUNDING = 1e-14
# A formula of some hundred operations, written twice with different groupings.
SAME_FORMULA = 1e-12
# Analytic derivative against complex step, relative to the largest entry: both are exact to rounding.
JACOBIAN = 1e-12
# Two representations of one attitude, rad: a product of two maps, each good to a few ulp.
ROUND_TRIP = 1e-13
# The angle of an attitude given as dcm near 180 degrees; entries there are even in the deviation, so a
# map that survives it must use the best-conditioned component, and costs a few more ulp.
HALF_TURN = 1e-12
# Two minimisers of one smooth cost, relative to 1 sigma of the estimate: both stop where the step is
# below rounding of the cost's gradient.
SAME_OPTIMUM_IN_SIGMA = 1e-5
# Cost of a minimum found twice: quadratic in the above.
SAME_COST = 1e-8
# scipy.optimize.least_squares stops on its own tolerances; metres at a range of 500 m.
SCIPY_OPTIMUM_METRES = 1e-3
# Noise-free measurements at a range of 500 m: recovery in metres.
NOISE_FREE_METRES = 1e-6
# Reference optimum of real cameras, rad, and relative covariance, as four other programs agree on them.
REAL_CAMERA_RAD = 1e-9
REAL_CAMERA_COVARIANCE = 1e-6
# Attitude of real photographs from the stars another program used, arcsec, and the relative variance: that
# program scales its covariance by rounded residuals.
REAL_STARS_ARCSEC = 0.05
REAL_STARS_COVARIANCE = 0.02
# Probability outside the two-sided band of a statistical test.
BAND = 1e-3


# --- fixtures ---------------------------------------------------------------------------------------


@pytest.fixture(scope="session")
def data_folder() -> Path:
    """Folder of real measurements: ``LOSNAV_DATA``, else a folder beside the checkout; skips without."""
    named = os.environ.get("LOSNAV_DATA")
    folder = Path(named) if named else REPOSITORY.parent / "shared" / "data"
    if not folder.is_dir():
        pytest.skip(f"no real measurements at {folder}; set LOSNAV_DATA")
    return folder


@pytest.fixture
def rng() -> np.random.Generator:
    """A generator with a fixed seed."""
    return np.random.default_rng(20260801)


# --- hypothesis -------------------------------------------------------------------------------------

settings.register_profile("default", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("ci", deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
settings.register_profile("deep", deadline=None, max_examples=5000)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "ci" if os.environ.get("CI") else "default"))
