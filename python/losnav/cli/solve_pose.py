"""``losnav solve-pose``: the pose of a camera from a user's own measurements, and how well it is known."""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import losnav as ln
from losnav.attitude import mrp_from_quaternion
from losnav.cli.measurements import Camera, Observations, read_landmarks, read_observations
from losnav.cli.pose_report import report_json, report_text
from losnav.errors import InvalidInputError

__all__ = ["add_command", "numbers", "positive"]

Array = NDArray[np.float64]

NOT_CONVERGED = 1


@dataclass(frozen=True)
class Problem:
    """Matched measurements, ready for the solver.

    Attributes
    ----------
    ids : tuple of str
        Identifier of each observation.
    landmarks, los : (N, 3) arrays
        m, and unit vectors in camera axes.
    sigma : float or None
        1-sigma of every LOS, rad, if the noise was given so.
    covariance : (N, 3, 3) array or None
        Covariance of each LOS, rad², if the noise was given in pixels.
    unobserved : int
        Landmarks without an observation.
    """

    ids: tuple[str, ...]
    landmarks: Array
    los: Array
    sigma: float | None
    covariance: Array | None
    unobserved: int

    @property
    def noise(self) -> dict[str, Any]:
        """Noise arguments of the solver; empty if no noise was given."""
        if self.covariance is not None:
            return {"covariance": self.covariance}
        return {} if self.sigma is None else {"sigma": self.sigma}


def add_command(commands: Any) -> None:
    """Add the command to a parser's subparsers."""
    command = commands.add_parser(
        "solve-pose",
        help="pose of a camera from landmarks and observations in CSV files",
        description=(
            "Position and attitude of a camera from known landmarks, with 1-sigma, chi-square and what is "
            "weak."
        ),
        epilog=(
            "LANDMARKS.csv: id,x,y,z in metres. OBSERVATIONS.csv: id,ux,uy,uz (unit vectors in camera axes) "
            "or id,u,v in pixels with --focal. A header line is optional. Camera axes: x right, y down, z "
            "forward; distortion x_d = x (1 + k1 r^2 + k2 r^4) in normalised coordinates. BAL files have y "
            "up and look along -z: give v with the opposite sign; their rotation is diag(1,-1,-1) times ours."
        ),
    )
    command.add_argument("landmarks", type=Path, metavar="LANDMARKS.csv")
    command.add_argument("observations", type=Path, metavar="OBSERVATIONS.csv")
    command.add_argument("--focal", type=numbers(1, 2), metavar="F or FX,FY", help="focal length, px")
    command.add_argument(
        "--principal-point", type=numbers(2), metavar="CX,CY", help="principal point, px (default 0,0)"
    )
    command.add_argument("--distortion", type=numbers(1, 2), metavar="K1,K2", help="radial distortion")
    noise = command.add_mutually_exclusive_group()
    noise.add_argument(
        "--sigma", type=positive, metavar="RAD", help="1-sigma of a line of sight per axis, rad"
    )
    noise.add_argument("--sigma-px", type=positive, metavar="PX", help="1-sigma of a pixel coordinate, px")
    command.add_argument(
        "--robust", action="store_true", help="find and reject wrong matches (needs a sigma)"
    )
    command.add_argument(
        "--guess",
        type=numbers(6, 7),
        metavar="X,Y,Z,...",
        help="first guess: position and MRP (6 numbers) or quaternion x,y,z,w (7); "
        "none is needed, and --robust uses none",
    )
    command.add_argument("--json", action="store_true", help="print JSON")
    command.set_defaults(command=_solve)


def numbers(*counts: int) -> Any:
    """A parser of options like ``1,2,3`` with one of these counts of numbers."""

    def parsed(text: str) -> tuple[float, ...]:
        try:
            values = tuple(float(part) for part in text.split(","))
        except ValueError:
            values = ()
        if len(values) not in counts or not np.isfinite(values).all():
            wanted = " or ".join(map(str, counts))
            raise argparse.ArgumentTypeError(
                f"expected {wanted} finite numbers separated by commas, got {text!r}"
            )
        return values

    return parsed


def positive(text: str) -> float:
    """Read an option that is a positive number."""
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not (np.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"expected a positive number, got {text!r}")
    return value


