"""Types of the private engine. Public names and their documentation live in the modules of losnav."""

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias, final

import numpy as np
import numpy.typing as npt

from losnav.observability import PoseObservability

__all__ = [
    "ISA",
    "ArcRecord",
    "AttitudeSolution",
    "Filter",
    "GravityField",
    "InertialFilter",
    "LieStudy",
    "PoseSolution",
    "Step",
    "StrapdownModel",
    "__version__",
    "attitude_solution",
    "dcm_from_mrp",
    "dcm_from_quaternion",
    "dynamics_process_noise",
    "dynamics_propagate",
    "dynamics_single",
    "dynamics_trajectory",
    "dynamics_transition",
    "fisher_information",
    "lie_inertial",
    "lie_matrix",
    "lie_path",
    "lie_view",
    "los_jacobian",
    "mrp_from_dcm",
    "mrp_from_quaternion",
    "mrp_shadow",
    "pose_geometry",
    "pose_singular",
    "predict_los",
    "quaternion_from_dcm",
    "quaternion_from_mrp",
    "rotation_error",
    "sensor_linearize",
    "sensor_single",
    "solve_attitude",
    "solve_attitude_robust",
    "solve_pose",
    "solve_pose_robust",
]

__version__: str
ISA: str
"""Instruction set the batch kernels were dispatched to."""

_Floats = npt.NDArray[np.float64]
_Integers = npt.NDArray[np.int64]
# Of a dynamics model: a list of a few numbers, or an array of many.
_Parameters: TypeAlias = Sequence[float] | _Floats

# attitude

def dcm_from_mrp(mrp: npt.ArrayLike, /) -> _Floats: ...
def dcm_from_quaternion(q: npt.ArrayLike, /) -> _Floats: ...
def mrp_from_dcm(dcm: npt.ArrayLike, /) -> _Floats: ...
def mrp_from_quaternion(q: npt.ArrayLike, /) -> _Floats: ...
def mrp_shadow(mrp: npt.ArrayLike, /) -> _Floats: ...
def quaternion_from_dcm(dcm: npt.ArrayLike, /) -> _Floats: ...
def quaternion_from_mrp(mrp: npt.ArrayLike, /) -> _Floats: ...
def rotation_error(dcm_true: npt.ArrayLike, dcm_estimate: npt.ArrayLike, /) -> _Floats: ...

# models

def dynamics_single(
    name: str,
    parameters: _Parameters,
    question: int,
    state: npt.ArrayLike,
    control: npt.ArrayLike | None,
    dt: npt.ArrayLike,
    time: npt.ArrayLike,
    /,
) -> _Floats | None: ...
def dynamics_propagate(
    name: str, parameters: _Parameters, state: _Floats, control: _Floats, dt: _Floats, time: _Floats, /
) -> _Floats: ...
def dynamics_transition(
    name: str, parameters: _Parameters, state: _Floats, control: _Floats, dt: _Floats, time: _Floats, /
) -> _Floats: ...
def dynamics_process_noise(
    name: str, parameters: _Parameters, state: _Floats, control: _Floats, dt: _Floats, time: _Floats, /
) -> _Floats: ...
def dynamics_trajectory(
    name: str, parameters: _Parameters, state: _Floats, control: _Floats, dt: _Floats, time: _Floats, /
) -> _Floats: ...
def sensor_single(
    name: str, parameters: tuple[_Floats, ...], state: npt.ArrayLike, dcm: npt.ArrayLike, /
) -> tuple[_Floats, _Floats] | None: ...
def sensor_linearize(
    name: str, parameters: tuple[_Floats, ...], position: _Floats, velocity: _Floats, dcm: _Floats, /
) -> tuple[_Floats, _Floats]: ...

@final
class GravityField:
    @staticmethod
    def point_mass(mu: float, /) -> GravityField: ...
    @staticmethod
    def uniform(acceleration: tuple[float, float, float], /) -> GravityField: ...
    @staticmethod
    def harmonics(mu: float, radius: float, coefficients: _Floats, /) -> GravityField: ...
    @staticmethod
    def polyhedron(density: float, faces: _Floats, edges: Sequence[Sequence[int]], /) -> GravityField: ...
    def potential(self, r: npt.ArrayLike, /) -> _Floats: ...
    def acceleration(self, r: npt.ArrayLike, /) -> _Floats: ...
    def gradient(self, r: npt.ArrayLike, /) -> _Floats: ...
    def laplacian(self, r: npt.ArrayLike, /) -> _Floats: ...
    def volume(self) -> float: ...

