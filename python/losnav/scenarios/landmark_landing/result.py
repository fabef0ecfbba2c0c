"""What a campaign of landings says: tables, the limited camera, and the way to claims and figures."""

from __future__ import annotations

import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import losnav as ln
from losnav.scenarios.landmark_landing.descent import Descent, focal_plane_covariance
from losnav.scenarios.verdicts import Claims, Table

if TYPE_CHECKING:
    from losnav.scenarios.landmark_landing import LandmarkLanding

__all__ = ["LandingResult", "LimitedCamera", "bound"]

Array = NDArray[np.float64]

_TABLE_STEP = 50.0  # s between the rows of the main table


def bound(scenario: LandmarkLanding, descent: Descent) -> Array:
    """Cramér–Rao bound F⁻¹ of ``[δp, δα]`` along a descent, m and rad, (T, 6, 6)."""
    if scenario.noise == "tangent":
        noise: dict[str, Any] = {"sigma": scenario.los_sigma}
    else:
        sigma = scenario.focal_plane_sigma
        noise = {"covariance": focal_plane_covariance(descent.los, scenario.focal_length, sigma)}
    information = ln.fisher_information(descent.landmarks, descent.position, descent.mrp, **noise)
    scale = 1 / np.sqrt(np.diagonal(information, axis1=-2, axis2=-1))
    outer = scale[:, :, None] * scale[:, None, :]
    return np.asarray(np.linalg.inv(information * outer) * outer)


