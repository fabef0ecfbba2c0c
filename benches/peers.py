"""Who else solves it, and how their conventions map to ours.

============  ==============================  =========================================================
peer          its pose                        in losnav's terms
============  ==============================  =========================================================
losnav        ``position``, ``dcm``, ``mrp``  b = dcm (L - p)/|L - p|, unit vectors, any direction
OpenCV        ``rvec``, ``tvec``              Rodrigues(rvec) = dcm, tvec = -dcm p; pixels, z > 0
PoseLib       ``CameraPose.R``, ``.t``        R = dcm, t = -dcm p; pixels (p3p: unit vectors), z > 0
SciPy         ours to choose: ``[p, mrp]``    residuals b - h(p, mrp) and their Jacobian, in NumPy
NumPy oracle  ``position``, ``mrp``           as losnav; dense whitened rows, QR in every step
numba twin    ``position``, quaternion xyzw   as losnav; the same algorithm, see ``numba_twin``
============  ==============================  =========================================================

OpenCV and PoseLib see a camera of focal length 1000 pixels without distortion and minimise distances in its
image plane, losnav angles on the sphere: with noise the two optima differ by a part of the noise, without
noise they are the same. So the error is given twice: on the noisy scene against the optimum in directions,
and on the same scene without noise against the truth. Everybody stops at 1e-12 (relative cost, or 1e-14 on
gradient and step where that is what there is) unless the row says "its defaults".
"""

from __future__ import annotations

import cv2
import numpy as np
import poselib
from scipy.optimize import least_squares
from tests.oracle import pose as oracle
from tests.oracle.attitude import dcm_from_mrp
from tests.oracle.los import los_jacobian, predict_los

import losnav as ln
from benches import numba_twin
from benches.clock import Contender
from benches.scenes import FOCAL, SIGMA, mrp_from_dcm

CAMERA = poselib.Camera("PINHOLE", [FOCAL, FOCAL, 0.0, 0.0], 1, 1)
TIGHT = {"loss_type": "TRIVIAL", "max_iterations": 100, "gradient_tol": 1e-14, "step_tol": 1e-14}
DEFAULTS = {"loss_type": "TRIVIAL"}
CRITERIA = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 50, 1e-12)
INTRINSICS = np.diag([FOCAL, FOCAL, 1.0])


# --- poses in losnav's terms ------------------------------------------------------------------------


def from_solution(solution):
    """losnav."""
    return solution.position, solution.dcm


def list_all(solution):
    """losnav: the best and its alternatives."""
    return [from_solution(each) for each in (solution, *solution.alternatives)]


def from_opencv(rvec, tvec):
    """OpenCV."""
    dcm = cv2.Rodrigues(rvec)[0]
    return (-dcm.T @ tvec).ravel(), dcm


def from_poselib(pose):
    """PoseLib."""
    return -pose.R.T @ pose.t, pose.R


def to_poselib(position, dcm):
    """PoseLib's pose object."""
    pose = poselib.CameraPose()
    pose.R, pose.t = dcm, -dcm @ position
    return pose


def to_opencv(position, dcm):
    """OpenCV's pair of vectors."""
    return cv2.Rodrigues(dcm)[0], (-dcm @ position).reshape(3, 1)


# --- contenders: statement timed over prepared problems, and the same call for the error ----------------


def _contender(name, body, problems, namespace, read, *, note=""):
    """``body`` is a call on the names of one problem (a dictionary); the loop over them is timed with it."""
    names = list(problems[0])
    rows = [tuple(problem.values()) for problem in problems]
    statement = f"for {', '.join(names)}, in problems: {body}"
    answers = [read(eval(body, {**namespace, **problem})) for problem in problems]
    return Contender(name, statement, {**namespace, "problems": rows}, len(rows), answers, note)


def losnav_warm(scenes):
    """The public call, checks and covariance's information included."""
    problems = [{"landmarks": s.landmarks, "los": s.los, "guess": s.guess} for s in scenes]
    body = "solve_pose(landmarks, los, sigma=SIGMA, guess=guess)"
    return _contender("losnav", body, problems, {"solve_pose": ln.solve_pose, "SIGMA": SIGMA}, from_solution)