@final
class StrapdownModel:
    def __new__(cls, site: Sequence[float], gravity: Any, noise: Sequence[float], /) -> StrapdownModel: ...
    def propagate(self, state: _Floats, control: _Floats, dt: _Floats, /) -> _Floats: ...
    def linearize(self, n: int, noise: bool, state: _Floats, control: _Floats, dt: _Floats, /) -> _Floats: ...
    def trajectory(self, state: _Floats, control: _Floats, dt: _Floats, longest: float, /) -> _Floats: ...

# pose from lines of sight

def predict_los(landmarks: _Floats, position: _Floats, mrp: _Floats, /) -> _Floats: ...
def los_jacobian(landmarks: _Floats, position: _Floats, mrp: _Floats, /) -> _Floats: ...
def lie_matrix(
    name: str,
    parameters: Sequence[float],
    sensors: tuple[Any, ...],
    state: _Floats,
    control: _Floats,
    dcm: _Floats | None,
    time: _Floats,
    order: int,
    scale: _Floats,
    pace: _Floats,
    context: dict[str, Any],
    /,
) -> _Floats | None: ...

@final
class LieStudy:
    """A model, a sensor and units, read once."""

    @staticmethod
    def of(
        name: str, parameters: Sequence[float], sensor: Any, scale: Sequence[float], pace: float, /
    ) -> LieStudy | None: ...
    def matrix(self, state: npt.ArrayLike, order: int, /) -> _Floats | None: ...

def lie_inertial(
    model: StrapdownModel,
    sensors: tuple[Any, ...],
    state: _Floats,
    control: _Floats,
    time: _Floats,
    order: int,
    scale: _Floats,
    pace: _Floats,
    context: dict[str, Any],
    /,
) -> _Floats | None: ...
def lie_path(
    name: str,
    parameters: Sequence[float],
    state: _Floats,
    control: _Floats,
    time: _Floats,
    order: int,
    /,
) -> _Floats: ...
def lie_view(
    sensor: Any, series: _Floats, dcm: _Floats | None, context: dict[str, Any], /
) -> _Floats | None: ...
def fisher_information(
    landmarks: npt.ArrayLike,
    predicted: npt.ArrayLike,
    sigma: npt.ArrayLike,
    covariance: npt.ArrayLike | None,
    pose: npt.ArrayLike,
    /,
) -> _Floats: ...
def pose_singular(
    landmarks: npt.ArrayLike,
    predicted: _Floats,
    sigma: npt.ArrayLike,
    covariance: npt.ArrayLike | None,
    pose: _Floats,
    /,
) -> tuple[_Floats, _Floats]: ...
def pose_geometry(
    landmarks: _Floats, pose: _Floats, values: _Floats, vectors: _Floats, kept: _Floats | None, /
) -> tuple[_Integers, _Integers, _Floats]: ...
def solve_pose(
    landmarks: npt.ArrayLike,
    los: npt.ArrayLike,
    sigma: npt.ArrayLike,
    covariance: npt.ArrayLike | None,
    guess: npt.ArrayLike | None,
    method: str,
    parametrization: str,
    loss: str,
    loss_scale: float | None,
    damping: float,
    max_iterations: int,
    cost_tolerance: float,
    step_tolerance: float,
    on_error: str,
    /,
) -> PoseSolution: ...
def solve_pose_robust(
    landmarks: npt.ArrayLike,
    los: npt.ArrayLike,
    sigma: npt.ArrayLike,
    covariance: npt.ArrayLike | None,
    max_outlier_ratio: float,
    confidence: float,
    inlier_probability: float,
    seed: int,
    max_iterations: int,
    on_error: str,
    /,
) -> PoseSolution: ...

