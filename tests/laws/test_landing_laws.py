"""What a simulated descent must do whatever its parameters: arrive, conserve, and be measured exactly."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import losnav as ln
from losnav import landing
from losnav.errors import InvalidInputError
from tests.oracle import landing as twin

SPIN = 3.3e-4
TIP = ln.dynamics.Site.on_body(0.04, 0.3, radius=15e3, rotation_rate=SPIN)
# Position and velocity of the descent of the scenario, site frame.
START = (np.array([400.0, -300.0, 2000.0]), np.array([-1.0, 0.7, -5.0]))
GUIDE = landing.ApolloGuidance([0, 0, 30], [0, 0, -0.1], [0, 0, 0], final_time=600.0)
# The same Runge-Kutta steps with other groupings, 600 s of them, metres and m/s.
SAME_STEPS = 1e-9


class PointMass:
    """A user's own field."""

    mu = 4.46e5

    def acceleration(self, r):
        """Newton's."""
        return -self.mu * r / np.linalg.norm(r, axis=-1, keepdims=True) ** 3

    def potential(self, r):
        """U > 0."""
        return self.mu / np.linalg.norm(r, axis=-1)

    def gradient(self, r):
        """dg/dr."""
        d = np.linalg.norm(r, axis=-1)[..., None, None]
        return self.mu * (3 * r[..., :, None] * r[..., None, :] / d**5 - np.eye(3) / d**3)


@pytest.fixture(scope="module")
def descent():
    return landing.simulate_descent(TIP, PointMass(), *START, duration=600.0, guidance=GUIDE)


def world(site):
    field, turn = PointMass(), site.site_from_fixed

    def gravity(r):
        x = (r + site.center) @ turn
        return field.acceleration(x) @ turn.T, turn @ field.gradient(x) @ turn.T

    return twin.World(site.angular_velocity, site.center, gravity)


