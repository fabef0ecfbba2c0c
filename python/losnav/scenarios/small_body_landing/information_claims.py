"""Claims N5 to N7: what the sensors see of the state and of the model error, and how wrong gravity may be."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

import losnav as ln
from losnav.landing import NADIR
from losnav.scenarios.intervals import resampled
from losnav.scenarios.judging import computed, ratio, sampled, text
from losnav.scenarios.small_body_landing.result import VELOCITY
from losnav.scenarios.small_body_landing.truth import (
    direction,
    fly,
    nearby_errors,
    polyhedron,
    shape_harmonics,
    shape_of,
)
from losnav.scenarios.verdicts import Claim, judge

if TYPE_CHECKING:
    from losnav.scenarios.small_body_landing.result import SmallBodyLandingResult

__all__ = ["gravity_differences", "information_claims", "lacking", "model_error_information", "ranks"]

Array = NDArray[np.float64]

# Smallest singular value over the largest, of rows and columns in sigmas, that counts as rank.
_RANK = 1e-9
_TENTH = 0.1
_TRACKS = 0.05
_SAME = 0.01
_REALISTIC = 0.2


def information_claims(result: SmallBodyLandingResult) -> list[Claim]:
    """Claims 5, 6 and 7."""
    return [*_observable(result), *_model_error(result), *_gravity(result)]


def _rows(camera: ln.sensors.LandmarkCamera, sigma: float, state: ln.NavState, scale: Array) -> Array:
    """Jacobian of camera and velocimeter with respect to [r v a], in sigmas, (rows, 9)."""
    velocimeter = ln.sensors.Velocimeter(sigma)
    pixels = camera.jacobian(state)[:, :9] / camera.sigma_px
    return np.concatenate([pixels, velocimeter.jacobian(state)[:, :9] / sigma]) * scale


def ranks(result: SmallBodyLandingResult) -> tuple[Array, float]:
    """Smallest over largest singular value at every epoch of the flight (T,), and on the danger cylinder."""
    s, flight = result.scenario, fly(result.scenario)
    scale = np.repeat([s.position_sigma, s.velocity_sigma, s.attitude_sigma], 3)
    degrees = []
    for k in range(len(flight.times)):
        three = flight.chosen[k]
        if (three < 0).any():
            degrees.append(0.0)
            continue
        camera = flight.camera_of(flight.catalogue[flight.used[three]])
        degrees.append(_degree(_rows(camera, s.velocimeter_sigma, flight.state[k], scale)))
    # Three landmarks on a circle, and the camera straight above a point of it.
    angles = np.array([0.3, 2.1, 4.4])
    radius = 100.0
    marks = radius * np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    above = ln.NavState.from_dcm([radius, 0.0, 3 * radius], [0.3, -0.2, -1.0], NADIR)
    return np.array(degrees), _degree(_rows(flight.camera_of(marks), s.velocimeter_sigma, above, scale))


def _degree(matrix: Array) -> float:
    values = np.linalg.svd(matrix, compute_uv=False)
    return float(values[-1] / values[0])


def _observable(result: SmallBodyLandingResult) -> list[Claim]:
    """N5: rank 9 from three landmarks and the velocimeter, without any motion."""
    along, cylinder = ranks(result)
    low = float(along.min())
    return [
        computed(
            low,
            number="5a",
            statement="Three landmarks and the velocimeter make the nine states observable at once "
            "(rank 9 at "
            "order 0): along the flight",
            printed="rank 9",
            ours=f"smallest over largest singular value at least {low:.2g}",
            verdict="holds" if low > _RANK else "does not",
            why=f"Jacobians of the chosen three landmarks at {len(along)} epochs, rows and columns "
            "in sigmas.",
            established="holds",
        ),
        computed(
            cylinder,
            number="5b",
            statement="... wherever the camera is",
            printed="rank 9",
            ours=f"smallest over largest singular value {cylinder:.1g} on the danger cylinder: rank 8",
            verdict="holds" if cylinder > _RANK else "does not",
            why="On the cylinder through the three landmarks, upright on their plane, the pose is "
            "not determined "
            "to first order; a fourth landmark, or motion, determines it.",
            established="does not",
        ),
    ]


def model_error_information(result: SmallBodyLandingResult) -> tuple[Array, float]:
    """Largest eigenvalue of ``S' R^-1 S`` of the camera along the flight (T,), and of the "
    "velocimeter, s⁴/m²."""
    flight, step, rows = fly(result.scenario), result.scenario.sampling, []
    for k, three in enumerate(flight.chosen):
        camera = flight.camera_of(flight.catalogue[flight.used[three]])
        slope = camera.jacobian(flight.state[k])[:, :3] * step**2 / 2
        information = slope.T @ np.linalg.solve(camera.noise(flight.state[k]), slope)
        rows.append(np.linalg.eigvalsh(information)[-1] if three.min() >= 0 else 0.0)
    return np.array(rows), (step / result.scenario.velocimeter_sigma) ** 2


def gravity_differences(result: SmallBodyLandingResult) -> Array:
    """True gravity less the filters', at the largest gravity error, site axes, m/s², (T, 3)."""
    flight = fly(result.scenario)
    fixed = (flight.state.position + flight.site.center) @ flight.site.site_from_fixed
    return np.asarray(result.worst * flight.gravity.acceleration(fixed) @ flight.site.site_from_fixed.T)


