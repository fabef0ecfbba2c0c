"""One block of Monte Carlo runs: every study on the same draws, each filtered as one batch."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.random import SeedSequence, default_rng
from numpy.typing import NDArray

import losnav as ln
from losnav.consistency import nees
from losnav.scenarios.relative_navigation.sensing import Draws, Measurements, camera, corrected, measure
from losnav.scenarios.relative_navigation.truth import Arc, Burn, fly, linear

if TYPE_CHECKING:
    from losnav.scenarios.relative_navigation import RelativeNavigation

__all__ = [
    "Case",
    "PrintedTransition",
    "RendezvousTask",
    "cases",
    "covariance_bound",
    "final_epochs",
    "settled",
]

Array = NDArray[np.float64]
Arrays = dict[str, NDArray[Any]]


@lru_cache(maxsize=64)
def _step(model: ln.dynamics.ClohessyWiltshire, dt: float) -> tuple[Array, Array, Array]:
    """Φ with element (1,6) reversed, B and Q of one step."""
    transition = model.transition(np.zeros(6), dt).copy()
    transition[0, 5] *= -1
    control = np.stack([model.propagate(np.zeros(6), dt, u) for u in np.eye(3)], axis=-1)
    return transition, control, model.process_noise(np.zeros(6), dt)


@dataclass(frozen=True)
class PrintedTransition:
    """Clohessy-Wiltshire with the printed sign of Φ(1,6): a user's own model, to show what it costs."""

    right: ln.dynamics.ClohessyWiltshire

    def transition(self, state: Any, dt: float, control: Any = None) -> Array:
        """Φ as printed."""
        return _step(self.right, float(dt))[0]

    def propagate(self, state: Any, dt: float, control: Any = None) -> Array:
        """Φ x + B u."""
        transition, forced, _ = _step(self.right, float(dt))
        moved = transition @ state
        return np.asarray(moved if control is None else moved + forced @ control)

    def process_noise(self, state: Any, dt: float) -> Array:
        """Q of the right model."""
        return _step(self.right, float(dt))[2]


@dataclass(frozen=True)
class Case:
    """A variation of which only summaries are kept.

    Attributes
    ----------
    name : str
    scenario : RelativeNavigation
        With the varied parameter.
    arc : {"printed", "far", "far linear"}
        What is flown.
    model : {"cw", "printed sign", "j2"}
        What the filter predicts with: Clohessy-Wiltshire, the same with the misprint, or the difference of
        two orbits with J2 about the chaser's GPS fixes.
    """

    name: str
    scenario: RelativeNavigation
    arc: str = "printed"
    model: str = "cw"

    def fly(self) -> Arc:
        """The true motion."""
        s = self.scenario
        if self.arc == "printed":
            return s.printed
        maker = fly if self.arc == "far" else linear
        return maker(s, s.far_position, s.far_velocity, s.duration)


_FAR = (("chaser", "C_BO", "cw"), ("corrected", "C_OT", "cw"), ("corrected", "C_OT and J2", "j2"))


def cases(scenario: RelativeNavigation) -> tuple[Case, ...]:
    """All variations, in the order of the arrays ``case_*``."""
    s = scenario
    listed = [
        Case("as published", s),
        Case("printed sign of Φ(1,6)", s, model="printed sign"),
        Case("C_OT to first order", replace(s, frame="corrected")),
        Case("true target frame", replace(s, frame="target")),
        Case(f"J2 prediction, q = {s.aware_psd:g}", replace(s, acceleration_psd=s.aware_psd), model="j2"),
        Case("two-body truth", replace(s, j2=0.0)),
        Case("two-body truth, q = 1e-12", replace(s, j2=0.0, acceleration_psd=1e-12)),
        Case("argument of latitude 90 deg", replace(s, argument_of_latitude=np.pi / 2)),
    ]
    for sigma in s.control_sigmas:
        listed.append(Case(f"pointing {np.degrees(sigma):.3g} deg random", replace(s, control_sigma=sigma)))
    for bias in s.control_biases:
        listed.append(Case(f"pointing {np.degrees(bias):.3g} deg constant", replace(s, control_bias=bias)))
    for sigma in s.star_tracker_sigmas:
        name = f"star tracker {180 * np.degrees(sigma):.3g}' (3-sigma)"
        listed.append(Case(name, replace(s, star_tracker_sigma=sigma)))
    # The model with J2 is the slow one; its line is straight.
    ends = (min(s.far_psds), max(s.far_psds))
    for arc in ("far linear", "far"):
        for psd in s.far_psds:
            for frame, label, model in _FAR:
                varied = replace(s, acceleration_psd=psd, frame=frame)
                if model == "cw" or (arc == "far" and psd in ends):
                    listed.append(Case(f"{arc}, {label}, q = {psd:g}", varied, arc, model))
    return tuple(listed)


