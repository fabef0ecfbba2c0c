"""Every public function with one good set of arguments, for tests that go through all doors."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import losnav as ln
from tests.oracle import attitude, los

# Whole numbers, so that the same scene can be handed over as integers.
LANDMARKS = np.array([[30.0, 1, 2], [-2, 31, 0], [-29, 3, -4], [5, -33, 7], [12, 9, -10], [-14, -8, 11]])
POSITION = np.array([-6.0, 8, 120])
MRP = np.array([0.125, -0.25, 0.0625])
DCM = attitude.dcm_from_mrp(MRP)
QUATERNION = attitude.quaternion_from_mrp(MRP)
LOS = los.predict_los(LANDMARKS, POSITION, MRP)
SIGMA = np.array([1.0, 2, 1, 3, 1, 2]) * 2.0**-14
COVARIANCE = SIGMA[:, None, None] ** 2 * (np.eye(3) + 0.25 * np.ones((3, 3)))
STATE = np.array([120.0, -3, 45, 0.125, -0.25, 0.5])
CONTROL = np.array([0.0078125, 0, -0.015625])
RANGES = np.linalg.norm(LANDMARKS - POSITION, axis=1)
MAP = np.broadcast_to(np.diag([0.25, 1, 4]), COVARIANCE.shape).copy()
ORBIT = ln.dynamics.ClohessyWiltshire(2.0**-10, 2.0**-20)
PLANET = ln.dynamics.TwoBody(2.0**48, 2.0**-20, j2=2.0**-10, radius=2.0**22)
AROUND = np.array([2.0**23, 2.0**21, -(2.0**22), 1024.0, 5120, 512])
SENSOR = ln.sensors.LineOfSight(LANDMARKS, 2.0**-12)
NEIGHBOUR = ln.dynamics.RelativeTwoBody(2.0**48, AROUND, 0.0, 2.0**-20)
TARGET = LANDMARKS[2]
CAMERA = ln.sensors.RangeBearing(0.25, 2.0**-10)
LASER, DOPPLER = ln.sensors.Range(0.25), ln.sensors.RangeRate(2.0**-7)
SUN = ln.sensors.SunDirection(2.0**-14, aberration=True)
EYE = ln.sensors.LandmarkCamera(
    LANDMARKS, 512.0, 1.0, COVARIANCE * 2.0**24, image_size=(512, 512), lever_arm=[0.25, -0.5, 0.125]
)
# The camera, the attitude that looks down: landmarks in front.
LOOKING = {"state": np.array([-6.0, 8, 120, 1, 2, -3]), "dcm": np.diag([1.0, -1, -1])}
BEAMS = ln.sensors.Velocimeter(2.0**-6, [[0.6, 0, 0.8], [0, 0.6, 0.8], [0, 0, 1], [0, -0.6, 0.8]])
LASER_ALTIMETER = ln.sensors.Altimeter(0.5, boresight=[0.6, 0, 0.8])
VECTOR = np.array([1.0, -2, 2])
EPOCHS = np.array([0.0, 4096.0, 8192.0, 12288.0])
MOON = ln.Ephemeris(EPOCHS, EPOCHS[:, None] * VECTOR + [2.0**28, 0.0, 2.0**26], np.tile(VECTOR, (4, 1)))
PULLED = ln.dynamics.TwoBody(2.0**48, 2.0**-20, third_bodies=[ln.dynamics.ThirdBody(2.0**42, MOON)])
PLANET_SEEN = ln.sensors.BodyDirection(MOON, 2.0**-14)
BODY = LOS @ np.eye(3)
REFERENCE = BODY @ DCM
GUESS = np.concatenate([POSITION + np.array([1, -1, 2]), MRP + 0.015625])


MOUNTINGS = np.stack([np.eye(3), np.eye(3)[[1, 2, 0]], attitude.dcm_from_mrp(-MRP)])
HEAD_COVARIANCES = np.stack([np.diag([1.0, 2, 32]), np.eye(3) + 0.25, np.diag([4.0, 4, 64])]) * 2.0**-30


@dataclass(frozen=True)
class Call:
    """A function, its array arguments (name, value, number of core axes), and its options."""

    function: object
    arrays: dict[str, np.ndarray]
    options: dict[str, object]

    def __call__(self, **changes):
        return self.function(**{**self.arrays, **changes}, **self.options)


def star_tracker_calls():
    """Those of losnav.star_tracker."""
    st = ln.star_tracker
    heads = [st.Head(m, noise=2.0**-15) for m in MOUNTINGS]
    both = {"covariances": HEAD_COVARIANCES, "mountings": MOUNTINGS}
    stars = np.stack([LOS[:4], LOS[1:5], LOS[2:]])
    places = {"ra": np.array([0.25, 3.0]), "dec": np.array([-0.5, 1.0])}
    spread = np.stack([np.eye(2), np.diag([1.0, 2])]) * 2.0**-30
    velocity = np.array([12_000.0, -25_000, 8_000])
    found = {
        "star_information": Call(st.star_information, {"body_vectors": LOS, "sigma": SIGMA}, {}),
        "fused_information": Call(
            st.fused_information, {"informations": HEAD_COVARIANCES, "mountings": MOUNTINGS}, {}
        ),
        "fused_covariance": Call(st.fused_covariance, both, {}),
        "mounting_sensitivity": Call(st.mounting_sensitivity, both, {}),
        "mounting_bias": Call(st.mounting_bias, {**both, "errors": 2.0**-15 * np.eye(3)}, {}),
        "consider_covariance": Call(
            st.consider_covariance, {**both, "mounting_covariances": HEAD_COVARIANCES}, {}
        ),
        "half_width": Call(st.half_width, {"covariance": HEAD_COVARIANCES[1], "direction": VECTOR}, {}),
        "intercept": Call(st.intercept, {"covariance": HEAD_COVARIANCES[1], "direction": VECTOR}, {}),
        "intersection_intercept": Call(st.intersection_intercept, {**both, "direction": VECTOR}, {}),
        "sandwich_ratio": Call(st.sandwich_ratio, {**both, "direction": VECTOR}, {}),
        "aberrate": Call(st.aberrate, {"directions": LOS, "velocity": velocity}, {}),
        "remove_aberration": Call(st.remove_aberration, {"directions": LOS, "velocity": velocity}, {}),
        "catalogue_directions": Call(st.catalogue_directions, places, {"dt": 2.0**30, "pmra": 2.0**-40}),
        "catalogue_covariance": Call(st.catalogue_covariance, {**places, "covariance": spread}, {}),
        "select_stars": Call(st.select_stars, {"body_vectors": LOS, "sigma": SIGMA}, {"count": 3}),
        "fuse": Call(
            st.fuse,
            {"body_vectors": stars, "catalogue_vectors": stars @ MOUNTINGS.transpose(0, 2, 1)},
            {"heads": heads},
        ),
        "fuse_attitudes": Call(
            st.fuse_attitudes,
            {"attitudes": MOUNTINGS.transpose(0, 2, 1), "covariances": HEAD_COVARIANCES},
            {"heads": heads},
        ),
    }
    return {f"star_tracker.{name}": call for name, call in found.items()}


def landing_calls():
    """Those of losnav.gravity, NavState and Strapdown."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * 1024.0
    squares = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    cube = ln.gravity.Polyhedron(
        corners, [t for a, b, c, d in squares for t in ([a, b, c], [a, c, d])], 2048.0
    )
    series = ln.gravity.eros.five_terms(brillouin_radius=0.0)
    site = ln.dynamics.Site.on_body(0.5, 0.25, 16384.0, 2.0**-11)
    model = ln.dynamics.Strapdown(
        site, series, ln.dynamics.Imu.navigation(), acceleration=ln.dynamics.GaussMarkov(2.0**-10, 256.0)
    )
    state = ln.NavState([64.0, -32, 120], [1.0, -2, -4], QUATERNION)
    place, sample = {"r": np.array([15000.0, -7000, 3000])}, np.array([0.25, -0.5, 1, 0.125, -0.25, 0.5]) / 64
    error = np.arange(1.0, 19) / 64

    def build(position, velocity, quaternion):
        return ln.NavState(position, velocity, quaternion)._numbers()

    def inject(delta):
        return state.inject(delta)._numbers()

    def propagate(control):
        return model.propagate(state, 0.125, control)._numbers()

    whole = {"position": state.position, "velocity": state.velocity, "quaternion": QUATERNION}
    return {
        "PointMass.acceleration": Call(ln.gravity.PointMass(2.0**19).acceleration, place, {}),
        "Uniform.potential": Call(ln.gravity.Uniform([1.0, 2, -8]).potential, place, {}),
        "Harmonics.gradient": Call(series.gradient, place, {}),
        "Polyhedron.potential": Call(cube.potential, place, {}),
        "Polyhedron.gradient": Call(cube.gradient, place, {}),
        "Polyhedron.contains": Call(cube.contains, place, {}),
        "Site.to_fixed": Call(site.to_fixed, {"position": state.position}, {}),
        "NavState": Call(build, whole, {}),
        "NavState.inject": Call(inject, {"delta": error}, {}),
        "Strapdown.propagate": Call(propagate, {"control": sample}, {}),
        "Strapdown.transition": Call(model.transition, {"control": sample}, {"state": state, "dt": 0.125}),
        "Strapdown.process_noise": Call(
            model.process_noise, {"control": sample}, {"state": state, "dt": 0.125}
        ),
    }


