"""A camera that recognises the landmarks of a map."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from losnav._arrays import (
    ArrayLike,
    FloatArray,
    covariances,
    finite,
    in_range,
    points,
    positive,
    rotations,
    together,
    vectors,
)
from losnav.errors import InvalidInputError
from losnav.sensors.listed import Listed, observer

MapErrors = Literal["white", "consider", "estimate", "ignore"]
MAP_ERRORS = ("white", "consider", "estimate", "ignore")


@dataclass(frozen=True, eq=False, init=False)
class LandmarkCamera(Listed):
    """Pixels of known landmarks in a pinhole camera: boresight +z, x right, y down (L5).

    Measurement ``(..., 2 N)``: ``[u0 v0 u1 v1 ...]`` of all landmarks, a pair of NaN where one was not seen.
    With ``c = camera_from_body @ (dcm @ (L - p) - lever_arm)`` a landmark is at
    ``[u, v] = focal_length_px * [c1, c2] / c3 + principal_point``; with ``c3 <= 0`` it is behind the camera,
    where there is no pixel. Lenses that distort: undistort the pixels first.

    Parameters
    ----------
    landmarks : (N, 3)
        The map: landmarks in the reference frame, m.
    focal_length_px : float or (2,)
        Focal length in pixels, along u and v if they differ.
    sigma_px : float or (N,)
        1-sigma noise of u and of v, px.
    landmark_sigma : float, (N,) or (N, 3, 3)
        How well the map is known: 1-sigma along each axis, m, or covariances, m^2, reference axes.
    principal_point : (2,)
        Pixel of the boresight.
    image_size : (2,), optional
        Width and height, px, for :meth:`visible` and :meth:`simulate`: the image is ``[0, width] x
        [0, height]``, or centred at the boresight where ``principal_point`` is the origin of pixels. None
        sees everything in front.
    camera_from_body : (3, 3)
        Mounting: takes body components to camera components.
    lever_arm : (3,)
        From the body's origin to the camera, body axes, m.
    map_errors : {"white", "consider", "estimate", "ignore"}
        What a filter makes of ``landmark_sigma``. "white": noise of every pixel (``H_L S H_L'`` is added to
        its covariance), optimistic for a map that errs the same way all the time; "consider": uncertain but
        not corrected (Schmidt); "estimate": corrected along with the state; "ignore".

    Raises
    ------
    InvalidInputError
        On wrong shapes, NaN, infinity, a ``camera_from_body`` that is no rotation, or a number that must be
        positive and is not.

    Examples
    --------
    >>> import numpy as np
    >>> import losnav as ln
    >>> camera = ln.sensors.LandmarkCamera([[10.0, -20.0, 0.0], [500.0, 0.0, 0.0]], 500.0, sigma_px=1.0,
    ...                                    image_size=(1024, 1024))
    >>> down = np.diag([1.0, -1.0, -1.0])  # body axes East, South, down
    >>> state = ln.NavState.from_dcm([0.0, 0.0, 100.0], [0.0, 0.0, -1.0], down)
    >>> camera.predict(state)
    array([  50.,  100., 2500.,    0.])
    >>> camera.visible(state)
    array([ True, False])
    >>> camera.jacobian(state).shape  # columns [dr dv da db_a db_g]
    (4, 15)
    """

    landmarks: FloatArray
    focal_length_px: FloatArray
    sigma_px: FloatArray
    landmark_sigma: FloatArray
    principal_point: FloatArray
    image_size: FloatArray | None
    camera_from_body: FloatArray
    lever_arm: FloatArray
    map_errors: MapErrors

    told: ClassVar[tuple[str, ...]] = ("landmarks",)
    block: ClassVar[int] = 2

    def __init__(
        self,
        landmarks: ArrayLike,
        focal_length_px: ArrayLike,
        sigma_px: ArrayLike,
        landmark_sigma: ArrayLike = 0.0,
        *,
        principal_point: ArrayLike = (0.0, 0.0),
        image_size: ArrayLike | None = None,
        camera_from_body: ArrayLike = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)),
        lever_arm: ArrayLike = (0.0, 0.0, 0.0),
        map_errors: MapErrors = "white",
    ) -> None:
        marks = points(landmarks, "landmarks")
        count = len(marks)
        spread = finite(landmark_sigma, "landmark_sigma")
        if spread.shape == (count, 3, 3):
            spread = covariances(spread, "landmark_sigma")
        elif (spread < 0.0).any():
            raise InvalidInputError("landmark_sigma: expected no negative number")
        self._hold("landmarks", marks, (count, 3))
        self._hold("focal_length_px", positive(focal_length_px, "focal_length_px"), (), (2,))
        self._hold("sigma_px", positive(sigma_px, "sigma_px"), (), (count,))
        self._hold("landmark_sigma", spread, (), (count,), (count, 3, 3))
        self._hold("principal_point", finite(principal_point, "principal_point"), (2,))
        self._hold("camera_from_body", rotations(camera_from_body, "camera_from_body"), (3, 3))
        self._hold("lever_arm", vectors(lever_arm, "lever_arm"), (3,))
        if image_size is None:
            object.__setattr__(self, "image_size", None)
        else:
            self._hold("image_size", positive(image_size, "image_size"), (2,))
        if map_errors not in MAP_ERRORS:
            listed = ", ".join(f'"{choice}"' for choice in MAP_ERRORS)
            raise InvalidInputError(f"map_errors: expected one of {listed}, got {map_errors!r}")
        object.__setattr__(self, "map_errors", map_errors)

    def predict(
        self, state: Any, *, dcm: ArrayLike | None = None, landmarks: ArrayLike | None = None
    ) -> FloatArray:
        """Pixels expected at a state, of every landmark, inside the image or not.

        Parameters
        ----------
        state : (..., 3), (..., 6), (position, mrp) or NavState
            See the module.
        dcm : (..., 3, 3), optional
            Known attitude, body from reference, where the state has none.
        landmarks : (N, 3) or (..., N, 3), optional
            In place of the sensor's.

        Returns
        -------
        (..., 2 N)
            ``[u0 v0 u1 v1 ...]``, px.

        Raises
        ------
        InvalidInputError
            On wrong shapes, a missing attitude, NaN, infinity, or a landmark behind the camera.
        """
        return self._linearize(state, dcm, landmarks)[0]

    def jacobian(
        self, state: Any, *, dcm: ArrayLike | None = None, landmarks: ArrayLike | None = None
    ) -> FloatArray:
        """Derivative of :meth:`predict` along the state's tangent.

        Parameters
        ----------
        state, dcm, landmarks
            As for :meth:`predict`.

        Returns
        -------
        (..., 2 N, K)
            Columns ``[dr]``, ``[dr dv]``, ``[dp dalpha]`` or the 15 of a NavState: px/m, px s/m, px/rad. That
            with respect to a landmark is minus that with respect to the position.

        Raises
        ------
        InvalidInputError
            As :meth:`predict`.
        """
        return self._linearize(state, dcm, landmarks)[1]

    def noise(
        self, state: Any = None, *, dcm: ArrayLike | None = None, landmarks: ArrayLike | None = None
    ) -> FloatArray:
        """Covariance of the measurement; with ``map_errors="white"`` that of the landmarks is in it.

        Parameters
        ----------
        state, dcm, landmarks
            As for :meth:`predict`; what the error of a landmark does to a pixel depends on them.

        Returns
        -------
        (2 N, 2 N) or (..., 2 N, 2 N)
            px^2; a block for each landmark.

        Raises
        ------
        InvalidInputError
            As :meth:`predict`, where the map has errors.
        """
        marks = self._landmarks(landmarks)
        count = marks.shape[-2]
        pixel = np.diag(np.repeat(np.square(np.broadcast_to(self.sigma_px, count)), 2))
        if not self._white.size:
            return pixel
        # H_L = -H_p, whose sign does not matter here.
        slope = self._linearize(state, dcm, landmarks)[1][..., :3]
        slope = slope.reshape((*slope.shape[:-2], count, 2, 3))
        added = slope @ self._map_covariance(count) @ np.swapaxes(slope, -1, -2)
        total = np.zeros((*slope.shape[:-3], 2 * count, 2 * count)) + pixel
        for i in range(count):
            total[..., 2 * i : 2 * i + 2, 2 * i : 2 * i + 2] += added[..., i, :, :]
        return in_range(total, "landmark_sigma")

    def simulate(
        self,
        state: Any,
        rng: np.random.Generator | int | None = None,
        *,
        dcm: ArrayLike | None = None,
        landmarks: ArrayLike | None = None,
    ) -> FloatArray:
        """Pixels with the noise of the image, NaN for landmarks that are not visible.

        Errors of the map are not drawn: they do not change from image to image. Draw the true landmarks once
        and give them as ``landmarks``.

        Parameters
        ----------
        state, dcm, landmarks
            As for :meth:`predict`.
        rng : numpy.random.Generator or seed
            Source of the noise.

        Returns
        -------
        (..., 2 N)
            ``[u0 v0 u1 v1 ...]``, px.

        Raises
        ------
        InvalidInputError
            On wrong shapes, a missing attitude, NaN or infinity.
        """
        pixels, seen = self._project(state, dcm, landmarks)
        noise = np.asarray(np.random.default_rng(rng).standard_normal(pixels.shape))
        noise *= np.broadcast_to(self.sigma_px, pixels.shape[-2])[:, np.newaxis]
        measured = np.where(seen[..., np.newaxis], pixels + noise, np.nan)
        return measured.reshape((*pixels.shape[:-2], -1))

    def visible(
        self, state: Any, *, dcm: ArrayLike | None = None, landmarks: ArrayLike | None = None
    ) -> npt.NDArray[np.bool_]:
        """Which landmarks are in front of the camera and inside the image; what hides them is not known.

        Parameters
        ----------
        state, dcm, landmarks
            As for :meth:`predict`.

        Returns
        -------
        (..., N) bool

        Raises
        ------
        InvalidInputError
            As :meth:`simulate`.
        """
        return self._project(state, dcm, landmarks)[1]

    def only(self, index: ArrayLike) -> LandmarkCamera:
        """The same camera with some of its landmarks.

        Parameters
        ----------
        index : (K,) of int, or (N,) of bool
            Which.

        Returns
        -------
        LandmarkCamera
            Their noise and the errors of their map with them.

        Raises
        ------
        InvalidInputError
            If they are none, or not all there.
        """
        try:
            kept = np.arange(len(self.landmarks))[np.atleast_1d(index)]
        except IndexError as error:
            raise InvalidInputError(f"index: expected some of {len(self.landmarks)} landmarks") from error
        return LandmarkCamera(
            self.landmarks[kept],
            self.focal_length_px,
            self.sigma_px[kept] if self.sigma_px.ndim else self.sigma_px,
            self.landmark_sigma[kept] if self.landmark_sigma.ndim else self.landmark_sigma,
            principal_point=self.principal_point,
            image_size=self.image_size,
            camera_from_body=self.camera_from_body,
            lever_arm=self.lever_arm,
            map_errors=self.map_errors,
        )

    def _hold(self, name: str, array: FloatArray, *shapes: tuple[int, ...]) -> None:
        if array.shape not in shapes:
            wanted = " or ".join(f"shape {shape}" if shape else "a number" for shape in shapes)
            raise InvalidInputError(f"{name}: expected {wanted}, got shape {array.shape}")
        kept = array.copy()
        kept.flags.writeable = False
        object.__setattr__(self, name, kept)

    @property
    def _optics(self) -> FloatArray:
        """The camera as the engine reads it."""
        focal = np.broadcast_to(self.focal_length_px, 2)
        return np.concatenate([focal, self.principal_point, self.camera_from_body.ravel(), self.lever_arm])

    @property
    def _white(self) -> FloatArray:
        """Variances or covariances of landmarks that count as noise of the pixels; empty if none do."""
        if self.map_errors != "white" or not self.landmark_sigma.any():
            return np.zeros(0)
        return self.landmark_sigma if self.landmark_sigma.ndim == 3 else np.square(self.landmark_sigma)

    def _map_covariance(self, count: int) -> FloatArray:
        """``(count, 3, 3)``, whatever becomes of it."""
        if self.landmark_sigma.ndim == 3:
            return self.landmark_sigma
        return np.square(np.broadcast_to(self.landmark_sigma, count))[:, np.newaxis, np.newaxis] * np.eye(3)

    def _landmarks(self, landmarks: ArrayLike | None) -> FloatArray:
        if landmarks is None:
            return self.landmarks
        marks = vectors(landmarks, "landmarks")
        each = self.sigma_px.ndim > 0 or self.landmark_sigma.ndim > 0
        if marks.ndim < 2 or not marks.shape[-2] or (each and marks.shape[-2] != len(self.landmarks)):
            count = str(len(self.landmarks)) if each else "N"
            raise InvalidInputError(f"landmarks: expected shape (..., {count}, 3), got {marks.shape}")
        return marks

    def _linearize(
        self, state: Any, dcm: ArrayLike | None, landmarks: ArrayLike | None
    ) -> tuple[FloatArray, FloatArray]:
        marks = self._landmarks(landmarks)
        return self._ask(state, dcm, marks, name="landmarks", core=2, fixed=(self._optics,))

    def _project(
        self, state: Any, dcm: ArrayLike | None, landmarks: ArrayLike | None
    ) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Pixels ``(..., N, 2)``, and which of them are in the image; no landmark is an error."""
        x = observer(state, dcm)
        places = (
            ("position", x.position, 1),
            ("dcm", x.dcm, 2),
            ("landmarks", self._landmarks(landmarks), 2),
        )
        position, attitude, marks = together(*places)
        body = np.einsum("...ij,...nj->...ni", attitude, marks - position[..., np.newaxis, :])
        camera = (body - self.lever_arm) @ self.camera_from_body.T
        depth = camera[..., 2:]
        front = depth[..., 0] > 0.0
        with np.errstate(all="ignore"):
            pixels = self.focal_length_px * camera[..., :2] / np.where(depth > 0.0, depth, np.nan)
        if self.image_size is None:
            return pixels + self.principal_point, front
        middle = 0.0 if not self.principal_point.any() else 0.5 * self.image_size
        pixels += self.principal_point
        inside = np.abs(pixels - middle) <= 0.5 * self.image_size
        return pixels, front & inside.all(axis=-1)