# --- guidance ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "target", [((0, 0, 30), (0, 0, -0.1), (0, 0, 0)), ((5, -7, 3), (1, 2, -3), (0.1, 0, 0.2))]
)
def test_guidance_reaches_its_target_on_the_double_integrator(target):
    guide = landing.ApolloGuidance(*target, final_time=100.0, hold=1e-3)

    def motion(t, y):
        return np.concatenate([y[3:], guide(t, y[:3], y[3:])])

    start = np.concatenate([[400.0, -300.0, 900.0], [-1.0, 0.7, -5.0]])
    end = solve_ivp(motion, (0.0, guide.hold_from), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
    # The last millisecond is left out.
    np.testing.assert_allclose(end[:3] + 1e-3 * end[3:], target[0], atol=1e-5)
    np.testing.assert_allclose(end[3:], target[1], atol=1e-3)


def test_the_commanded_path_is_a_quartic():
    guide = landing.ApolloGuidance([0, 0, 0], [0, 0, 0], [0.0, 0.0, 0.3], final_time=10.0, hold=1e-6)
    # r = s^2 (a + b s + c s^2) in the time to go s has r'' = a_f at s = 0 for a = a_f/2.
    for b, c in ((0.2, -0.03), (-0.5, 0.04)):
        for s in (9.0, 4.0, 0.5):
            r, v, a = (0.15 * s**2 + b * s**3 + c * s**4, -(0.3 * s + 3 * b * s**2 + 4 * c * s**3), 0.0)
            a = 0.3 + 6 * b * s + 12 * c * s**2
            assert guide(10.0 - s, [0, 0, r], [0, 0, v])[2] == pytest.approx(a, abs=1e-9)


def test_the_descent_arrives(descent):
    np.testing.assert_allclose(descent.position[-1], [0, 0, 30], atol=0.01)
    np.testing.assert_allclose(descent.velocity[-1], [0, 0, -0.1], atol=0.005)
    # The last command stands for the last five seconds: what is wanted does not change any more.
    wanted = []
    for k in (5951, 5975, 5999):
        free = world(TIP).acceleration(descent.position[k], descent.velocity[k], np.eye(3), np.zeros(3), 0.0)
        wanted.append(descent.dcm[k].T @ descent.specific_force[k] + free)
    np.testing.assert_allclose(wanted, np.broadcast_to(wanted[0], (3, 3)), atol=1e-15)


# --- truth and samples ------------------------------------------------------------------------------------


def test_jacobi_integral_of_free_motion():
    start = (
        np.array([[400.0, -300.0, 2000.0], [0.0, 0.0, 9000.0]]),
        np.array([[1.0, 0.7, 2.0], [0.0, 1.0, 3.0]]),
    )
    fall = landing.simulate_descent(TIP, PointMass(), *start, duration=2000.0, step=0.5)
    arm = fall.position + TIP.center
    swept = np.cross(TIP.angular_velocity, arm)
    energy = 0.5 * (fall.velocity**2).sum(-1) - PointMass().potential(arm) - 0.5 * (swept**2).sum(-1)
    np.testing.assert_allclose(energy, np.broadcast_to(energy[:, :1], energy.shape), rtol=1e-12)
    assert not fall.specific_force.any()


def test_samples_return_the_truth(descent):
    """Of the same rule to rounding."""
    x = twin.State(descent.position[0], descent.velocity[0], descent.dcm[0].T)
    model = twin.Model(world(TIP), twin.Grade(0.0, 0.0))
    for f, w in zip(descent.specific_force, descent.angular_rate, strict=True):
        x, _ = twin.mechanised(x, f, w, descent.step, model)
    np.testing.assert_allclose(x.r, descent.position[-1], atol=SAME_STEPS)
    np.testing.assert_allclose(x.v, descent.velocity[-1], atol=SAME_STEPS)
    np.testing.assert_allclose(x.c.T, descent.dcm[-1], atol=1e-11)


def test_samples_return_the_truth_by_the_mid_step_rule(descent):
    """Position to 1e-5 m at 10 Hz, as the literature finds."""
    there = world(TIP)
    r, v, c, dt = descent.position[0], descent.velocity[0], descent.dcm[0].T, descent.step
    for f, w in zip(descent.specific_force, descent.angular_rate, strict=True):
        half = twin.rotation(-dt / 2 * there.rate) @ c @ twin.rotation(dt / 2 * w)
        start = there.acceleration(r, v, half, f, 0.0)
        r_half, v_half = r + dt / 2 * v, v + dt / 2 * start
        r, v = r + dt * v_half, v + dt * there.acceleration(r_half, v_half, half, f, 0.0)
        c = twin.rotation(-dt * there.rate) @ c @ twin.rotation(dt * w)
    assert np.linalg.norm(r - descent.position[-1]) < 1.5e-5
    assert np.linalg.norm(v - descent.velocity[-1]) < 1e-7


def test_samples_return_the_truth_in_an_inertial_frame(descent):
    """Site coordinates and inertial ones tell one story: 60 s of thrust and turns by another integrator."""
    dt, steps, site = descent.step, 600, TIP
    spin_fixed = np.array([0.0, 0.0, SPIN])

    def fixed_from_inertial(t):
        return twin.rotation(-t * spin_fixed)

    from_site = site.site_from_fixed.T
    x = from_site @ (descent.position[0] + site.center)
    speed = from_site @ descent.velocity[0] + np.cross(spin_fixed, x)
    state, field, body = np.concatenate([x, speed]), PointMass(), from_site @ descent.dcm[0].T
    for k in range(steps):
        f, w = descent.specific_force[k], descent.angular_rate[k]

        def motion(t, y, body=body, sample=(f, w), start=k * dt):
            f, w = sample
            turn = fixed_from_inertial(t)
            return np.concatenate(
                [y[3:], body @ twin.rotation((t - start) * w) @ f + turn.T @ field.acceleration(turn @ y[:3])]
            )

        span = (k * dt, (k + 1) * dt)
        state = solve_ivp(motion, span, state, method="DOP853", rtol=1e-13, atol=1e-10).y[:, -1]
        body = body @ twin.rotation(dt * w)
    turn = site.site_from_fixed @ fixed_from_inertial(steps * dt)
    r = turn @ state[:3] - site.center
    v = turn @ state[3:] - np.cross(site.angular_velocity, r + site.center)
    np.testing.assert_allclose(r, descent.position[steps], atol=1e-8)
    np.testing.assert_allclose(v, descent.velocity[steps], atol=1e-10)
    np.testing.assert_allclose(turn @ body, descent.dcm[steps].T, atol=1e-11)


def test_rates_follow_any_profile():
    """A user's own attitude, through the vertical and over."""

    def tumble(time):
        return twin.rotation(-time[:, None] * np.array([0.05, 0.02, -0.03])) @ landing.NADIR

    fall = landing.simulate_descent(TIP, PointMass(), *START, duration=100.0, attitude=tumble)
    body = np.array([0.05, 0.02, -0.03]) + np.einsum("tij,j->ti", fall.dcm[:-1], TIP.angular_velocity)
    # The site turns by 3e-5 rad in a step, the body by 6e-3 in it.
    np.testing.assert_allclose(fall.angular_rate, body, atol=2e-6)


def test_a_batch_is_its_members():
    position = START[0] + np.array([[0.0, 0.0, 0.0], [50.0, -20.0, 30.0]])
    both = landing.simulate_descent(TIP, PointMass(), position, START[1], duration=60.0, guidance=GUIDE)
    assert both.specific_force.shape == (2, 600, 3)
    assert both.state.shape == (2, 601)
    for k in range(2):
        one = landing.simulate_descent(TIP, PointMass(), position[k], START[1], duration=60.0, guidance=GUIDE)
        np.testing.assert_allclose(both.position[k], one.position, atol=1e-9)
        np.testing.assert_allclose(both.specific_force[k], one.specific_force, atol=1e-12)


def test_gravity_may_be_uniform_and_the_frame_still():
    site, field = ln.dynamics.Site.inertial(), PointMass()
    field.acceleration = lambda r: np.broadcast_to([0.0, 0.0, -9.8], r.shape)
    fall = landing.simulate_descent(site, field, [0.0, 0.0, 100.0], [3.0, 0.0, 1.0], duration=2.0)
    np.testing.assert_allclose(fall.position[-1], [6.0, 0.0, 100.0 + 2.0 - 19.6], atol=1e-11)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("duration", {"duration": 0.15}),
        ("duration", {"duration": -1.0}),
        ("step", {"step": 0.0}),
        ("position", {"position": [1.0, 2.0]}),
        ("position", {"position": np.zeros((2, 3)), "velocity": np.zeros((3, 3))}),
        ("attitude", {"attitude": lambda t: np.eye(3)}),
        ("guidance", {"guidance": lambda t, r, v: "up"}),
    ],
)
def test_bad_descents(name, change):
    given = {"position": START[0], "velocity": START[1], "duration": 1.0, **change}
    with pytest.raises(InvalidInputError, match=name):
        landing.simulate_descent(TIP, PointMass(), given.pop("position"), given.pop("velocity"), **given)


