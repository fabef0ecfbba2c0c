"""``losnav solve-attitude``: the attitude of a camera from identified stars, and how well it is known."""

from __future__ import annotations

import argparse
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import losnav as ln
from losnav.cli.attitude_report import report_json, report_text
from losnav.cli.measurements import Camera
from losnav.cli.solve_pose import numbers, positive
from losnav.cli.star_list import ARCSEC, StarList, read_stars
from losnav.errors import InvalidInputError

__all__ = ["add_command"]

Array = NDArray[np.float64]

NOT_CONVERGED = 1
METHODS = ("quest", "q-method", "svd", "foam", "esoq2")
_UNITS = {"": 1.0, "rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "arcsec": ARCSEC, "deg": float(np.radians(1.0))}
# A sigma of a radian says nothing about a direction; it is a number in another unit.
_LARGEST_SIGMA = 1.0


@dataclass(frozen=True)
class Problem:
    """Matched stars, ready for the solver.

    Attributes
    ----------
    ids : tuple of str
        Name of each star.
    body, reference : (N, 3) arrays
        Unit vectors in camera axes and in the catalogue's frame.
    sigma : (N,) array or None
        1-sigma of each direction per axis, rad; None if no noise was given.
    magnitude : (N,) array or None
    method : {"quest", "q-method", "svd", "foam", "esoq2"}
        Solver.
    """

    ids: tuple[str, ...]
    body: Array
    reference: Array
    sigma: Array | None
    magnitude: Array | None
    method: Any


def add_command(commands: Any) -> None:
    """Add the command to a parser's subparsers."""
    command = commands.add_parser(
        "solve-attitude",
        help="attitude of a camera from identified stars in a CSV file",
        description=(
            "Attitude of a camera from identified stars, with 1-sigma in seconds of arc, chi-square, and "
            "what does not fit."
        ),
        epilog=(
            "FILE.csv: one star a line, columns by a header: bx,by,bz (unit vector in camera axes) or u,v "
            "(pixels, with --focal); rx,ry,rz (catalogue unit vector) or ra,dec (degrees); optional id, "
            "sigma (rad) or sigma_arcsec or sigma_px, mag. Without a header: [id,]bx,by,bz,rx,ry,rz. Camera "
            "axes: x right, y down, z along the boresight."
        ),
    )
    command.add_argument("stars", type=Path, metavar="FILE.csv")
    command.add_argument(
        "--focal", "--focal-length-px", type=numbers(1, 2), metavar="F or FX,FY", help="focal length, px"
    )
    command.add_argument(
        "--principal-point",
        "--center",
        type=numbers(2),
        metavar="CX,CY",
        help="principal point, px (default 0,0)",
    )
    lens = command.add_mutually_exclusive_group()
    lens.add_argument(
        "--distortion", type=numbers(1, 2), metavar="K1,K2", help="radial: x_d = x (1 + K1 r^2 + K2 r^4)"
    )
    lens.add_argument(
        "--undistortion",
        type=numbers(1, 2),
        metavar="K1,K2",
        help="the inverse model: x = x_d (1 + K1 r_d^2 + K2 r_d^4)",
    )
    sigma = command.add_mutually_exclusive_group()
    sigma.add_argument(
        "--sigma",
        type=_angle,
        metavar="ANGLE",
        help="1-sigma of a star's direction per axis, rad, or with a unit: 7arcsec, 30urad",
    )
    sigma.add_argument("--sigma-px", type=positive, metavar="PX", help="1-sigma of a pixel coordinate, px")
    command.add_argument(
        "--velocity",
        type=numbers(3),
        metavar="VX,VY,VZ",
        help="of the observer in the catalogue's frame, m/s: corrects aberration (20 arcsec for the Earth's)",
    )
    command.add_argument("--method", choices=METHODS, default=METHODS[0], help="solver (default quest)")
    command.add_argument(
        "--robust", action="store_true", help="find and reject wrong identifications (needs a sigma)"
    )
    command.add_argument("--json", action="store_true", help="print JSON")
    command.set_defaults(command=_solve)


def _angle(text: str) -> float:
    match = re.fullmatch(r"\s*([-+.\deE]*[\d.])\s*([a-z]*)\s*", text)
    try:
        value = float(match[1]) * _UNITS[match[2]] if match else np.nan
    except (ValueError, KeyError):
        value = np.nan
    if not (np.isfinite(value) and value > 0):
        units = ", ".join(unit for unit in _UNITS if unit)
        raise argparse.ArgumentTypeError(
            f"expected a positive angle in rad, or with a unit ({units}), got {text!r}"
        )
    if not value < _LARGEST_SIGMA:
        raise argparse.ArgumentTypeError(
            f"expected less than 1 rad, got {text!r}; write 7arcsec for 7 arcsec"
        )
    return float(value)


def _solve(arguments: argparse.Namespace) -> int:
    problem = _problem(arguments)
    solution, inliers = _solution(problem, arguments.robust)
    report = report_json(problem, solution, inliers)
    print(json.dumps(report, indent=1) if arguments.json else report_text(report))
    return 0 if report["converged"] else NOT_CONVERGED


def _problem(arguments: argparse.Namespace) -> Problem:
    stars = read_stars(arguments.stars, repeated=arguments.robust)
    camera = _camera(arguments, stars)
    body = stars.measured.values if camera is None else camera.los(stars.measured)
    reference = stars.reference
    if arguments.velocity is not None:
        reference = ln.star_tracker.aberrate(reference, arguments.velocity)
    return Problem(
        stars.measured.ids,
        body,
        reference,
        _sigmas(arguments, stars, camera, body),
        stars.magnitude,
        arguments.method,
    )


def _camera(arguments: argparse.Namespace, stars: StarList) -> Camera | None:
    """The camera that turns pixels into directions; None if the file holds unit vectors."""
    options = {
        "--focal": arguments.focal,
        "--principal-point": arguments.principal_point,
        "--distortion": arguments.distortion,
        "--undistortion": arguments.undistortion,
        "--sigma-px": arguments.sigma_px,
        "sigma_px": stars.sigma if stars.sigma_unit == "px" else None,
    }
    if not stars.measured.pixels:
        for option, value in options.items():
            if value is not None:
                raise InvalidInputError(
                    f"{option}: expected pixels (u,v), got unit vectors in {arguments.stars}"
                )
        return None
    if arguments.focal is None:
        raise InvalidInputError(
            f"--focal: expected the focal length for the pixels of {arguments.stars}, got none"
        )
    if not all(value > 0 for value in arguments.focal):
        raise InvalidInputError(f"--focal: expected positive numbers, got {arguments.focal}")
    return Camera(
        (arguments.focal[0], arguments.focal[-1]),
        arguments.principal_point or (0.0, 0.0),
        _pair(arguments.distortion),
        _pair(arguments.undistortion),
    )


def _pair(coefficients: tuple[float, ...] | None) -> tuple[float, float]:
    first, second = (*(coefficients or (0.0,)), 0.0)[:2]
    return first, second


def _sigmas(
    arguments: argparse.Namespace, stars: StarList, camera: Camera | None, body: Array
) -> Array | None:
    """1-sigma of each direction per axis, rad."""
    option = "--sigma" if arguments.sigma is not None else "--sigma-px"
    if stars.sigma is not None and (arguments.sigma or arguments.sigma_px) is not None:
        raise InvalidInputError(f"{option}: expected the noise once, got a column of it in {arguments.stars}")
    pixels = stars.sigma if stars.sigma_unit == "px" else arguments.sigma_px
    if camera is not None and pixels is not None:
        # Off axis a pixel is less angle, radially more so; its mean variance is what an isotropic sigma can
        # say.
        unit = camera.covariance(body, 1.0)
        across = np.trace(unit, axis1=1, axis2=2) - np.einsum("ni,nij,nj->n", body, unit, body)
        return np.asarray(pixels * np.sqrt(across / 2))
    sigma = stars.sigma if stars.sigma is not None else arguments.sigma
    if sigma is None:
        return None
    largest = float(np.max(sigma))
    if not largest < _LARGEST_SIGMA:
        raise InvalidInputError(
            f"{arguments.stars}: sigma: expected less than 1 rad, got {largest:g}; name the column "
            "sigma_arcsec or sigma_px if that is its unit"
        )
    return np.full(len(body), sigma) if np.ndim(sigma) == 0 else np.asarray(sigma)


def _solution(problem: Problem, robust: bool) -> tuple[ln.AttitudeSolution, NDArray[np.bool_]]:
    sigma: Any = 1.0 if problem.sigma is None else problem.sigma
    inliers = np.ones(len(problem.ids), dtype=bool)
    if robust:
        if problem.sigma is None:
            raise InvalidInputError(
                "--robust: expected a sigma (--sigma, --sigma-px or a column) to tell a wrong star from "
                "noise, got none"
            )
        found = ln.solve_attitude_robust(problem.body, problem.reference, sigma=sigma)
        inliers = np.asarray(found.inliers, dtype=bool)
        if problem.method == METHODS[0] or not found.converged:
            return found, inliers
        sigma = problem.sigma[inliers]
    body, reference = problem.body[inliers], problem.reference[inliers]
    return ln.solve_attitude(body, reference, sigma=sigma, method=problem.method), inliers