def losnav_free(scenes):
    """The public call without a guess."""
    problems = [{"landmarks": s.landmarks, "los": s.los} for s in scenes]
    body = "solve_pose(landmarks, los, sigma=SIGMA)"
    contender = _contender("losnav", body, problems, {"solve_pose": ln.solve_pose, "SIGMA": SIGMA}, list_all)
    if len(scenes[0].landmarks) == 3:
        _nearest(contender, scenes)
    else:
        contender.answers = [poses[0] for poses in contender.answers]
    return contender


def losnav_robust(scenes):
    """The public robust call."""
    problems = [{"landmarks": s.landmarks, "los": s.los} for s in scenes]
    body = "solve(landmarks, los, sigma=SIGMA)"
    return _contender(
        "losnav", body, problems, {"solve": ln.solve_pose_robust, "SIGMA": SIGMA}, from_solution
    )


def numba_warm(scenes):
    """The jitted twin on prepared output memory."""
    out = np.empty(31)
    problems = [{"landmarks": s.landmarks, "los": s.los, "guess": s.guess} for s in scenes]
    body = "solve(landmarks, los, SIGMA, guess, out)"
    namespace = {"solve": numba_twin.solve, "SIGMA": SIGMA, "out": out}
    note = "no checks, no normalisation"
    return _contender("numba twin", body, problems, namespace, lambda _: numba_twin.pose(out), note=note)


def poselib_warm(scenes, options, name):
    """PoseLib's refinement."""
    problems = [
        {"pixels": s.pixels, "landmarks": s.landmarks, "guess": to_poselib(s.guess_position, s.guess_dcm)}
        for s in scenes
    ]
    namespace = {"refine": poselib.refine_absolute_pose, "camera": CAMERA, "options": options}
    body = "refine(pixels, landmarks, guess, camera, options)"
    return _contender(
        name, body, problems, namespace, lambda r: from_poselib(r[0]), note="pixels, no covariance"
    )


def opencv_warm(scenes):
    """OpenCV's refinement; it writes into the guess, so the guess is copied."""
    problems = []
    for s in scenes:
        rvec, tvec = to_opencv(s.guess_position, s.guess_dcm)
        problems.append({"landmarks": s.landmarks, "pixels": s.pixels, "rvec": rvec, "tvec": tvec})
    namespace = {"refine": cv2.solvePnPRefineLM, "K": INTRINSICS, "criteria": CRITERIA}
    body = "refine(landmarks, pixels, K, None, rvec.copy(), tvec.copy(), criteria)"
    read = lambda r: from_opencv(r[0], r[1])  # noqa: E731
    return _contender(
        "OpenCV solvePnPRefineLM", body, problems, namespace, read, note="pixels, no covariance"
    )


def _residuals(x, landmarks, los, weight):
    return weight * (predict_los(landmarks, x[:3], x[3:]) - los).ravel()


def _jacobian(x, landmarks, los, weight):
    return weight * los_jacobian(landmarks, x[:3], x[3:]).reshape(-1, 6)


def scipy_warm(scenes):
    """MINPACK's Levenberg-Marquardt with the analytic Jacobian."""
    problems = [{"landmarks": s.landmarks, "los": s.los, "guess": s.guess} for s in scenes]
    body = (
        "solve(residuals, guess, jacobian, method='lm', x_scale='jac', ftol=1e-12, xtol=1e-12, gtol=1e-12,"
        " args=(landmarks, los, 1 / SIGMA)).x"
    )
    namespace = {"solve": least_squares, "residuals": _residuals, "jacobian": _jacobian, "SIGMA": SIGMA}
    read = lambda x: (x[:3], dcm_from_mrp(x[3:]))  # noqa: E731
    return _contender("SciPy least_squares lm", body, problems, namespace, read, note="no covariance")