def test_bad_guidance():
    for name, arguments in (
        ("target_velocity", ([0, 0, 0], [0, 0], [0, 0, 0], 10.0)),
        ("final_time", ([0, 0, 0], [0, 0, 0], [0, 0, 0], -10.0)),
        ("hold", ([0, 0, 0], [0, 0, 0], [0, 0, 0], 10.0, 10.0)),
    ):
        with pytest.raises(InvalidInputError, match=name):
            landing.ApolloGuidance(*arguments)


def test_epochs_are_whole_steps(descent):
    assert descent.every(1.0)[:2].tolist() == [10, 20]
    assert descent.time[descent.every(1.0)[-1]] == pytest.approx(600.0)
    with pytest.raises(InvalidInputError, match="interval"):
        descent.every(0.25)


# --- images -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def camera():
    return ln.sensors.LandmarkCamera(landing.ring_landmarks(), 500.0, 1.0, 1.0, image_size=(1024, 1024))


def test_the_largest_triangle_of_all(descent, camera):
    epochs = descent.every(60.0)
    state = descent.state[epochs]
    chosen = landing.choose_landmarks(camera, state)
    for k in range(len(epochs)):
        seen = np.flatnonzero(camera.visible(state[k]))
        assert len(seen) >= 5
        ahead = ln.sensors.LandmarkCamera(camera.landmarks[seen], 500.0, 1.0)
        pixels = ahead.predict(state[k]).reshape(-1, 2)
        best = 0.0
        for i in range(len(seen)):
            a, b = pixels - pixels[i], pixels - pixels[i]
            best = max(best, np.abs(a[:, None, 0] * b[None, :, 1] - a[:, None, 1] * b[None, :, 0]).max())
        corner = pixels[np.searchsorted(seen, chosen[k])]
        a, b = corner[1] - corner[0], corner[2] - corner[0]
        assert abs(a[0] * b[1] - a[1] * b[0]) == pytest.approx(best, rel=1e-12)


