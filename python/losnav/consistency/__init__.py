"""Is an estimator as good as it says?  Normalised errors, whiteness, exact bounds, confidence intervals.

A normalised squared error (NEES, NIS, the chi² of a fit) of a consistent estimator follows a chi-square law
whose degrees of freedom are known, so a Monte Carlo mean has an *exact* acceptance band and needs no rule of
thumb.

* :func:`nees`: the errors of a filter's states, where the truth is known, against its covariances.
* :func:`nis`: its innovations against their predicted covariances; needs no truth, so it works in flight.
* :func:`autocorrelation`: innovations of a consistent filter are white. NIS alone does not see everything: a
  filter whose model hides a bias in the state can have a perfect NIS.
* chi-square functions and bands (:func:`chi2_cdf`, :func:`chi2_sf`, :func:`chi2_quantile`,
  :func:`nees_bounds`), intervals of success rates (:func:`binomial_interval`) and of medians or means
  (:func:`bootstrap_interval`), with NumPy as the only dependency.

Source: Bar-Shalom, Li & Kirubarajan, *Estimation with Applications to Tracking and Navigation* (2001),
section 5.4.
"""

from __future__ import annotations

from losnav.consistency.chi_square import chi2_cdf, chi2_quantile, chi2_sf, nees_bounds
from losnav.consistency.intervals import binomial_interval, bootstrap_interval
from losnav.consistency.normalised_errors import NormalisedErrors, nees, nis
from losnav.consistency.whiteness import Autocorrelation, autocorrelation

__all__ = [
    "Autocorrelation",
    "NormalisedErrors",
    "autocorrelation",
    "binomial_interval",
    "bootstrap_interval",
    "chi2_cdf",
    "chi2_quantile",
    "chi2_sf",
    "nees",
    "nees_bounds",
    "nis",
]