@final
class PoseSolution:
    """What a pose solve returns: every field has the shape of the batch."""

    @property
    def position(self) -> _Floats: ...
    @property
    def mrp(self) -> _Floats: ...
    @property
    def quaternion(self) -> _Floats: ...
    @property
    def dcm(self) -> _Floats: ...
    @property
    def covariance(self) -> _Floats: ...
    @property
    def cost(self) -> Any: ...
    @property
    def chi2(self) -> Any: ...
    @property
    def dof(self) -> Any: ...
    @property
    def iterations(self) -> Any: ...
    @property
    def termination(self) -> Any: ...
    @property
    def converged(self) -> Any: ...
    @property
    def alternatives(self) -> Any: ...
    @property
    def inliers(self) -> npt.NDArray[np.bool_] | None: ...
    @property
    def observability(self) -> PoseObservability: ...
    @property
    def _body_information(self) -> _Floats: ...
    @property
    def _landmarks(self) -> _Floats: ...
    def __reduce__(self) -> tuple[Callable[..., PoseSolution], tuple[Any, ...]]: ...
    @staticmethod
    def _restore(
        shape: Sequence[int],
        single: bool,
        records: _Floats,
        landmark_shape: Sequence[int],
        landmarks: _Floats,
        owners: Sequence[int],
        others: _Floats,
        inliers: Sequence[bool] | None,
    ) -> PoseSolution: ...

# attitude from vectors

def solve_attitude(
    body: npt.ArrayLike,
    reference: npt.ArrayLike,
    sigma: npt.ArrayLike,
    covariance: npt.ArrayLike | None,
    method: str,
    polish: bool,
    on_error: str,
    /,
) -> AttitudeSolution: ...
def solve_attitude_robust(
    body: npt.ArrayLike,
    reference: npt.ArrayLike,
    sigma: npt.ArrayLike,
    max_outlier_ratio: float,
    confidence: float,
    inlier_probability: float,
    seed: int,
    on_error: str,
    /,
) -> AttitudeSolution: ...
def attitude_solution(
    quaternion: _Floats, information: _Floats, chi2: _Floats, dof: _Floats, /
) -> AttitudeSolution: ...

@final
class AttitudeSolution:
    """What an attitude determination returns: every field has the shape of the batch."""

    @property
    def dcm(self) -> _Floats: ...
    @property
    def quaternion(self) -> _Floats: ...
    @property
    def mrp(self) -> _Floats: ...
    @property
    def covariance(self) -> _Floats: ...
    @property
    def information(self) -> _Floats: ...
    @property
    def loss(self) -> Any: ...
    @property
    def chi2(self) -> Any: ...
    @property
    def dof(self) -> Any: ...
    @property
    def rank(self) -> Any: ...
    @property
    def free_axis(self) -> _Floats: ...
    @property
    def converged(self) -> Any: ...
    @property
    def inliers(self) -> npt.NDArray[np.bool_] | None: ...
    def __reduce__(self) -> tuple[Callable[..., AttitudeSolution], tuple[Any, ...]]: ...
    @staticmethod
    def _restore(
        shape: Sequence[int], single: bool, records: _Floats, inliers: Sequence[bool] | None
    ) -> AttitudeSolution: ...

@final
class Filter:
    """The estimate of a filter and what moves it."""

    time: float
    def __new__(
        cls,
        name: str | None,
        parameters: _Parameters,
        size: int,
        form: str,
        iterations: int,
        underweighting: float,
        consider: Sequence[int],
        gate: Callable[[int], float] | None,
        relock_after: float,
        /,
    ) -> Filter: ...
    def set(self, states: _Floats, matrices: _Floats, stored: bool) -> None: ...
    def state(self) -> _Floats: ...
    def covariance(self) -> _Floats: ...
    def stored(self) -> _Floats: ...
    def rejections(self) -> list[tuple[Any, float]]: ...
    def set_rejections(self, counts: list[tuple[Any, float]]) -> None: ...
    def predict(self, dt: float, control: npt.ArrayLike | None, /) -> None: ...
    def step(
        self,
        dt: float | None,
        sensor: Any,
        z: npt.ArrayLike,
        control: npt.ArrayLike | None,
        context: dict[str, Any],
        /,
    ) -> Step | None: ...
    def run(
        self,
        times: npt.ArrayLike,
        measurements: Sequence[tuple[Any, npt.ArrayLike]],
        controls: npt.ArrayLike | None,
        context: dict[str, Any],
        /,
    ) -> ArcRecord | None: ...
    def predict_given(self, dt: float, state: _Floats, transition: _Floats, noise: _Floats) -> bool: ...
    def attempt(self, innovation: _Floats, jacobian: _Floats, offset: _Floats) -> tuple[_Floats, float]: ...
    def commit(self) -> bool: ...
    def bound_for(self, sensor: Any, dof: int) -> float: ...
    def count(self, sensor: Any, accepted: bool) -> None: ...