def lacking(result: SmallBodyLandingResult) -> Array:
    """What the filters' model lacks at the largest gravity error: gravity, less what the accelerometers show
    too much, site axes, m/s², (runs, T, 3). Only turns of the body could tell the two apart."""
    bias = np.einsum("tji,rtj->rti", fly(result.scenario).state.dcm, result.arrays["bias"])
    return np.asarray(gravity_differences(result) - bias)


def _model_error(result: SmallBodyLandingResult) -> list[Claim]:
    """N6: the predictive filter finds the error of gravity."""
    camera, velocimeter = model_error_information(result)
    share = float(camera.max() / velocimeter)
    missing, late = lacking(result)[:, result.late], result.late
    size = float(np.sqrt(np.mean(np.sum(missing**2, axis=-1))))
    claims = [
        computed(
            share,
            number="6a",
            statement="Camera and velocimeter both contribute to the estimated model error",
            printed="both",
            ours=f"information of the camera at most {camera.max():.2g} s^4/m^2, of the velocimeter "
            f"{velocimeter:.2g}",
            verdict=judge((share, share), above=_TENTH),
            why="In a second an acceleration moves the image by T^2/2 f/z, 0.25 px for 1 m/s^2 at 1 km. The "
            "predictive stage is one of the velocimeter.",
            established="does not",
        )
    ]
    found = {name: result.arrays["disturbance"][:, k][:, late] for k, name in enumerate(result.names)}
    single = np.square(found["predictive"] - missing).sum(axis=-1).mean(axis=1) / size**2
    scatter = resampled(single[:, np.newaxis], _root)
    lasting = (found["EKF, acceleration"] - missing).mean(axis=1) / size
    bias = resampled(np.square(lasting).sum(axis=-1)[:, np.newaxis], _root)
    noise = np.sqrt(np.mean(np.square(found["EKF, acceleration"] - missing).sum(axis=-1))) / size
    what = f"what it lacks, {1e3 * size:.2g} mm/s^2"
    claims += [
        sampled(
            scatter,
            number="6b",
            statement="The estimated model error is what the model lacks: predictive filter, every second",
            printed="tracks it",
            ours=f"RMS difference {text(scatter, '%', 100.0)} of {what}",
            verdict=judge(scatter[1], below=0.5),
            why=f"Gravity {100 * result.worst:g} % too small, and the bias of the accelerometers; "
            "asked: below "
            "50 %. One innovation of the velocimeter is what an estimate is made of.",
            established="does not",
        ),
        sampled(
            bias,
            number="6c",
            statement="The estimated acceleration is what the model lacks: EKF, average of a run",
            printed="-",
            ours=f"off by {text(bias, '%', 100.0)} of {what}; every second {100 * noise:.1f} %",
            verdict=judge(bias[1], below=_TRACKS),
            why=f"The same, averaged from {result.scenario.settled:g} s on; asked: below 5 %.",
            established="holds",
        ),
    ]
    return [*claims, *_equal_gain(result)]


def _root(mean: Array) -> Array:
    return np.asarray(np.sqrt(mean[..., 0]))


def _equal_gain(result: SmallBodyLandingResult) -> list[Claim]:
    """6d: the predictive stage is a larger process noise."""
    pair = [result.average(name, result.worst, VELOCITY) for name in ("predictive", "EKF, equal gain")]
    relative = resampled(np.stack(pair, axis=1), ratio)
    values = [1e3 * np.sqrt(x.mean()) for x in pair]
    return [
        sampled(
            relative,
            number="6d",
            statement="The predictive stage does what a larger process noise does: velocity of an "
            "EKF with the same "
            "gain",
            printed="-",
            ours=f"x {text(relative, form='.4f')}: {values[0]:.4g} against {values[1]:.4g} mm/s",
            verdict=judge(relative[1], above=1 - _SAME, below=1 + _SAME),
            why=f"{1e3 * result.scenario.equal_gain_noise:g} mm/s^2/sqrt(Hz), gravity "
            f"{100 * result.worst:g} % too "
            f"small, average from {result.scenario.settled:g} s; asked: equal within 1 %.",
            established="holds",
        )
    ]


def _gravity(result: SmallBodyLandingResult) -> list[Claim]:
    """N7: gravity may be wrong by 20, 50, 100 %."""
    s, shape = result.scenario, shape_of(result.scenario.shape)
    along = direction(s)
    place = (shape.radius(along) + 20.0) * along
    exact = polyhedron(s).acceleration(place)
    site = float(np.linalg.norm(shape_harmonics(s).acceleration(place) - exact) / np.linalg.norm(exact))
    around = nearby_errors(s)
    listed = (
        ("a", site, f"20 m above the site, {100 * site:.0f} %"),
        (
            "b",
            float(np.median(around)),
            f"20 m above the faces, {100 * np.median(around):.0f} % in the median, "
            f"{100 * around.min():.0f} to {100 * around.max():.0f} %",
        ),
    )
    claims = []
    for letter, value, ours in listed:
        claims.append(
            computed(
                value,
                number=f"7{letter}",
                statement="Gravity wrong by 20 to 100 % is realistic: "
                + ("at the site" if letter == "a" else "anywhere near the surface"),
                printed="20, 50, 100 %",
                ours=ours,
                verdict=judge((value, value), above=_REALISTIC),
                why=f"Harmonics of degree 4 of the {shape.name} against the same body as a "
                "polyhedron. Inside the "
                f"sphere round the body ({shape.largest_radius / 1e3:.1f} km) the series need not "
                "converge; with the "
                "measured shape of Eros it is 23 to 39 % at the tips and 900 % or more elsewhere.",
                established="holds",
            )
        )
    return claims
