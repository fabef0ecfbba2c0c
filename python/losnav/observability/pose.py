"""How well lines of sight determine a pose, and what is weak: section 7 of the model, in words."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from losnav import _core
from losnav._arrays import ArrayLike, FloatArray, broadcast, vectors
from losnav.errors import InvalidInputError
from losnav.observability.matrix import IntArray, Observability, plain, ratio
from losnav.pose import predict_los

if TYPE_CHECKING:
    from losnav._core import PoseSolution

LABELS = ("position x", "position y", "position z", "attitude x", "attitude y", "attitude z")
# Cosine beyond which a direction is called by the name of its axis, and below which a shift is lateral.
NEARLY_PARALLEL = 0.97
NEARLY_PERPENDICULAR = 0.25
# Length of the mean direction below which the landmarks are all around, and no shift is lateral.
NARROW_VIEW = 0.7
# Noise this close to 1 rad is the default, not a noise: what rounding leaves of a one.
UNIT_NOISE = 1e-9
# Farthest over nearest landmark: beyond this the squares of the singular values no longer stand side by side.
RANGE_RATIO = 1e60
# Singular values that an information matrix in double precision still tells from zero: eight times the root
# of the rounding unit, which is about the rank tolerance.
RESOLVED = 8.0 * float(np.finfo(np.float64).eps) ** 0.5
# A part of a motion below this share of the other is rounding.
ROUNDING_SHARE = 1e-6


class Diagnosis(str, Enum):
    """The geometry of camera and landmarks, by its name."""

    GENERIC = "generic"
    ONE_LANDMARK = "one landmark"
    TWO_LANDMARKS = "two landmarks"
    CAMERA_ON_LANDMARK_LINE = "camera on the line of the landmarks"
    COLLINEAR_LANDMARKS = "collinear landmarks"
    DANGER_CYLINDER = "danger cylinder"
    CONCYCLIC_CAMERA = "camera and landmarks on one circle"
    LINE_AND_CIRCLE = "landmarks on a line and on a circle with the camera"
    DANGER_CYLINDERS_MEET = "all danger cylinders meet here"
    TWISTED_CUBIC = "twisted cubic"
    DISTANT_LANDMARKS = "distant landmarks"
    UNNAMED = "unnamed"
    INVALID = "invalid problem"

    def __str__(self) -> str:
        return self.value


_DIAGNOSES = np.array(list(Diagnosis), dtype=object)
_INVALID = len(Diagnosis) - 1

_SENTENCES = {
    Diagnosis.GENERIC: "the pose is determined",
    Diagnosis.ONE_LANDMARK: "one landmark shows only its own direction; where the camera is on any sphere "
    "around it, how far, and the turn about the line of sight are free",
    Diagnosis.TWO_LANDMARKS: "two landmarks leave two motions free; what they fix by themselves is the "
    "attitude about {axis} and the position along {second}",
    Diagnosis.CAMERA_ON_LANDMARK_LINE: "camera and landmarks are on one line along {axis}; the way along it "
    "and the turn about it are free",
    Diagnosis.COLLINEAR_LANDMARKS: "the landmarks are on one line along {axis}; swinging about it is free",
    Diagnosis.DANGER_CYLINDER: "the camera is on the danger cylinder of the three landmarks "
    "(radius {number:.4g} m, axis {axis})",
    Diagnosis.CONCYCLIC_CAMERA: "camera and landmarks are on one circle "
    "(radius {number:.4g} m, normal {axis})",
    Diagnosis.LINE_AND_CIRCLE: "{count:.0f} landmarks are on a line along {axis}, the others with the camera "
    "on a circle (radius {number:.4g} m) that this line pierces opposite to the camera",
    Diagnosis.DANGER_CYLINDERS_MEET: "the camera is where the danger cylinders of the four landmarks meet",
    Diagnosis.TWISTED_CUBIC: "camera and landmarks are on one twisted cubic "
    "(horopter curve on a cylinder of radius {number:.4g} m, axis {axis})",
    Diagnosis.DISTANT_LANDMARKS: "the landmarks are too far away to be told apart "
    "(they fill {number:.2g} rad)",
    Diagnosis.UNNAMED: "no geometry with a name; are the noises of the landmarks decades apart?",
    Diagnosis.INVALID: "the problem was invalid",
}


@dataclass(frozen=True, eq=False, repr=False)
class PoseObservability(Observability):
    """How well lines of sight determine a pose ``[dp, dalpha]``, and what is weak. ``print`` it.

    Position in the reference frame (m), attitude in body axes (rad). Rank is decided on the whitened
    Jacobian with its position columns times the mean range, at 1e-7 of the largest singular value.
    Indexing takes problems out of a batch.

    Attributes
    ----------
    rank, singular_values, degree, directions, labels, scale
        As for :class:`Observability`: the geometry, whatever the size of the noise. ``noise`` over a singular
        value is one standard deviation of its direction, positions counted in mean ranges.
    noise : float or (...)
        1-sigma noise of a direction, rad (of the mean information where they differ); 1 if none was given.
    danger_cylinder_distance : float or (...)
        Distance of the camera from the danger cylinder of three landmarks, m: on it the pose is lost to first
        order, near it sigma grows as one over the distance. For more landmarks the largest over the triples
        (beyond 12 landmarks, of 12 spread over the list): rank can be lost only where it is zero. NaN without
        three landmarks off a line.
    diagnosis : Diagnosis, or an object array of them
        The geometry by its name.
    null_twist : (..., 6)
        Twist ``[w, v]`` in reference axes with ``w x L + v`` parallel to ``L - p`` for every landmark: a
        motion that no line of sight notices; ``w`` a unit vector (``v`` if nothing turns). NaN at full rank.
    body_axes : bool
        Whether an attitude was given: attitude directions are in body axes, not in reference axes.
    """

    noise: float | FloatArray
    danger_cylinder_distance: float | FloatArray
    diagnosis: Any
    null_twist: FloatArray
    body_axes: bool
    # Mean direction to the landmarks, two axes and a number of the diagnosis, number of landmarks.
    _numbers: FloatArray

    @property
    def weakest_sigma(self) -> FloatArray:
        """The weakest direction one standard deviation long, ``(..., 6)``, m and rad; inf if unobservable."""
        last = np.where(np.array(self.rank) == 6, self.singular_values[..., -1], 0.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            size = np.array(self.noise / last)[..., np.newaxis]
            return np.where(self.weakest == 0.0, 0.0, self.weakest * size)

    @property
    def explanation(self) -> Any:
        """The diagnosis as a sentence with its numbers; an object array of them for a batch."""
        return self._each("_explanation")

    @property
    def weakest_in_words(self) -> Any:
        """The weakest direction as a sentence; an object array of them for a batch."""
        return self._each("_weakest_in_words")

    def _each(self, method: str) -> Any:
        if not self.shape:
            return getattr(self, method)()
        texts = np.empty(self.shape, dtype=object)
        for index in np.ndindex(self.shape):
            texts[index] = getattr(self[index], method)()
        return texts

    def _explanation(self) -> str:
        # An axis has no sense: the one that leads along a positive axis is easier to read.
        axes, number = self._numbers[3:9].reshape(2, 3), self._numbers[9]
        axis, second = (_axis(_forward(np.append(a, a))[:3]) for a in axes)
        return _SENTENCES[self.diagnosis].format(axis=axis, second=second, number=number, count=axes[1, 0])

    def _weakest_in_words(self) -> str:
        if self.diagnosis is Diagnosis.INVALID:
            return "unknown"
        direction = _forward(self.weakest)
        shift, turn = direction[:3], direction[3:]
        shares = np.linalg.norm((direction / self.scale).reshape(2, 3), axis=1)
        shifts, turns = (shares > ROUNDING_SHARE * shares[::-1]).tolist()
        parts = [f"position along {_axis(shift)}{_aspect(shift, self._numbers[:3])}"] * shifts
        parts += [f"rotation about {'body ' if self.body_axes else ''}{_axis(turn)}"] * turns
        motion = " together with ".join(parts)
        metres, degrees = float(np.linalg.norm(shift)), float(np.degrees(np.linalg.norm(turn)))
        if int(self.rank) < 6:
            return f"{motion}, {degrees / metres:.3g} deg for each metre" if shifts and turns else motion
        # One standard deviation; of a noise of 1 mrad if none was given.
        noise = float(self.noise)
        given = abs(noise - 1.0) > UNIT_NOISE
        size = (noise if given else 1e-3) / float(self.singular_values[-1])
        amounts = [f"{metres * size:.3g} m"] * shifts + [f"{degrees * size:.3g} deg"] * turns
        return f"{motion}: {' and '.join(amounts)}, 1 sigma{'' if given else ' at 1 mrad of noise'}"

    def _lines(self) -> list[str]:
        if int(self.rank) < 6:
            lines = [f"rank {self.rank} of 6 ({self.diagnosis}): {self._explanation()}"]
            if self.rank == 5:
                lines.append(f"unobservable: {self._weakest_in_words()}")
            return lines
        lines = [f"rank 6 of 6: {self._explanation()}", f"weakest: {self._weakest_in_words()}"]
        lines.append(f"degree {self.degree:.3g} (smallest over largest singular value)")
        if np.isfinite(self.danger_cylinder_distance):
            triples = "" if self._numbers[10] == 3 else " (the farthest of the triples)"
            lines.append(f"danger cylinder {self.danger_cylinder_distance:.3g} m away{triples}")
        return lines


def pose_observability(
    landmarks: ArrayLike,
    position: ArrayLike,
    mrp: ArrayLike | None = None,
    sigma: ArrayLike = 1.0,
    *,
    covariance: ArrayLike | None = None,
) -> PoseObservability:
    """How well lines of sight to these landmarks determine the pose, what is weak, and why (section 7).

    Rank and singular values do not depend on the attitude. Degenerate geometry is an answer here, not an
    error: one or two landmarks, landmarks on a line, a camera on the danger cylinder or on one twisted cubic
    with its landmarks. Leading dimensions broadcast.

    Parameters
    ----------
    landmarks : (N, 3) or (..., N, 3)
        One or more distinct landmarks in the reference frame, m.
    position : (..., 3)
        Observer in the reference frame, m.
    mrp : (..., 3), optional
        Attitude; it only says in which axes attitude is named. Without it these are the reference axes.
    sigma : scalar, (N,) or (..., N)
        1-sigma noise of each direction, rad per axis. With the default, 1-sigma values are per radian of
        noise.
    covariance : (..., N, 3, 3), optional
        Covariance of each direction in body axes, rad^2, instead of ``sigma``.

    Returns
    -------
    PoseObservability
        ``print`` it.

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN or infinity, two landmarks in one place, an observer on a landmark.

    Examples
    --------
    >>> import losnav as ln
    >>> landmarks = [[32.5, 0, 0], [0, 30, 0], [-31.5, 0, 0], [0, -30.5, 0]]
    >>> print(ln.pose_observability(landmarks, [-50, 50, 500], sigma=2e-5))
    rank 6 of 6: the pose is determined
    weakest: position along y (lateral) together with rotation about -x: 1.08 m and 0.123 deg, 1 sigma
    degree 0.00234 (smallest over largest singular value)
    danger cylinder 42.1 m away (the farthest of the triples)
    >>> print(ln.pose_observability(landmarks[:2], [-50, 50, 500]).diagnosis)
    two landmarks
    """
    attitude = np.zeros(3) if mrp is None else vectors(mrp, "mrp")
    place = vectors(position, "position")
    predicted = predict_los(landmarks, place, attitude)
    _refuse_extreme_ranges(vectors(landmarks, "landmarks"), place)
    lead = predicted.shape[:-2]
    pose = np.concatenate([np.broadcast_to(v, (*lead, 3)) for v in (place, attitude)], axis=-1)
    values, right = _core.pose_singular(landmarks, predicted, sigma, covariance, pose)
    marks = vectors(landmarks, "landmarks")
    return _assemble(marks, pose, values, right, body_axes=mrp is not None)


def of_pose_solution(solution: PoseSolution) -> PoseObservability:
    """Observability at a solved pose, from its information matrix: ``PoseSolution.observability``.

    Squaring costs half the digits: singular values below :data:`RESOLVED` times the largest are rounding, and
    count as zero.
    """
    information, dcm, kept = solution._body_information, solution.dcm, solution.inliers
    place, marks = solution.position, solution._landmarks
    # Position from body to reference axes, and in units of the mean range.
    change = np.zeros((*place.shape[:-1], 6, 6))
    change[..., :3, :3] = dcm * _view(marks, place, kept)[1][..., np.newaxis, np.newaxis]
    change[..., 3:, 3:] = np.eye(3)
    with np.errstate(invalid="ignore", over="ignore"):
        scaled = np.swapaxes(change, -1, -2) @ information @ change
    valid = np.array(np.isfinite(scaled).all(axis=(-2, -1), keepdims=True))
    squares, basis = np.linalg.eigh(np.where(valid, scaled, np.eye(6)))
    clear = squares > RESOLVED**2 * squares[..., -1:]
    values = np.where(valid[..., 0], np.sqrt(np.where(clear, squares, 0.0))[..., ::-1], np.nan)
    right = np.swapaxes(basis[..., ::-1], -1, -2)
    pose = np.concatenate([place, solution.mrp], axis=-1)
    return _assemble(marks, pose, values, right, kept, body_axes=True)


def _refuse_extreme_ranges(marks: FloatArray, place: FloatArray) -> None:
    """Beside the rest of the scene a landmark must not be nothing: then the observer stands on it."""
    ranges = np.abs(marks - place[..., np.newaxis, :]).max(axis=-1)
    spread = float((ranges.max(axis=-1) / ranges.min(axis=-1)).max(initial=1.0))
    if spread > RANGE_RATIO:
        raise InvalidInputError(
            f"position: expected ranges within a factor of {RANGE_RATIO:g}, got {spread:.3g}: "
            "the observer stands on a landmark as far as numbers can tell"
        )


def _assemble(
    marks: FloatArray,
    pose: FloatArray,
    values: FloatArray,
    right: FloatArray,
    kept: npt.NDArray[np.bool_] | None = None,
    *,
    body_axes: bool,
) -> PoseObservability:
    """From singular values and vectors (rows) of the scaled, whitened Jacobian."""
    shape = values.shape[:-1]
    pose = np.broadcast_to(pose, (*shape, 6))
    _, flat = broadcast(("pose", pose, 1), ("values", values, 1), ("vectors", right, 2))
    _, sets = broadcast(("landmarks", marks, 2), *([("pose", pose, 1)] if marks.ndim > 2 else []))
    flags = None if kept is None else np.array(kept, dtype=np.float64).reshape(-1, marks.shape[-2])
    rank, code, numbers = _core.pose_geometry(sets[0], flat[0], flat[1], flat[2], flags)
    rank, code, numbers = rank.reshape(shape), code.reshape(shape), numbers.reshape((*shape, 14))
    view, reach = _view(marks, pose[..., :3], kept)
    scale = np.repeat(np.stack([reach, np.ones(shape)], axis=-1), 3, axis=-1)
    count = np.broadcast_to(marks.shape[-2] if kept is None else kept.sum(axis=-1), shape)
    # Each direction of unit weight adds two to the trace of the attitude block.
    largest = values[..., 0]
    with np.errstate(all="ignore"):
        # Relative to the largest: the squares of the values themselves may leave the range of numbers.
        relative = values / largest[..., np.newaxis]
        trace = (relative**2 * (right[..., 3:] ** 2).sum(axis=-1)).sum(axis=-1)
        unit = np.sqrt(2.0 * count / trace)
        noise, singular_values = unit / largest, relative * unit[..., np.newaxis]
    return PoseObservability(
        rank=plain(rank),
        singular_values=singular_values,
        noise=plain(noise),
        degree=plain(ratio(values)),
        directions=scale[..., np.newaxis] * np.swapaxes(right, -1, -2),
        labels=LABELS,
        scale=scale,
        danger_cylinder_distance=plain(numbers[..., 6]),
        diagnosis=_DIAGNOSES[np.where(np.isfinite(values).all(axis=-1), code, _INVALID)],
        null_twist=_null_twist(rank, numbers, pose[..., :3], reach),
        body_axes=body_axes,
        _numbers=np.concatenate([view, numbers[..., 7:], count[..., np.newaxis]], axis=-1),
    )


def _view(
    marks: FloatArray, place: FloatArray, kept: npt.NDArray[np.bool_] | None
) -> tuple[FloatArray, FloatArray]:
    """Mean direction to the landmarks in reference axes, ``(..., 3)``, and mean range, m, ``(...)``."""
    counts = np.array(True) if kept is None else kept
    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        sight = marks - place[..., np.newaxis, :]
        distance = np.linalg.norm(sight, axis=-1)
        view = np.mean(sight / distance[..., np.newaxis], axis=-2, where=counts[..., np.newaxis])
        reach = np.mean(distance, axis=-1, where=counts)
    return view, reach


def _null_twist(rank: IntArray, numbers: FloatArray, position: FloatArray, reach: FloatArray) -> FloatArray:
    """The weakest motion seen from the reference origin: ``v = u - w x p``."""
    w, u = numbers[..., :3], numbers[..., 3:6]
    turn, shift = (np.linalg.norm(x, axis=-1, keepdims=True) for x in (w, u))
    turns = turn * reach[..., np.newaxis] > ROUNDING_SHARE * shift
    with np.errstate(invalid="ignore", divide="ignore"):
        turning = np.concatenate([w, u - np.cross(w, position)], axis=-1) / turn
        sliding = np.concatenate([np.zeros_like(w), u], axis=-1) / shift
    return np.where(rank[..., np.newaxis] < 6, np.where(turns, turning, sliding), np.nan)


def _forward(direction: FloatArray) -> FloatArray:
    """Of a direction and its opposite the one whose shift, or else turn, leads along a positive axis."""
    lead = direction[:3] if direction[:3].any() else direction[3:]
    return -direction if lead[np.abs(lead).argmax()] < 0.0 else direction


def _axis(vector: FloatArray) -> str:
    """``x``, ``-y`` or ``(0.60, 0.80, 0.00)``."""
    unit = vector / np.linalg.norm(vector)
    k = int(np.abs(unit).argmax())
    if abs(unit[k]) > NEARLY_PARALLEL:
        return ("" if unit[k] > 0.0 else "-") + "xyz"[k]
    return "(" + ", ".join(f"{c + 0.0:.2f}" for c in np.round(unit, 2)) + ")"


def _aspect(shift: FloatArray, view: FloatArray) -> str:
    """Whether a shift is along the lines of sight or across them; nothing if they lead in all directions."""
    spread = float(np.linalg.norm(view))
    if spread < NARROW_VIEW:
        return ""
    cosine = abs(shift @ view) / (float(np.linalg.norm(shift)) * spread)
    if cosine > NEARLY_PARALLEL:
        return " (range)"
    return " (lateral)" if cosine < NEARLY_PERPENDICULAR else ""
