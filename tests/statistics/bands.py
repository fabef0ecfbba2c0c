"""Exact chi-square bands for averages of normalised squared errors."""

import numpy as np
from scipy.stats import chi2

from losnav import attitude
from tests.conftest import BAND


def nees_band(dof, runs, outside=BAND):
    """Two-sided band of the mean of ``runs`` chi-square variables of ``dof`` degrees of freedom."""
    return chi2.ppf([outside / 2, 1 - outside / 2], dof * runs) / runs


def nees(errors, information):
    """e' F e over the leading axis."""
    return np.einsum("ri,rij,rj->r", errors, np.broadcast_to(information, (len(errors), 6, 6)), errors)


def pose_errors(solution, position, dcm):
    """(runs, 6) true minus estimate, [dp, dalpha], vectorised through the small quaternion of the error."""
    return np.concatenate(
        [position - solution.position, attitude.rotation_error(dcm, solution.dcm)],
        axis=-1,
    )
