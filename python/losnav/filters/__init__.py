"""Filters: an estimate that is predicted and corrected, one step at a time or over whole arcs.

* :class:`ExtendedKalmanFilter`: the one to use; its steps, arcs and batches of arcs run in the engine.
* :class:`InertialKalmanFilter`: what that is on inertial navigation; :class:`InertialLog` what it leaves.
* :class:`PredictiveFilter`: estimates the model's error before every update.
* :class:`UnscentedKalmanFilter`: to compare it with; no Jacobians, NumPy.
* :class:`Step`: what one update did.
* :class:`FilterLog`: what an arc left behind; :meth:`FilterLog.smooth` goes back over it.

Follows Carpenter & D'Souza (eds.), *Navigation Filter Best Practices*, NASA/TP-2018-219822.
"""

from __future__ import annotations

from losnav.filters.extended import ExtendedKalmanFilter
from losnav.filters.inertial import InertialKalmanFilter
from losnav.filters.inertial_log import InertialLog
from losnav.filters.log import FilterLog
from losnav.filters.predictive import PredictiveFilter
from losnav.filters.sigma_points import UnscentedStep
from losnav.filters.step import Step
from losnav.filters.unscented import UnscentedKalmanFilter

__all__ = [
    "ExtendedKalmanFilter",
    "FilterLog",
    "InertialKalmanFilter",
    "InertialLog",
    "PredictiveFilter",
    "Step",
    "UnscentedKalmanFilter",
    "UnscentedStep",
]