def test_too_few_landmarks_are_none(descent):
    two = ln.sensors.LandmarkCamera([[0.0, 0, 0], [9, 0, 0]], 500.0, 1.0)
    assert (landing.choose_landmarks(two, descent.state[[0]]) == -1).all()


def test_pixels_are_those_of_the_camera(descent, camera):
    state = descent.state[descent.every(100.0)]
    chosen = landing.choose_landmarks(camera, state)
    chosen[2] = -1
    noiseless = [type("Still", (), {"standard_normal": staticmethod(np.zeros)})()] * 2
    moved = np.stack([camera.landmarks, camera.landmarks + np.array([1.0, -2.0, 0.5])])
    images = landing.measure_images(camera, state, chosen, noiseless, landmarks=moved)
    pixels = images.pixels.reshape(2, 6, -1, 2)
    used = ~np.isnan(pixels[..., 0])
    assert used.sum(axis=-1).tolist() == [[3, 3, 0, 3, 3, 3]] * 2
    assert not images.wrong.any()
    for run in range(2):
        for k in (0, 1, 3, 4, 5):
            three = ln.sensors.LandmarkCamera(moved[run, chosen[k]], 500.0, 1.0)
            np.testing.assert_allclose(pixels[run, k, chosen[k]].ravel(), three.predict(state[k]), atol=1e-9)


# --- faults -----------------------------------------------------------------------------------------------


def test_faults():
    z = np.arange(12.0).reshape(2, 6, 1)
    assert (
        np.isnan(landing.outage(z, np.arange(6.0), 2.0, 4.0)[..., 0]).tolist()
        == [[False, False, True, True, False, False]] * 2
    )
    assert np.flatnonzero(~np.isnan(landing.thinned(z, 3)[0, :, 0])).tolist() == [2, 5]
    late = landing.arriving(z, 2)
    assert np.isnan(late[:, :2]).all()
    np.testing.assert_array_equal(late[:, 2:], z[:, :4])
    np.testing.assert_array_equal(landing.arriving(z, 0), z)
    assert np.isnan(landing.arriving(z, 9)).all()
    for name, call in (
        ("times", lambda: landing.outage(z, np.arange(5.0), 0, 1)),
        ("every", lambda: landing.thinned(z, 0)),
        ("late", lambda: landing.arriving(z, -1)),
        ("z", lambda: landing.arriving([1.0], 1)),
    ):
        with pytest.raises(InvalidInputError, match=name):
            call()