@dataclass(frozen=True)
class LimitedCamera:
    """Navigation with a limited field of view: measured while the landmarks are in view, propagated
    afterwards.

    Attributes
    ----------
    half_fov : float
        rad.
    nav_off : int
        First epoch without a fix; the number of epochs if there is none.
    error : (runs, T, 6) array
        True minus estimate, ``[δp, δα]``, m and rad. NaN if the camera never saw enough landmarks.
    covariance : (T, 6, 6) array
        Its predicted covariance.
    """

    half_fov: float
    nav_off: int
    error: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class LandingResult:
    """Arrays and summaries of a campaign of landings.

    Attributes
    ----------
    scenario : LandmarkLanding
        Its parameters.
    runs, seed : int
        Size and seed of the campaign.
    arrays : dict of arrays
        One row for each run. ``{ml,glsdc,lm}_error`` (runs, T, 6): true minus estimate ``[δp, δα]``, m and
        rad; ``_nees``, ``_chi2``, ``_iterations``, ``_converged`` (runs, T).
        ``cold_{gn,lm}_{success,converged,iterations}`` (runs, times, offsets, angles);
        ``free_{success,converged}`` (runs, times): without a guess.
    """

    scenario: LandmarkLanding
    runs: int
    seed: int
    arrays: dict[str, NDArray[Any]]

    @cached_property
    def bound(self) -> Array:
        """Cramér–Rao bound of the error at every epoch, ``[δp, δα]``, m and rad, (T, 6, 6)."""
        return bound(self.scenario, self.scenario.descent)

    @cached_property
    def sigma(self) -> Array:
        """1-sigma of the bound for each component, m and rad, (T, 6)."""
        return np.asarray(np.sqrt(np.diagonal(self.bound, axis1=-2, axis2=-1)))

    def limited(self, half_fov: float | None = None) -> LimitedCamera:
        """The same landings with a camera of limited field of view (rad; the scenario's own by default)."""
        s, descent = self.scenario, self.scenario.descent
        half_fov = s.half_fov if half_fov is None else half_fov
        off = descent.nav_off(half_fov, s.min_landmarks)
        error, covariance = self.arrays["ml_error"].copy(), self.bound.copy()
        if off == 0:
            error[:], covariance[:] = np.nan, np.nan
        elif off < len(descent.times):
            last = off - 1
            held = (descent.times[off:] - descent.times[last])[:, None]
            # The attitude error is in body axes, which turn on the way; the true rotation is close enough to
            # the propagated one.
            turn = descent.dcm[off:] @ descent.dcm[last].T
            carry = np.zeros((len(turn), 6, 6))
            carry[:, :3, :3], carry[:, 3:, 3:] = np.eye(3), turn
            rate = np.repeat([s.hold_velocity_sigma, s.hold_rate_sigma], 3)
            error[:, off:] = np.einsum("tij,rj->rti", carry, error[:, last])
            error[:, off:] += self.arrays["drift"][:, None] * rate * held
            covariance[off:] = carry @ covariance[last] @ np.swapaxes(carry, -1, -2)
            covariance[off:] += (rate * held)[:, :, None] ** 2 * np.eye(6)
        return LimitedCamera(half_fov, off, error, covariance)

    def table(self) -> Table:
        """Accuracy and effort along the descent, ideal camera."""
        descent, a = self.scenario.descent, self.arrays
        picks = np.unique(np.append(np.arange(0, len(descent.times), self._stride()), len(descent.times) - 1))
        error = a["ml_error"]
        rms = np.sqrt(np.mean(error**2, axis=0))
        columns: tuple[str, ...] = (
            "t [s]",
            "altitude [m]",
            "sx [m]",
            "sy [m]",
            "sz [m]",
            "rms position [m]",
            "s att. [deg]",
        )
        columns += ("rms att. [deg]", "NEES", "iter. GLSDC", "iter. LM")
        rows = []
        for k in picks:
            cells = [descent.times[k], descent.altitude[k], *self.sigma[k, :3]]
            cells += [np.linalg.norm(rms[k, :3]), np.degrees(self.sigma[k, 3:].max())]
            cells += [np.degrees(rms[k, 3:].max()), np.nanmean(a["ml_nees"][:, k])]
            cells += [a["glsdc_iterations"][:, k].mean(), a["lm_iterations"][:, k].mean()]
            rows.append(tuple(float(value) for value in cells))
        title = (
            f"Landing with four landmarks, ideal camera, {self.runs} runs (s: 1-sigma bound, worst axis "
            "for attitude)"
        )
        return Table(title, columns, tuple(rows))

    def camera_table(self) -> Table:
        """When cameras of limited field of view lose the landmarks, and what that costs at touchdown."""
        columns: tuple[str, ...] = (
            "half FOV [deg]",
            "fixes end [s]",
            "altitude [m]",
            "rms position then [m]",
        )
        columns += ("rms at touchdown [m]", "1-sigma predicted [m]", "rms att. at touchdown [deg]")
        descent, rows = self.scenario.descent, []
        for half_fov in sorted({*np.radians([35.0, 45.0, 60.0]).tolist(), self.scenario.half_fov}):
            camera = self.limited(half_fov)
            last = max(camera.nav_off - 1, 0)
            square = np.mean(camera.error**2, axis=0)
            cells = (
                np.degrees(half_fov),
                descent.times[last],
                descent.altitude[last],
                np.sqrt(square[last, :3].sum()),
                np.sqrt(square[-1, :3].sum()),
                np.sqrt(np.trace(camera.covariance[-1, :3, :3])),
                np.degrees(np.sqrt(square[-1, 3:].max())),
            )
            rows.append(tuple(float(value) for value in cells))
        return Table(
            "Limited field of view: fixes end early, then the pose is propagated", columns, tuple(rows)
        )

    def tables(self) -> tuple[Table, ...]:
        """All tables of a report."""
        return self.table(), self.camera_table()

    def claims(self) -> Claims:
        """The ten published claims, each part judged with what these runs measured."""
        from losnav.scenarios.landmark_landing.claims import judge_claims

        return judge_claims(self)

    def plot(self, path: str | os.PathLike[str]) -> list[Path]:
        """Write the figures as PNG files into the folder ``path`` (needs the ``plot`` extra) and return their
        paths.

        Raises
        ------
        LosnavError
            If matplotlib is not installed.
        """
        from losnav.scenarios.landmark_landing.figures import draw_all

        return draw_all(self, Path(path))

    def _stride(self) -> int:
        return max(1, round(_TABLE_STEP / self.scenario.sampling))