def _solve(arguments: argparse.Namespace) -> int:
    problem = _problem(arguments)
    solution, inliers = _solution(problem, arguments)
    report = report_json(problem, solution, inliers)
    print(json.dumps(report, indent=1) if arguments.json else report_text(report))
    return 0 if report["converged"] else NOT_CONVERGED


def _problem(arguments: argparse.Namespace) -> Problem:
    positions, observations = read_landmarks(arguments.landmarks), read_observations(arguments.observations)
    unknown = [
        (k, place)
        for k, place in zip(observations.ids, observations.places, strict=True)
        if k not in positions
    ]
    if unknown:
        listed = ", ".join(repr(k) for k, _ in unknown[:5]) + (", …" if len(unknown) > 5 else "")
        raise InvalidInputError(f"{unknown[0][1]}: expected ids of {arguments.landmarks}, got {listed}")
    if len(observations.ids) < 3:
        raise InvalidInputError(
            f"{arguments.observations}: expected at least 3 observations, got {len(observations.ids)}"
        )
    if not arguments.robust:
        _refuse_same_place(observations, positions)
    camera = _camera(arguments, observations)
    los = observations.values if camera is None else camera.los(observations)
    covariance = None
    if arguments.sigma_px is not None and camera is not None:
        covariance = camera.covariance(los, arguments.sigma_px)
    return Problem(
        observations.ids,
        np.array([positions[k] for k in observations.ids]),
        los,
        arguments.sigma,
        covariance,
        len(positions) - len(observations.ids),
    )


def _refuse_same_place(observations: Observations, positions: dict[str, tuple[float, ...]]) -> None:
    seen: dict[tuple[float, ...], str] = {}
    for identifier, place in zip(observations.ids, observations.places, strict=True):
        other = seen.setdefault(positions[identifier], identifier)
        if other != identifier:
            raise InvalidInputError(
                f"{place}: expected landmarks at different places, got {identifier!r} where "
                f"{other!r} is; keep one, or let --robust choose"
            )


def _camera(arguments: argparse.Namespace, observations: Observations) -> Camera | None:
    """The camera that turns pixels into lines of sight; None if the observations are unit vectors."""
    options = {"--principal-point": arguments.principal_point, "--distortion": arguments.distortion}
    options["--sigma-px"] = arguments.sigma_px
    if not observations.pixels:
        for option, value in {"--focal": arguments.focal, **options}.items():
            if value is not None:
                raise InvalidInputError(
                    f"{option}: expected pixels (id,u,v), got unit vectors in {arguments.observations}"
                )
        return None
    if arguments.focal is None:
        raise InvalidInputError(
            f"--focal: expected the focal length for the pixels of {arguments.observations}, got none"
        )
    if not all(value > 0 for value in arguments.focal):
        raise InvalidInputError(f"--focal: expected positive numbers, got {arguments.focal}")
    focal = (arguments.focal[0], arguments.focal[-1])
    distortion = (*(arguments.distortion or (0.0,)), 0.0)[:2]
    return Camera(focal, arguments.principal_point or (0.0, 0.0), (distortion[0], distortion[1]))


def _solution(problem: Problem, arguments: argparse.Namespace) -> tuple[ln.PoseSolution, NDArray[np.bool_]]:
    everything = np.ones(len(problem.ids), dtype=bool)
    guess = None
    if arguments.guess is not None:
        values = np.array(arguments.guess)
        guess = values if len(values) == 6 else np.concatenate([values[:3], _mrp(values[3:])])
    if not arguments.robust:
        return ln.solve_pose(problem.landmarks, problem.los, guess=guess, **problem.noise), everything
    if not problem.noise:
        raise InvalidInputError(
            "--robust: expected --sigma or --sigma-px to tell a wrong match from noise, got neither"
        )
    robust = ln.solve_pose_robust(problem.landmarks, problem.los, **problem.noise)
    return robust, np.asarray(robust.inliers, dtype=bool)


def _mrp(quaternion: Array) -> Array:
    norm = np.linalg.norm(quaternion)
    if not abs(norm - 1) <= 1e-3:
        raise InvalidInputError(f"--guess: expected a unit quaternion x,y,z,w, got one of norm {norm:.6g}")
    return np.asarray(mrp_from_quaternion(quaternion / norm))