CALLS = {
    "dcm_from_mrp": Call(ln.attitude.dcm_from_mrp, {"mrp": MRP}, {}),
    "mrp_from_dcm": Call(ln.attitude.mrp_from_dcm, {"dcm": DCM}, {}),
    "dcm_from_quaternion": Call(ln.attitude.dcm_from_quaternion, {"q": QUATERNION}, {}),
    "quaternion_from_dcm": Call(ln.attitude.quaternion_from_dcm, {"dcm": DCM}, {}),
    "mrp_from_quaternion": Call(ln.attitude.mrp_from_quaternion, {"q": QUATERNION}, {}),
    "quaternion_from_mrp": Call(ln.attitude.quaternion_from_mrp, {"mrp": MRP}, {}),
    "mrp_shadow": Call(ln.attitude.mrp_shadow, {"mrp": MRP}, {}),
    "rotation_error": Call(ln.attitude.rotation_error, {"dcm_true": DCM, "dcm_estimate": np.eye(3)}, {}),
    "predict_los": Call(ln.predict_los, {"landmarks": LANDMARKS, "position": POSITION, "mrp": MRP}, {}),
    "los_jacobian": Call(ln.los_jacobian, {"landmarks": LANDMARKS, "position": POSITION, "mrp": MRP}, {}),
    "fisher_information": Call(
        ln.fisher_information,
        {"landmarks": LANDMARKS, "position": POSITION, "mrp": MRP, "sigma": SIGMA},
        {},
    ),
    "pose_observability": Call(
        getattr(ln, "pose_observability", None), {"landmarks": LANDMARKS, "position": POSITION}, {}
    ),
    "noise.isotropic": Call(ln.noise.isotropic, {"sigma": SIGMA}, {}),
    "noise.tangent": Call(ln.noise.tangent, {"los": LOS, "sigma": SIGMA}, {}),
    "noise.focal_plane": Call(ln.noise.focal_plane, {"los": LOS, "sigma_focal": SIGMA}, {}),
    "noise.landmark_uncertainty": Call(
        ln.noise.landmark_uncertainty,
        {"los_body": LOS, "ranges": RANGES, "dcm": DCM, "landmark_covariance": MAP},
        {},
    ),
    "ClohessyWiltshire.propagate": Call(ORBIT.propagate, {"state": STATE, "control": CONTROL}, {"dt": 60.0}),
    "ClohessyWiltshire.transition": Call(ORBIT.transition, {"state": STATE}, {"dt": 60.0}),
    "ClohessyWiltshire.process_noise": Call(ORBIT.process_noise, {"state": STATE}, {"dt": 60.0}),
    "TwoBody.propagate": Call(PLANET.propagate, {"state": AROUND, "control": CONTROL}, {"dt": 60.0}),
    "TwoBody.transition": Call(PLANET.transition, {"state": AROUND}, {"dt": 60.0, "time": 5.0}),
    "RelativeTwoBody.propagate": Call(
        NEIGHBOUR.propagate, {"state": STATE, "control": CONTROL}, {"dt": 60.0, "time": 5.0}
    ),
    "orbits.relative_state": Call(ln.orbits.relative_state, {"chaser": AROUND + STATE, "target": AROUND}, {}),
    "orbits.target_state": Call(ln.orbits.target_state, {"relative": STATE, "chaser": AROUND}, {}),
    "orbits.lvlh_rate": Call(ln.orbits.lvlh_rate, {"position": STATE[:3], "velocity": LANDMARKS[3]}, {}),
    "orbits.curvilinear_from_lvlh": Call(
        ln.orbits.curvilinear_from_lvlh, {"relative": STATE}, {"radius": 2.0**23}
    ),
    "LineOfSight.predict": Call(SENSOR.predict, {"state": STATE, "dcm": DCM}, {}),
    "LineOfSight.jacobian": Call(SENSOR.jacobian, {"state": STATE, "dcm": DCM}, {}),
    "RangeBearing.predict": Call(CAMERA.predict, {"state": STATE, "dcm": DCM, "target": TARGET}, {}),
    "RangeBearing.jacobian": Call(CAMERA.jacobian, {"state": STATE, "dcm": DCM}, {}),
    "Range.predict": Call(LASER.predict, {"state": STATE, "target": TARGET}, {}),
    "RangeRate.jacobian": Call(DOPPLER.jacobian, {"state": STATE}, {}),
    "TwoBody.propagate among bodies": Call(
        PULLED.propagate, {"state": AROUND, "control": CONTROL}, {"dt": 64.0, "time": 64.0}
    ),
    "BodyDirection.predict": Call(PLANET_SEEN.predict, {"state": AROUND, "dcm": DCM}, {"time": 64.0}),
    "BodyDirection.jacobian": Call(PLANET_SEEN.jacobian, {"state": AROUND}, {"time": 64.0}),
    "SunDirection.predict": Call(SUN.predict, {"state": AROUND, "dcm": DCM}, {}),
    "SunDirection.jacobian": Call(SUN.jacobian, {"state": AROUND}, {}),
    "LandmarkCamera.predict": Call(
        ln.sensors.LandmarkCamera(LANDMARKS, 512.0, 1.0).predict, {**LOOKING, "landmarks": LANDMARKS}, {}
    ),
    "LandmarkCamera.jacobian": Call(EYE.jacobian, LOOKING, {}),
    "LandmarkCamera.noise": Call(EYE.noise, LOOKING, {}),
    "LandmarkCamera.visible": Call(EYE.visible, LOOKING, {}),
    "Velocimeter.predict": Call(BEAMS.predict, LOOKING, {}),
    "Velocimeter.jacobian": Call(BEAMS.jacobian, LOOKING, {}),
    "Altimeter.predict": Call(LASER_ALTIMETER.predict, LOOKING, {}),
    "Altimeter.jacobian": Call(LASER_ALTIMETER.jacobian, LOOKING, {}),
    "solve_pose": Call(
        ln.solve_pose, {"landmarks": LANDMARKS, "los": LOS, "sigma": SIGMA, "guess": GUESS}, {}
    ),
    "solve_pose guess-free": Call(ln.solve_pose, {"landmarks": LANDMARKS, "los": LOS, "sigma": SIGMA}, {}),
    "solve_pose covariance": Call(
        ln.solve_pose, {"landmarks": LANDMARKS, "los": LOS, "covariance": COVARIANCE, "guess": GUESS}, {}
    ),
    "solve_attitude": Call(ln.solve_attitude, {"body": BODY, "reference": REFERENCE, "sigma": SIGMA}, {}),
    "solve_attitude covariance": Call(
        ln.solve_attitude, {"body": BODY, "reference": REFERENCE, "covariance": COVARIANCE}, {}
    ),
    "solve_attitude_robust": Call(
        ln.solve_attitude_robust, {"body": BODY, "reference": REFERENCE, "sigma": SIGMA}, {"seed": 1}
    ),
    "solve_attitude unpolished": Call(
        ln.solve_attitude, {"body": BODY, "reference": REFERENCE, "sigma": SIGMA}, {"polish": False}
    ),
    "solve_attitude svd": Call(
        ln.solve_attitude, {"body": BODY, "reference": REFERENCE, "sigma": SIGMA}, {"method": "svd"}
    ),
    "solve_pose_robust": Call(
        getattr(ln, "solve_pose_robust", None),
        {"landmarks": LANDMARKS, "los": LOS, "sigma": SIGMA},
        {"seed": 1},
    ),
}
CALLS |= star_tracker_calls()
CALLS |= landing_calls()
# A function that is not there yet fails in test_contract.py, not here.
CALLS = {name: call for name, call in CALLS.items() if call.function}
DOORS = [(name, argument) for name, call in CALLS.items() for argument in call.arrays]

SOLUTION_FIELDS = (
    "position",
    "mrp",
    "dcm",
    "quaternion",
    "covariance",
    "cost",
    "chi2",
    "dof",
    "iterations",
    "converged",
)
ATTITUDE_FIELDS = (
    "dcm",
    "quaternion",
    "mrp",
    "covariance",
    "information",
    "loss",
    "chi2",
    "dof",
    "rank",
    "converged",
)


def numbers(result):
    """The numerical content of any result as a list of arrays."""
    if isinstance(result, np.ndarray | np.generic):
        return [np.asarray(result)]
    if hasattr(result, "free_axis"):
        return [np.asarray(getattr(result, field)) for field in ATTITUDE_FIELDS]
    if hasattr(result, "termination"):
        return [np.asarray(getattr(result, field)) for field in SOLUTION_FIELDS]
    return [np.asarray(result.rank), np.asarray(result.singular_values), np.asarray(result.degree)]


def same(a, b):
    """Bit for bit the same numbers (NaN equal to NaN)."""
    return all(np.array_equal(x, y, equal_nan=True) for x, y in zip(numbers(a), numbers(b), strict=True))