def oracle_warm(scenes):
    """The NumPy oracle of the tests."""
    problems = [
        {
            "landmarks": s.landmarks,
            "los": s.los,
            "weights": np.broadcast_to(np.eye(3) / SIGMA**2, (len(s.los), 3, 3)),
            "position": s.guess_position,
            "dcm": s.guess_dcm,
        }
        for s in scenes
    ]
    body = "minimise(landmarks, los, weights, position, dcm)"
    read = lambda fit: (fit.position, fit.dcm)  # noqa: E731
    return _contender(
        "NumPy oracle", body, problems, {"minimise": oracle.minimise}, read, note="runs to rounding"
    )


def opencv_free(scenes, flag):
    """One of OpenCV's closed or global solvers."""
    problems = [{"landmarks": s.landmarks, "pixels": s.pixels} for s in scenes]
    namespace = {"solve": cv2.solvePnP, "K": INTRINSICS, "flag": getattr(cv2, f"SOLVEPNP_{flag}")}
    read = lambda r: from_opencv(r[1], r[2]) if r[0] else (None, None)  # noqa: E731
    body = "solve(landmarks, pixels, K, None, flags=flag)"
    return _contender(
        f"OpenCV solvePnP {flag}", body, problems, namespace, read, note="pixels, no refinement"
    )


def poselib_p3p(scenes):
    """PoseLib's P3P: all solutions, not ranked; the one nearest to the truth counts."""
    problems = [{"los": s.los, "landmarks": s.landmarks} for s in scenes]
    contender = _contender(
        "PoseLib p3p",
        "p3p(los, landmarks)",
        problems,
        {"p3p": poselib.p3p},
        list,
        note="all solutions, no covariance",
    )
    contender.answers = [[from_poselib(pose) for pose in found] for found in contender.answers]
    _nearest(contender, scenes)
    return contender


def _nearest(contender, scenes):
    """Of several answers keeps the nearest to the truth: three directions fit up to four poses."""
    for k, (poses, s) in enumerate(zip(contender.answers, scenes, strict=True)):
        distance = [np.linalg.norm(p - s.position) for p, _ in poses]
        contender.answers[k] = poses[int(np.argmin(distance))] if poses else (None, None)


def poselib_estimate(scenes, *, gate):
    """PoseLib's LO-RANSAC with refinement of the inliers."""
    problems = [{"pixels": s.pixels, "landmarks": s.landmarks} for s in scenes]
    namespace = {
        "estimate": poselib.estimate_absolute_pose,
        "camera": CAMERA,
        "ransac": {"max_reproj_error": gate, "max_error": gate, "success_prob": 0.9999},
        "options": TIGHT,
    }
    body = "estimate(pixels, landmarks, camera, ransac, options)"
    read = lambda r: from_poselib(r[0])  # noqa: E731
    return _contender(
        "PoseLib estimate_absolute_pose", body, problems, namespace, read, note="pixels, no covariance"
    )


def opencv_ransac(scenes, *, gate):
    """OpenCV's RANSAC, SQPNP on the inliers."""
    problems = [{"landmarks": s.landmarks, "pixels": s.pixels} for s in scenes]
    namespace = {"solve": cv2.solvePnPRansac, "K": INTRINSICS, "gate": gate, "flag": cv2.SOLVEPNP_SQPNP}
    body = (
        "solve(landmarks, pixels, K, None, iterationsCount=1000, reprojectionError=gate, confidence=0.9999,"
        " flags=flag)"
    )
    read = lambda r: from_opencv(r[1], r[2]) if r[0] else (None, None)  # noqa: E731
    return _contender("OpenCV solvePnPRansac", body, problems, namespace, read, note="pixels, no covariance")


def optimum(scene):
    """Best pose in directions of the inliers, from the truth, by the oracle."""
    keep = scene.inliers
    weights = np.broadcast_to(np.eye(3) / SIGMA**2, (int(keep.sum()), 3, 3))
    fit = oracle.minimise(scene.landmarks[keep], scene.los[keep], weights, scene.position, scene.dcm)
    return fit.position, dcm_from_mrp(mrp_from_dcm(fit.dcm))
