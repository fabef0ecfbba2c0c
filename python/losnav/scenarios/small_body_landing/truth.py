"""The world of the landing: site, fields, the flight, and which landmarks are seen on it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import losnav as ln
from losnav import landing
from losnav.gravity import Harmonics, Polyhedron
from losnav.navigation_state import NavState
from losnav.scenarios.small_body_landing.shape import Shape, built_in, read_shape

if TYPE_CHECKING:
    from losnav.scenarios.small_body_landing import SmallBodyLanding

__all__ = ["Flight", "fly", "harmonics", "nearby_errors", "polyhedron", "shape_of", "site_of"]

Array = NDArray[np.float64]

_DEGREE = 4
_ABOVE = 20.0  # m


@dataclass(frozen=True)
class Flight:
    """A flight of the lander and what its camera sees of the map.

    Attributes
    ----------
    scenario : SmallBodyLanding
    site : Site
    gravity : object
        The true field, body-fixed.
    """

    scenario: SmallBodyLanding
    site: ln.dynamics.Site
    gravity: Any

    @cached_property
    def descent(self) -> landing.Descent:
        """True motion and inertial samples."""
        s = self.scenario
        guidance = landing.ApolloGuidance(
            s.target_position, s.target_velocity, s.target_acceleration, s.duration, s.guidance_hold
        )
        return landing.simulate_descent(
            self.site,
            self.gravity,
            s.start_position,
            s.start_velocity,
            duration=s.duration,
            guidance=guidance,
            attitude=landing.Sway(s.attitude_amplitude, s.attitude_periods),
            step=s.imu_step,
        )

    @cached_property
    def times(self) -> Array:
        """Epochs of camera and velocimeter, s, (T,)."""
        return np.asarray(self.descent.time[self.descent.every(self.scenario.sampling)])

    @cached_property
    def state(self) -> NavState:
        """The truth at the epochs, shape (T,)."""
        return self.descent.state[self.descent.every(self.scenario.sampling)]

    @cached_property
    def start(self) -> NavState:
        """The truth at t = 0."""
        return self.descent.state[0]

    @cached_property
    def catalogue(self) -> Array:
        """All landmarks of the map, (N, 3), m."""
        s = self.scenario
        return landing.ring_landmarks(
            round(s.landmark_rings),
            round(s.landmarks_per_ring),
            first=s.first_ring,
            growth=s.ring_growth,
            height=s.landmark_height,
        )

    @cached_property
    def _chosen(self) -> NDArray[np.intp]:
        return np.asarray(landing.choose_landmarks(self.camera_of(self.catalogue), self.state))

    @cached_property
    def used(self) -> NDArray[np.intp]:
        """Landmarks of the catalogue that are used at some epoch, rising."""
        return np.unique(self._chosen[self._chosen >= 0])

    @cached_property
    def chosen(self) -> NDArray[np.intp]:
        """Landmarks used at each epoch, counted in :attr:`used`, (T, 3); -1 for none."""
        place = np.searchsorted(self.used, self._chosen)
        return np.where(self._chosen >= 0, place, -1)

    def camera_of(self, landmarks: Array, map_errors: str = "white") -> ln.sensors.LandmarkCamera:
        """The camera with a map."""
        s, kind = self.scenario, {"map_errors": map_errors}
        return ln.sensors.LandmarkCamera(
            landmarks,
            s.focal_length_px,
            s.pixel_sigma,
            s.landmark_sigma,
            image_size=(s.image_size, s.image_size),
            **kind,  # type: ignore[arg-type]
        )

    def camera(self, map_errors: str = "white") -> ln.sensors.LandmarkCamera:
        """The camera with the landmarks that are used."""
        return self.camera_of(self.catalogue[self.used], map_errors)

    @cached_property
    def velocimeter(self) -> ln.sensors.Velocimeter:
        """The velocimeter."""
        return ln.sensors.Velocimeter(self.scenario.velocimeter_sigma)


def site_of(scenario: SmallBodyLanding, radius: float | None = None) -> ln.dynamics.Site:
    """The site, at its own or another distance from the centre of mass (m)."""
    s = scenario
    distance = s.site_radius if radius is None else radius
    return ln.dynamics.Site.on_body(s.latitude, s.longitude, distance, s.rotation_rate)


def harmonics(scenario: SmallBodyLanding) -> Harmonics:
    """The field of five coefficients."""
    s = scenario
    c, none = np.zeros((_DEGREE + 1, _DEGREE + 1)), np.zeros((_DEGREE + 1, _DEGREE + 1))
    c[0, 0] = 1.0
    c[2, 0], c[2, 2], c[4, 0], c[4, 2], c[4, 4] = s.c20, s.c22, s.c40, s.c42, s.c44
    # Inside the sphere round the body on purpose: this is the published field, and the study of the
    # polyhedron says what it is worth there.
    return Harmonics(s.mu, s.reference_radius, c, none, brillouin_radius=0.0)


@lru_cache(maxsize=4)
def shape_of(file: str) -> Shape:
    """The shape of a file, or the built-in one."""
    return read_shape(file) if file else built_in()


def polyhedron(scenario: SmallBodyLanding) -> Polyhedron:
    """Field of the shape, as heavy as the scenario says."""
    shape = shape_of(scenario.shape)
    return Polyhedron.of_mass(shape.vertices, shape.faces, scenario.mu)


def shape_harmonics(scenario: SmallBodyLanding, degree: int = _DEGREE) -> Harmonics:
    """Field of the shape by its harmonics: what an orbiter would have measured of it."""
    c, s = shape_of(scenario.shape).harmonics(degree, scenario.reference_radius)
    return Harmonics(scenario.mu, scenario.reference_radius, c, s, brillouin_radius=0.0)


def direction(scenario: SmallBodyLanding) -> Array:
    """From the centre of mass to the site, body-fixed unit vector."""
    s = scenario
    along = (np.cos(s.latitude) * np.cos(s.longitude), np.cos(s.latitude) * np.sin(s.longitude))
    return np.array([*along, np.sin(s.latitude)])


def nearby_errors(scenario: SmallBodyLanding) -> Array:
    """Relative error of the harmonics 20 m above every face of the shape, against the polyhedron, (M,)."""
    shape = shape_of(scenario.shape)
    points = shape.corners.mean(axis=1) + _ABOVE * shape.normals()
    exact = polyhedron(scenario).acceleration(points)
    series = shape_harmonics(scenario).acceleration(points)
    return np.asarray(np.linalg.norm(series - exact, axis=1) / np.linalg.norm(exact, axis=1))


@lru_cache(maxsize=4)
def fly(scenario: SmallBodyLanding, field: str = "harmonics") -> Flight:
    """The flight over the field of five coefficients, or over that of the shape ("polyhedron")."""
    if field == "harmonics":
        return Flight(scenario, site_of(scenario), harmonics(scenario))
    radius = shape_of(scenario.shape).radius(direction(scenario))
    return Flight(scenario, site_of(scenario, radius), polyhedron(scenario))