@final
class InertialFilter:
    """The estimate of a filter on inertial navigation and what moves it."""

    time: float
    def __new__(
        cls,
        site: Sequence[float],
        gravity: Any,
        noise: Sequence[float],
        size: int,
        form: str,
        iterations: int,
        underweighting: float,
        consider: Sequence[int],
        bounds: Sequence[float] | None,
        relock_after: float,
        predictive: tuple[float, bool, bool] | None,
        adaptive: tuple[float, float, float] | None,
        /,
    ) -> InertialFilter: ...
    def set(self, states: _Floats, matrices: _Floats, stored: bool) -> None: ...
    def state(self) -> _Floats: ...
    def covariance(self) -> _Floats: ...
    def stored(self) -> _Floats: ...
    def joint_covariance(self) -> _Floats: ...
    def beside(self, index: int) -> Any: ...
    def set_beside(self, index: int, beside: Any) -> None: ...
    def rejections(self) -> list[tuple[Any, float]]: ...
    def set_rejections(self, counts: list[tuple[Any, float]]) -> None: ...
    def remember(self) -> int: ...
    def forget(self, key: int) -> bool: ...
    def poses(self) -> list[tuple[int, list[float]]]: ...
    def landmarks(self, sensor: Any) -> list[tuple[int, list[float]]]: ...
    def model_error(self) -> _Floats: ...
    def step(
        self,
        dt: float | None,
        measurements: Sequence[tuple[Any, npt.ArrayLike]],
        control: Any,
        context: dict[str, Any],
        key: int | None,
        /,
    ) -> list[Step] | None: ...
    def take(self, innovation: _Floats, jacobian: _Floats, bound: float) -> tuple[float, bool]: ...
    def rejected(self, sensor: Any) -> float: ...
    def run(
        self,
        times: npt.ArrayLike,
        measurements: Sequence[tuple[Any, npt.ArrayLike, float]],
        controls: npt.ArrayLike | None,
        substeps: int,
        context: dict[str, Any],
        /,
    ) -> dict[str, Any] | None: ...

@final
class Step:
    """What one update of a filter did."""

    def __new__(
        cls,
        sensor: Any,
        context: dict[str, Any],
        state: Any,
        covariance: npt.ArrayLike,
        innovation: npt.ArrayLike,
        nis: float,
        dof: int,
        accepted: bool,
        underweighting: float,
        consider: Sequence[int],
        used: Sequence[bool] | None = None,
        /,
    ) -> Step: ...
    @property
    def used(self) -> npt.NDArray[np.bool_]: ...
    @property
    def innovation(self) -> _Floats: ...
    @property
    def innovation_covariance(self) -> _Floats: ...
    @property
    def gain(self) -> _Floats: ...
    @property
    def nis(self) -> float: ...
    @property
    def dof(self) -> int: ...
    @property
    def accepted(self) -> bool: ...
    @property
    def prior_state(self) -> _Floats: ...
    @property
    def prior_covariance(self) -> _Floats: ...
    def __reduce__(self) -> tuple[type[Step], tuple[Any, ...]]: ...

@final
class ArcRecord:
    """What whole arcs of a filter left behind."""

    @property
    def rows(self) -> list[int]: ...
    @property
    def dof(self) -> list[int]: ...
    def state(self) -> _Floats: ...
    def covariance(self) -> _Floats: ...
    def nis(self) -> _Floats: ...
    def accepted(self) -> npt.NDArray[np.bool_]: ...
    def innovation(self) -> _Floats: ...
    def smooth(self) -> ArcRecord: ...