@dataclass(frozen=True)
class RendezvousTask:
    """The task of the campaign: seeds of a block in, arrays with one row for each run out."""

    scenario: RelativeNavigation

    def __call__(self, seeds: Sequence[SeedSequence], /) -> Arrays:
        s = self.scenario
        longest = max(len(s.printed.times), len(s.approach.times))
        draws = Draws.of([default_rng(seed) for seed in seeds], longest)
        arrays = {**self._arc("printed", s.printed, draws), **self._arc("approach", s.approach, draws)}
        aware = RendezvousTask(replace(s, acceleration_psd=s.aware_psd, frame="corrected"))
        arrays |= aware._arc("aware", s.printed, draws, "j2")
        return arrays | self._grids(draws) | self._burns(draws) | self._cases(draws)

    def _arc(self, name: str, arc: Arc, draws: Draws, model: str = "cw") -> Arrays:
        log = estimate(self.scenario, arc, draws, model=model)
        error = arc.relative - log.state
        return {
            f"{name}_error": error,
            f"{name}_sigma": np.sqrt(np.diagonal(log.covariance, axis1=-2, axis2=-1)),
            f"{name}_nees": nees(log, arc.relative).value,
            f"{name}_nis": log.nis[..., 0],
        }

    def _grids(self, draws: Draws) -> Arrays:
        """Other process noise on both arcs; of the approach only the squared distance is kept."""
        s, arrays = self.scenario, {}
        for name, arc in (("printed", s.printed), ("approach", s.approach)):
            measured = measure(s, arc, draws)
            logs = [
                estimate(replace(s, acceleration_psd=q), arc, draws, measured=measured) for q in s.psd_grid
            ]
            errors = np.stack([arc.relative - log.state for log in logs], axis=1)
            if name == "printed":
                arrays["printed_grid_error"] = errors
                squares = [nees(log, arc.relative).value for log in logs]
                arrays["printed_grid_nees"] = np.stack(squares, axis=1)
            else:
                arrays["approach_grid_square"] = np.square(errors[..., :3]).sum(axis=-1)
        return arrays

    def _burns(self, draws: Draws) -> Arrays:
        """A manoeuvre, without and with its acceleration in the prediction (axis 2)."""
        s = self.scenario
        burn = Burn(s.burn_acceleration, s.burn_start, s.burn_duration)
        arc = fly(s, s.initial_position, s.initial_velocity, s.duration, burn)
        measured = measure(s, arc, draws)
        shape = (len(measured.z), len(s.burn_psds), 2, len(arc.times))
        error, nis = np.empty((*shape, 6)), np.empty(shape)
        for k, psd in enumerate(s.burn_psds):
            for told in (0, 1):
                scenario, control = replace(s, acceleration_psd=psd), arc.control if told else None
                log = estimate(scenario, arc, draws, measured=measured, control=control)
                error[:, k, told], nis[:, k, told] = arc.relative - log.state, log.nis[..., 0]
        return {"burn_error": error[..., 3:], "burn_nis": nis}

    def _cases(self, draws: Draws) -> Arrays:
        rows = [self._case(case, draws) for case in cases(self.scenario)]
        return {f"case_{key}": np.stack([row[key] for row in rows], axis=1) for key in rows[0]}

    def _case(self, case: Case, draws: Draws) -> Arrays:
        arc = case.fly()
        log = estimate(case.scenario, arc, draws, model=case.model, far=case.arc != "printed")
        error, late = arc.relative - log.state, settled(case.scenario, arc.times)
        return {
            "square": np.mean(error[:, late] ** 2, axis=1),
            "bias": np.mean(error[:, late], axis=1),
            "nees": nees(log, arc.relative).value[:, late].mean(axis=1),
            "nis": log.nis[:, late, 0].mean(axis=1),
        }


