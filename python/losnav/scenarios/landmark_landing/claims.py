"""The ten claims of the publication, taken apart and judged with our own runs.

Nothing here is typed in from a table but the printed values: every figure of ours is computed from the campaign's arrays, or, for
the geometric claims, from constructions that are solved on the spot.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from losnav.consistency import binomial_interval, chi2_quantile, nees_bounds
from losnav.scenarios.landmark_landing.geometry_claims import geometry_claims
from losnav.scenarios.landmark_landing.study import SUCCESS_NEES
from losnav.scenarios.verdicts import Claim, Claims, Verdict, judge

if TYPE_CHECKING:
    from losnav.scenarios.landmark_landing.result import LandingResult

__all__ = ["judge_claims"]

Array = NDArray[np.float64]

_CONFIDENCE = 0.95
_BAND = 0.999  # coverage of the chi-square bands of consistency tests
_RESAMPLES = 1000
_WARM: tuple[tuple[str, str, str, Verdict], ...] = (("b", "glsdc", "GLSDC", "does not"), ("c", "lm", "LM", "holds"))


def judge_claims(result: LandingResult) -> Claims:
    """All claims of the publication, in its order."""
    families = (_estimation, _first_accuracy, _final_accuracy, _altitude, _iterations, _epochs)
    claims = [claim for family in families for claim in family(result)]
    return Claims([*claims, *geometry_claims(result.scenario), *_efficiency(result), _steepest(result)])


def _estimation(result: LandingResult) -> list[Claim]:
    """1: GLSDC and LM estimate position and attitude."""
    nees = result.arrays["ml_nees"]
    times = result.scenario.descent.times
    low, high = nees_bounds(6, result.runs, _BAND)
    picks = [int(np.argmin(abs(times - t))) for t in (0.0, 200.0, 400.0)]
    means = [float(nees[:, k].mean()) for k in picks]
    value, interval = _scaled_mean(nees)
    inside = all(low <= mean <= high for mean in means) and interval[0] <= 6 <= interval[1]
    text = ", ".join(f"{mean:.2f} at {times[k]:.0f} s" for mean, k in zip(means, picks, strict=True))
    right = [int(np.count_nonzero(result.arrays[f"{n}_nees"][:, 0] < SUCCESS_NEES)) for n in ("glsdc", "lm")]
    share = binomial_interval(right[0], result.runs, _CONFIDENCE)
    return [
        Claim(
            "1a",
            "GLSDC and LM estimate position and attitude",
            "-",
            f"NEES {value:.3f} [{interval[0]:.3f}, {interval[1]:.3f}] ({_BAND:.1%}); {text}",
            value,
            interval,
            _BAND,
            "holds" if inside else "does not",
            f"The mean NEES of a right estimate with a right covariance is 6; the band of one epoch is [{low:.2f}, {high:.2f}].",
            "holds",
        ),
        Claim(
            "1b",
            "With the printed stop test, GLSDC always ends at the right pose from the first guess",
            "-",
            f"{_percent(right[0] / result.runs, share)} of first fixes right (LM {right[1] / result.runs:.1%})",
            right[0] / result.runs,
            share,
            _CONFIDENCE,
            judge(share, above=0.99),
            "A relative change of the cost below 0.1 says nothing about the cost itself: some runs stop in the curved valley "
            "between lateral position and tilt. Asked: at least 99 %.",
            "does not",
        ),
    ]


def _first_accuracy(result: LandingResult) -> list[Claim]:
    """2: errors converge within 1 m and 0.2 deg."""
    error = result.arrays["ml_error"]
    claims = []
    for letter, name, part, unit, limit, established in _pairs(1.0, 0.2, ("does not", "holds")):
        worst = int(np.argmax(result.sigma[0, part])) + part.start
        value, interval = _deviation(error[:, 0, worst] * unit[1])
        claims.append(
            Claim(
                f"2{letter}",
                f"The 1-sigma error of {name} is within {limit:g} {unit[0]} from the first image",
                f"{limit:g} {unit[0]}",
                f"{value:.3f} [{interval[0]:.3f}, {interval[1]:.3f}] {unit[0]} (bound {result.sigma[0, worst] * unit[1]:.3f})",
                value,
                interval,
                _CONFIDENCE,
                judge(interval, below=limit),
                "Standard deviation of the worst axis at t = 0 over the runs.",
                established,
            )
        )
    claims.append(_reached(result, "2c", (1.0, 0.2)))
    largest = np.abs(error).max(axis=1)
    position, attitude = largest[:, :3].max(axis=1), np.degrees(largest[:, 3:].max(axis=1))
    value, interval = _resampled_median(position)
    inside = int(np.count_nonzero((position <= 1.0) & (attitude <= 0.2)))
    share = _percent(inside / result.runs, binomial_interval(inside, result.runs, _CONFIDENCE))
    claims.append(
        Claim(
            "2d",
            "Errors stay within 1 m and 0.2 deg through the whole descent",
            "1 m, 0.2 deg",
            f"median largest error {value:.2f} [{interval[0]:.2f}, {interval[1]:.2f}] m, {np.median(attitude):.2f} deg",
            value,
            interval,
            _CONFIDENCE,
            judge(interval, below=1.0),
            f"Largest error of any axis at any epoch of a run; {share} of the runs stay inside.",
            "does not",
        )
    )
    return claims


def _final_accuracy(result: LandingResult) -> list[Claim]:
    """3: the final errors are below 0.1 m and 0.05 deg."""
    error = result.arrays["ml_error"][:, -1]
    claims = []
    for letter, name, part, unit, limit, established in _pairs(0.1, 0.05, ("holds", "holds")):
        worst = int(np.argmax(result.sigma[-1, part])) + part.start
        value, (low, high) = _deviation(3 * error[:, worst] * unit[1])
        largest = np.abs(error[:, part]).max() * unit[1]
        claims.append(
            Claim(
                f"3{letter}",
                f"The final error of {name} is below {limit:g} {unit[0]}",
                f"< {limit:g} {unit[0]}",
                f"3-sigma {value:.2g} [{low:.2g}, {high:.2g}] {unit[0]} at touchdown, ideal camera",
                value,
                (low, high),
                _CONFIDENCE,
                judge((low, high), below=limit),
                f"Worst axis; the largest error of all runs is {largest:.2g} {unit[0]}. With a limited field of view see 3d.",
                established,
            )
        )
    claims.append(_reached(result, "3c", (0.1, 0.05)))
    camera = result.limited()
    value, interval = _deviation(3 * camera.error[:, -1, int(np.argmax(np.ptp(camera.error[:, -1, :3], axis=0)))])
    descent, last = result.scenario.descent, max(camera.nav_off - 1, 0)
    claims.append(
        Claim(
            "3d",
            "The final error of position is below 0.1 m with a camera that can be built",
            "< 0.1 m",
            f"3-sigma {value:.2g} [{interval[0]:.2g}, {interval[1]:.2g}] m at touchdown",
            value,
            interval,
            _CONFIDENCE,
            judge(interval, below=0.1),
            f"Half field of view {np.degrees(camera.half_fov):.0f} deg: the last fix is at {descent.times[last]:.0f} s, "
            f"{descent.altitude[last]:.0f} m; after it the result is that of the propagation assumed "
            f"({result.scenario.hold_velocity_sigma * 1e3:g} mm/s), not of the lines of sight.",
            "does not",
        )
    )
    return claims


def _reached(result: LandingResult, number: str, limits: tuple[float, float]) -> Claim:
    """From when on the 3-sigma bounds stay below a pair of limits."""
    descent = result.scenario.descent
    sigma = np.stack([result.sigma[:, :3].max(axis=1), np.degrees(result.sigma[:, 3:].max(axis=1))])
    since = []
    for row, limit in zip(sigma, limits, strict=True):
        above = np.flatnonzero(3 * row > limit)
        since.append(0 if above.size == 0 else int(above[-1]) + 1)
    last = max(since)
    exists = last < len(descent.times)
    text = [f"{descent.times[k]:.0f} s ({descent.altitude[k]:.0f} m)" if exists else "never" for k in since]
    error = np.abs(result.arrays["ml_error"][:, last:]) * np.repeat([1.0, np.degrees(1.0)], 3)
    inside = error <= np.repeat(limits, 3)
    share = f"{inside.mean():.4%}" if inside.size else "none"
    time = float(descent.times[last]) if exists else np.inf
    return Claim(
        number,
        f"3-sigma bounds come below {limits[0]:g} m and {limits[1]:g} deg during the descent",
        f"{limits[0]:g} m, {limits[1]:g} deg",
        f"position from {text[0]}, attitude from {text[1]}",
        time,
        (time, time),
        _CONFIDENCE,
        "holds" if exists else "does not",
        f"First image after which the bound of every axis stays below. {share} of the measured errors after it are inside.",
        "holds",
    )


def _altitude(result: LandingResult) -> list[Claim]:
    """4: the error falls with the altitude."""
    altitude = result.scenario.descent.altitude
    high = altitude > 0.2 * altitude[0]
    square = np.sum(result.arrays["ml_error"][:, high, :3] ** 2, axis=-1)

    def slope(mean_square: Array) -> Array:
        x = np.log(altitude[high]) - np.log(altitude[high]).mean()
        return np.asarray(0.5 * np.log(mean_square) @ x / (x @ x))

    value, interval = _resampled(square, slope)
    falling = np.mean(np.diff(result.sigma[:, :3].max(axis=1)) <= 0)
    return [
        Claim(
            "4",
            "The error falls as the altitude falls",
            "-",
            f"rms position error ~ altitude^{value:.2f} [{interval[0]:.2f}, {interval[1]:.2f}]",
            value,
            interval,
            _CONFIDENCE,
            judge(interval, above=0.0),
            f"Slope of log rms over log altitude above {altitude[high].min():.0f} m; the bound itself falls in {falling:.0%} of the steps.",
            "holds",
        )
    ]


def _iterations(result: LandingResult) -> list[Claim]:
    """5: LM converges in fewer iterations than GLSDC."""
    a = result.arrays
    warm_gn, warm_lm = (a[f"{name}_iterations"][:, 1:].astype(float) for name in ("glsdc", "lm"))
    value, interval = _resampled((warm_gn - warm_lm).mean(axis=1), _identity)
    fewer, fewer_interval = _resampled((warm_lm < warm_gn).mean(axis=1), _identity)
    return [
        Claim(
            "5a",
            "LM needs fewer iterations than GLSDC on average (previous estimate as guess)",
            "fewer (Fig. 6)",
            f"GLSDC {warm_gn.mean():.2f}, LM {warm_lm.mean():.2f}: LM fewer by {_span(value, interval)}",
            value,
            interval,
            _CONFIDENCE,
            judge(interval, above=0.0),
            "Printed stop test, trial steps that LM rejects counted; paired over the same images, bootstrap over runs.",
            "does not",
        ),
        Claim(
            "5b",
            "LM needs fewer iterations on most images",
            "fewer (Fig. 6)",
            f"{_percent(fewer, fewer_interval)} of images",
            fewer,
            fewer_interval,
            _CONFIDENCE,
            judge(fewer_interval, above=0.5),
            "Same runs as 5a, image by image.",
            "does not",
        ),
        *_cold_iterations(result),
    ]


def _cold_iterations(result: LandingResult) -> list[Claim]:
    far = _far_cells(result)
    good = {name: result.arrays[f"cold_{name}_success"][:, far].astype(float) for name in ("gn", "lm")}
    count = {name: result.arrays[f"cold_{name}_iterations"][:, far].astype(float) for name in ("gn", "lm")}
    both = good["gn"] * good["lm"]
    pairs = np.stack([(both * (count["lm"] < count["gn"])).sum(axis=1), both.sum(axis=1)], axis=1)
    fewer, fewer_interval = _resampled(pairs, _ratio)
    means = [float((both * count[name]).sum() / max(both.sum(), 1.0)) for name in ("gn", "lm")]
    saved, saved_interval = _resampled((count["gn"] - count["lm"]).mean(axis=1), _identity)
    lead, lead_interval = _resampled((good["lm"] - good["gn"]).mean(axis=1), _identity)
    return [
        Claim(
            "5c",
            "LM needs fewer iterations from far cold starts, where both succeed",
            "fewer",
            f"in {_percent(fewer, fewer_interval)} of them; mean GLSDC {means[0]:.2f}, LM {means[1]:.2f}",
            fewer,
            fewer_interval,
            _CONFIDENCE,
            judge(fewer_interval, above=0.5),
            f"{_far_text(result)}; stop at a relative change of {result.scenario.cold_cost_tolerance:g}.",
            "does not",
        ),
        Claim(
            "5d",
            "LM needs fewer iterations from far cold starts, all starts counted",
            "fewer",
            f"GLSDC {count['gn'].mean():.1f}, LM {count['lm'].mean():.1f}: LM fewer by {_span(saved, saved_interval)}",
            saved,
            saved_interval,
            _CONFIDENCE,
            judge(saved_interval, above=0.0),
            "Here GLSDC's wandering and diverging starts count with the iterations they burn.",
            "holds",
        ),
        Claim(
            "5e",
            "LM reaches the right pose more often than GLSDC from far cold starts",
            "-",
            f"LM {good['lm'].mean():.2%}, GLSDC {good['gn'].mean():.2%}: LM more by {_percent(lead, lead_interval)}",
            lead,
            lead_interval,
            _CONFIDENCE,
            judge(lead_interval, above=0.0),
            "Success, not the number of iterations, is what LM is for.",
            "holds",
        ),
    ]


def _epochs(result: LandingResult) -> list[Claim]:
    """6: early epochs are harder to converge."""
    times, far = result.scenario.cold_times, _far_cells(result)[0]
    early, late = int(np.argmin(times)), int(np.argmax(times))
    success = result.arrays["cold_gn_success"].astype(float)
    at = {k: success[:, k, far].mean(axis=1) if far.any() else success[:, k, 0, 0] * np.nan for k in (early, late)}
    value, interval = _resampled(at[late] - at[early], _identity)
    claims = [
        Claim(
            "6a",
            "From a cold start, early epochs are harder to converge (GLSDC)",
            "-",
            f"success {at[early].mean():.0%} at {times[early]:.0f} s, {at[late].mean():.0%} at {times[late]:.0f} s: "
            f"gain {_percent(value, interval)}",
            value,
            interval,
            _CONFIDENCE,
            judge(interval, above=0.0),
            f"{_far_text(result)}; the position scatter shrinks with the range.",
            "holds",
        )
    ]
    for letter, name, label, established in _WARM:
        iterations = result.arrays[f"{name}_iterations"][:, 1:].astype(float)
        thirds = np.stack([part.mean(axis=1) for part in np.array_split(iterations, 3, axis=1)], axis=1)
        value, interval = _resampled(thirds[:, 0] - thirds[:, 2], _identity)
        claims.append(
            Claim(
                f"6{letter}",
                f"With the previous estimate as guess, early epochs need more iterations ({label})",
                "-",
                f"{' / '.join(f'{mean:.2f}' for mean in thirds.mean(axis=0))} in the thirds of the descent: {_span(value, interval)}",
                value,
                interval,
                _CONFIDENCE,
                judge(interval, above=0.1),
                "Mean of the first third minus the last, first image excepted; less than 0.1 iteration is no effect.",
                established,
            )
        )
    return claims


def _efficiency(result: LandingResult) -> list[Claim]:
    """9: P = F⁻¹ and the estimate attains it."""
    squares = result.arrays["ml_error"] ** 2 / result.sigma**2
    count = result.runs * squares.shape[1]
    ratios = squares.mean(axis=(0, 1))
    tail = (1 - _BAND) / 2 / 6
    low, high = chi2_quantile([tail, 1 - tail], count) / count
    worst = int(np.argmax(abs(np.log(ratios))))
    value, interval = _scaled_mean(squares[..., worst], dof=1)
    axes = ("x", "y", "z", "attitude 1", "attitude 2", "attitude 3")
    return [
        Claim(
            "9",
            "The covariance is the inverse Fisher information, and the estimate attains it",
            "P = F⁻¹",
            f"measured/predicted variance {ratios.min():.4f} … {ratios.max():.4f} over the six axes",
            value,
            interval,
            _BAND,
            "holds" if bool(np.all((ratios >= low) & (ratios <= high))) else "does not",
            f"All epochs and runs; all six inside [{low:.4f}, {high:.4f}], exact chi-square band at {_BAND:.1%} for the six together. "
            f"Farthest from 1: {axes[worst]}.",
            "holds",
        )
    ]


def _steepest(result: LandingResult) -> Claim:
    """10: with η → ∞ and Γ = I the LM step points down the gradient."""
    import losnav as ln

    s, descent = result.scenario, result.scenario.descent
    k = len(descent.times) // 2
    jacobian = ln.los_jacobian(descent.landmarks, descent.position[k], descent.mrp[k]).reshape(-1, 6)
    guess = descent.position[k] + [3.0, -2.0, 4.0], descent.mrp[k] + [0.004, 0.002, -0.003]
    residual = (descent.los[k] - ln.predict_los(descent.landmarks, *guess)).ravel()
    normal, downhill = jacobian.T @ jacobian / s.los_sigma**2, jacobian.T @ residual / s.los_sigma**2
    largest = np.linalg.eigvalsh(normal)[-1]
    angles = []
    for ratio in (1.0, 1e3, 1e6):
        step = np.linalg.solve(normal + ratio * largest * np.eye(6), downhill)
        across = step / np.linalg.norm(step) - downhill / np.linalg.norm(downhill)
        angles.append(float(2 * np.degrees(np.arcsin(np.linalg.norm(across) / 2))))
    shrinking = angles[0] > angles[1] > angles[2]
    return Claim(
        "10",
        "For η → ∞ with Γ = I the LM step becomes steepest descent",
        "-",
        f"angle between them {angles[0]:.2g}, {angles[1]:.2g}, {angles[2]:.2g} deg for η = 1, 10³, 10⁶ times the largest eigenvalue",
        angles[2],
        (angles[2], angles[2]),
        _CONFIDENCE,
        "holds" if shrinking and angles[2] < 1e-3 else "does not",
        "The direction only: with Γ = I and these units (m beside MRP) such steps hardly move the attitude or hardly move the position.",
        "holds",
    )


def _pairs(
    position: float, attitude: float, established: tuple[Verdict, Verdict]
) -> tuple[tuple[str, str, slice, tuple[str, float], float, Verdict], ...]:
    """Position and attitude as (letter, name, components, unit and its factor, limit, established verdict)."""
    return (
        ("a", "position", slice(0, 3), ("m", 1.0), position, established[0]),
        ("b", "attitude", slice(3, 6), ("deg", float(np.degrees(1.0))), attitude, established[1]),
    )


def _far_cells(result: LandingResult) -> NDArray[np.bool_]:
    s = result.scenario
    offsets = np.array(s.cold_offsets) > np.min(s.cold_offsets)
    angles = np.array(s.cold_angles) > np.min(s.cold_angles)
    cells = offsets[:, None] & angles[None, :]
    return np.broadcast_to(cells, (len(s.cold_times), *cells.shape))


def _far_text(result: LandingResult) -> str:
    s = result.scenario
    angles = sorted(np.degrees(s.cold_angles))[1:]
    offsets = sorted(s.cold_offsets)[1:]
    if not angles or not offsets:
        return "No far cells in this grid"
    return f"Guesses scattered by {offsets[0]:.0f} to {offsets[-1]:.0f} m (as of t = 0) and {angles[0]:.0f} to {angles[-1]:.0f} deg"


def _scaled_mean(values: Array, dof: int = 6) -> tuple[float, tuple[float, float]]:
    """Mean of chi-square variables of unknown scale, with its exact interval."""
    mean, total = float(np.mean(values)), dof * values.size
    low, high = chi2_quantile([(1 - _BAND) / 2, (1 + _BAND) / 2], total)
    return mean, (mean * total / float(high), mean * total / float(low))


def _deviation(values: Array) -> tuple[float, tuple[float, float]]:
    """Standard deviation about zero of a normal sample, with its exact interval."""
    deviation, count = float(np.sqrt(np.mean(values**2))), len(values)
    low, high = chi2_quantile([(1 - _CONFIDENCE) / 2, (1 + _CONFIDENCE) / 2], count)
    return deviation, (deviation * float(np.sqrt(count / high)), deviation * float(np.sqrt(count / low)))


def _resampled(values: Array, statistic: Callable[[Array], Array]) -> tuple[float, tuple[float, float]]:
    """Statistic of the mean over runs (first axis), with its bootstrap interval."""
    runs = len(values)
    if runs < 2 or values[0].size == 0:
        return (float(statistic(values.mean(axis=0))) if values.size else np.nan), (-np.inf, np.inf)
    weights = np.random.default_rng(0).multinomial(runs, np.full(runs, 1 / runs), size=_RESAMPLES) / runs
    draws = statistic(weights @ values)
    low, high = np.quantile(draws, [(1 - _CONFIDENCE) / 2, (1 + _CONFIDENCE) / 2])
    return float(statistic(values.mean(axis=0))), (float(low), float(high))


def _resampled_median(values: Array) -> tuple[float, tuple[float, float]]:
    from losnav.consistency import bootstrap_interval

    return float(np.median(values)), bootstrap_interval(values, np.median, confidence=_CONFIDENCE)


def _identity(mean: Array) -> Array:
    return mean


def _ratio(mean: Array) -> Array:
    return np.asarray(mean[..., 0] / np.maximum(mean[..., 1], 1e-12))


def _span(value: float, interval: tuple[float, float]) -> str:
    return f"{value:.2f} [{interval[0]:.2f}, {interval[1]:.2f}]"


def _percent(value: float, interval: tuple[float, float]) -> str:
    return f"{100 * value:.1f} % [{100 * interval[0]:.1f}, {100 * interval[1]:.1f}]"