def estimate(
    scenario: RelativeNavigation,
    arc: Arc,
    draws: Draws,
    *,
    measured: Measurements | None = None,
    control: Array | None = None,
    model: str = "cw",
    far: bool = False,
) -> Any:
    """Filter all runs along an arc with the scenario's process noise; returns the filter's log."""
    s = scenario
    m = measure(s, arc, draws) if measured is None else measured
    first = np.array([*s.filter_position, *s.filter_velocity])
    if far:
        first[:3] += np.subtract(s.far_position, s.initial_position)
    covariance = np.diag(np.repeat([s.prior_position_sigma**2, s.prior_velocity_sigma**2], 3))

    def filtered(dynamics: Any, z: Array, dcm: Array) -> Any:
        ekf = ln.ExtendedKalmanFilter(dynamics, first, covariance)
        return ekf.run(arc.times, [(m.sensor, z)], controls=control, dcm=dcm)

    def run(model: str, dcm: Array) -> Any:
        if model == "j2":
            rows = zip(m.orbit, m.z, dcm, strict=True)
            return _stacked([filtered(_aware(s, arc, orbit), z, c) for orbit, z, c in rows])
        dynamics = ln.dynamics.ClohessyWiltshire(s.mean_motion, s.acceleration_psd)
        return filtered(PrintedTransition(dynamics) if model == "printed sign" else dynamics, m.z, dcm)

    if s.frame != "corrected":
        return run(model, m.dcm)
    # The correction depends on the state so weakly (0.03" per metre) that the estimate of a simpler,
    # uncorrected filter is as good as the prediction.
    return run(model, corrected(s, arc, m.dcm, run("cw", m.dcm).state))


def _aware(scenario: RelativeNavigation, arc: Arc, orbit: Array) -> ln.dynamics.RelativeTwoBody:
    """Difference of two orbits about the chaser's own fixes."""
    s = scenario
    planet = {"j2": s.j2, "radius": s.earth_radius}
    return ln.dynamics.RelativeTwoBody(s.mu, orbit, arc.times, s.acceleration_psd, **planet)


def _stacked(logs: Sequence[Any]) -> SimpleNamespace:
    """One log of the logs of single runs."""
    names = ("state", "covariance", "nis")
    return SimpleNamespace(
        time=logs[0].time, **{n: np.stack([getattr(log, n) for log in logs]) for n in names}
    )


def settled(scenario: RelativeNavigation, times: Array) -> NDArray[np.bool_]:
    """Epochs whose errors count."""
    return np.asarray(times >= scenario.settled)


def final_epochs(scenario: RelativeNavigation) -> int:
    """Number of epochs of the end of an arc."""
    return max(1, round(scenario.final_window / scenario.sampling))


def covariance_bound(scenario: RelativeNavigation, duration: float) -> Array:
    """1-sigma of a filter whose model is exact and has no process noise, linearised at the truth, (T, 6)."""
    s = scenario
    arc = linear(s, s.initial_position, s.initial_velocity, duration)
    dcm = arc.pointing @ np.swapaxes(arc.target_frame, -1, -2)
    sensor = camera(s)
    dynamics = ln.dynamics.ClohessyWiltshire(s.mean_motion)
    covariance = np.diag(np.repeat([s.prior_position_sigma**2, s.prior_velocity_sigma**2], 3))
    ekf = ln.ExtendedKalmanFilter(dynamics, arc.start, covariance)
    log = ekf.run(arc.times, [(sensor, sensor.predict(arc.relative, dcm=dcm))], dcm=dcm)
    return np.asarray(np.sqrt(np.diagonal(log.covariance, axis1=-2, axis2=-1)))
