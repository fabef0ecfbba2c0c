"""Gramian and Cramér-Rao bound: against 60 digits, orbit elements, filters, other units, users' models."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import losnav as ln
from losnav.constants import AU, SUN_MU
from losnav.errors import InvalidInputError
from losnav.observability import (
    analyze,
    crlb,
    empirical_gramian,
    estimation_condition,
    gramian,
    horizon_weighted,
    unobservability_index,
)
from tests.oracle import filter_models, information

# A bound by QR in double precision against 60 digits, in standard deviations, over tens of steps.
IN_SIGMA = 1e-9
# Sums of squares of the same rows, taken in another order.
SAME_SUM = 1e-12
# Elements against Cartesian coordinates: what the element-space sum loses by its own conditioning.
ELEMENTS = 3e-5
# Central differences of relative size 1e-4 of smooth functions.
FINITE_STEP = 1e-6

EYE = np.eye(3)
ELEMENTS_0 = (2e11, 0.25, *np.radians([23.0, 1.16, 108.89]), np.pi / 2 - 0.25)
STATE_0 = np.real(information.orbit_state(ELEMENTS_0, 0.0, SUN_MU))
PRIOR_0 = np.diag([6e8**2] * 3 + [50.0**2] * 3)
SUN = ln.dynamics.TwoBody(SUN_MU)
DIRECTION = ln.sensors.LineOfSight([[0.0, 0.0, 0.0]], 5e-5)


def in_sigma(found, expected):
    """Largest difference of two covariances in standard deviations of the second."""
    sigma = np.sqrt(np.diagonal(expected, axis1=-2, axis2=-1))
    return np.abs((found - expected) / sigma[..., None] / sigma[..., None, :]).max()


def rss(covariance):
    """Root of the summed variances of position and of velocity."""
    variances = np.diagonal(covariance, axis1=-2, axis2=-1)
    return np.sqrt(variances[..., :3].sum(-1)), np.sqrt(variances[..., 3:].sum(-1))


@dataclass(frozen=True)
class Rows:
    """A user's sensor: ``z = C x`` with correlated noise."""

    c: np.ndarray
    r: np.ndarray

    def predict(self, x):
        return self.c @ x

    def jacobian(self, x):
        return self.c

    def noise(self, x):
        return self.r


@dataclass(frozen=True)
class Own:
    """Any model or sensor, hidden behind a user's class: asked one state at a time."""

    it: object

    def __getattr__(self, name):
        method = getattr(self.it, name)

        def one(state, *args, **kwargs):
            assert np.ndim(state) == 1
            return method(state, *args, **kwargs)

        return one


def problem(seed, epochs=12, singular=True, scale=None):
    """A linear model with process noise on its rates only, two sensors, and what 60 digits say of them."""
    rng = np.random.default_rng(seed)
    a = np.zeros((6, 6))
    a[:3, 3:], a[3:, :3] = np.eye(3), 0.3 * rng.standard_normal((3, 3))
    g = np.concatenate([np.zeros((3, 3)), np.eye(3)]) if singular else np.eye(6)
    model = filter_models.Linear(a, g, 10.0 ** rng.uniform(-6, 0))
    root = rng.standard_normal((2, 2))
    sensors = [Rows(rng.standard_normal((2, 6)), root @ root.T + 0.1 * np.eye(2))]
    sensors += [Rows(rng.standard_normal((1, 6)), np.eye(1))]
    times = np.cumsum(rng.uniform(0.05, 0.4, epochs)) * rng.choice([-1.0, 1.0])
    seen = rng.random((2, epochs)) < 0.7
    p = rng.standard_normal((6, 6))
    return SimpleNamespace(
        model=model,
        sensors=sensors,
        pairs=[(s, mask) for s, mask in zip(sensors, seen, strict=True)],
        state=rng.standard_normal(6),
        times=times,
        seen=seen,
        prior=10.0 ** rng.uniform(-2, 4) * (p @ p.T + 0.1 * np.eye(6)),
    )


def ingredients(p):
    """Transitions, process noise and whitened rows of a problem, without losnav."""
    steps = np.diff(p.times)
    rows = []
    for k in range(len(p.times)):
        parts = [np.zeros((1, 6))]
        for sensor, mask in zip(p.sensors, p.seen, strict=True):
            if mask[k]:
                parts.append(np.linalg.solve(np.linalg.cholesky(sensor.r), sensor.c))
        rows.append(np.concatenate(parts))
    return [p.model.transition(None, d) for d in steps], [p.model.process_noise(None, d) for d in steps], rows


# --- against 60 digits ---------------------------------------------------------------------------------


@settings(max_examples=8)
@given(st.integers(0, 2**32), st.booleans())
def test_bound_of_a_users_model_is_that_of_sixty_digits(seed, singular):
    p = problem(seed, singular=singular)
    found = crlb(p.model, p.pairs, p.state, p.times, p.prior)
    expected = information.posterior_bounds(*ingredients(p), p.prior)
    assert in_sigma(found, expected) < IN_SIGMA


@settings(max_examples=8)
@given(st.integers(0, 2**32))
def test_gramian_of_a_users_model_is_that_of_sixty_digits(seed):
    p = problem(seed)
    transitions, _, rows = ingredients(p)
    expected = information.information(transitions, rows)
    found = gramian(p.model, p.pairs, p.state, p.times)
    assert np.abs(found - expected).max() < SAME_SUM * np.abs(expected).max()
    root = gramian(p.model, p.pairs, p.state, p.times, root=True)
    np.testing.assert_array_equal(np.tril(root, -1), 0)
    np.testing.assert_allclose(root.T @ root, found, rtol=0, atol=SAME_SUM * np.abs(found).max())


def test_mixed_units_seventeen_decades_apart():
    """Metres squared beside (m/s) squared of an orbit: a plain Kalman recursion has no digit to lose."""
    times = np.linspace(0.0, 1.8e7, 41)
    path = SUN.trajectory(STATE_0, times)
    rows = [h / 5e-5 for h in DIRECTION.jacobian(path, dcm=EYE)]
    transitions = SUN.transition(path[:-1], np.diff(times))
    expected = information.posterior_bounds(transitions, np.zeros((40, 6, 6)), rows, PRIOR_0)
    assert in_sigma(crlb(SUN, DIRECTION, STATE_0, times, PRIOR_0, dcm=EYE), expected) < 1e-7


# --- against orbit elements, and the figures of the published study ------------------------------------


@pytest.mark.parametrize(
    ("sign", "position", "velocity"), [(-1, 610e3, 0.127), (1, 2503e3, 0.328)], ids=["back", "forth"]
)
def test_the_two_published_arcs(sign, position, velocity):
    """Figures of spec and publication's conditions; equal to the Fisher information of the orbit elements."""
    times = sign * np.arange(0.0, 1.8e7 + 1, 1800.0)
    found = crlb(SUN, DIRECTION, STATE_0, times[1:], PRIOR_0, start=0.0, dcm=EYE)[-1]
    assert rss(found)[0] == pytest.approx(position, abs=0.5e3)  # the printed digits
    assert rss(found)[1] == pytest.approx(velocity, abs=0.5e-3)
    expected = information.sun_bound(ELEMENTS_0, times, 5e-5, PRIOR_0, SUN_MU)
    assert in_sigma(found, expected) < ELEMENTS


def test_more_information():
    """Sun every two hours, forward; with Doppler to it."""
    times = np.arange(0.0, 1.8e7 + 1, 7200.0)

    def position(*more):
        sensors = [DIRECTION, *(ln.sensors.RangeRate(sigma) for sigma in more)]
        return rss(crlb(SUN, sensors, STATE_0, times[1:], PRIOR_0, start=0.0, dcm=EYE)[-1])[0] / 1e3

    assert [position(), position(1.0), position(0.01)] == pytest.approx([5004, 779, 508], abs=0.6)


def test_a_planet_beside_the_sun():
    """Directions to a body that moves: 2.5 to 7 times better for any phase of a circular Earth."""
    times = np.arange(7200.0, 1.8e7 + 1, 7200.0)
    gains = []
    for phase in np.radians([0.0, 90.0, 180.0, 270.0]):
        angle = phase + np.sqrt(SUN_MU / AU**3) * times
        earth = AU * np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=-1)
        both = np.stack([np.zeros_like(earth), earth], axis=1)
        sensor = ln.sensors.LineOfSight(both[0], [5e-5, 5e-5])
        bound = crlb(SUN, sensor, STATE_0, times, PRIOR_0, start=0.0, dcm=EYE, landmarks=both)
        gains.append(5004e3 / rss(bound[-1])[0])
    assert 2.5 < min(gains) < max(gains) < 7


# --- against filters -----------------------------------------------------------------------------------


@pytest.mark.parametrize("sign", [1, -1])
def test_a_filter_linearised_at_the_truth_has_this_covariance(sign):
    model = ln.dynamics.TwoBody(SUN_MU, acceleration_psd=1e-9)
    times = sign * np.arange(0.0, 1.8e6 + 1, 7200.0)
    truth = SUN.trajectory(STATE_0, times)
    z = DIRECTION.predict(truth, dcm=EYE)
    z[3::5] = np.nan
    rate = ln.sensors.RangeRate(1.0)
    w = rate.predict(truth)
    w[::2] = np.nan
    ekf = ln.ExtendedKalmanFilter(model, STATE_0, PRIOR_0)
    log = ekf.run(times, [(DIRECTION, z), (rate, w)], dcm=EYE)
    bound = crlb(model, [(DIRECTION, z), (rate, w)], STATE_0, times, PRIOR_0, dcm=EYE)
    assert in_sigma(log.covariance, bound) < 1e-8
    masks = [(DIRECTION, np.isfinite(z[:, 0])), (rate, np.isfinite(w[:, 0]))]
    np.testing.assert_array_equal(bound, crlb(model, masks, STATE_0, times, PRIOR_0, dcm=EYE))


# --- units, batches, users' own ------------------------------------------------------------------------


@settings(max_examples=10)
@given(st.integers(0, 2**32), st.lists(st.floats(-6, 6), min_size=6, max_size=6))
def test_units_do_not_matter(seed, exponents):
    p = problem(seed)
    unit = 10.0 ** np.array(exponents)
    there, back = np.diag(1 / unit), np.diag(unit)
    model = SimpleNamespace(
        propagate=lambda x, dt: there @ p.model.propagate(back @ x, dt),
        transition=lambda x, dt: there @ p.model.transition(None, dt) @ back,
        process_noise=lambda x, dt: there @ p.model.process_noise(None, dt) @ there,
    )
    pairs = [(Rows(s.c @ back, s.r), mask) for s, mask in p.pairs]
    arguments = pairs, there @ p.state, p.times
    bound = crlb(p.model, p.pairs, p.state, p.times, p.prior)
    changed = crlb(model, *arguments, there @ p.prior @ there)
    assert in_sigma(changed * unit * unit[:, None], bound) < IN_SIGMA
    whole, information_there = gramian(p.model, p.pairs, p.state, p.times), gramian(model, *arguments)
    sigma = np.sqrt(np.diagonal(whole))
    assert np.abs((information_there / unit / unit[:, None] - whole) / sigma / sigma[:, None]).max() < 1e-11
    scaled = gramian(model, *arguments, scale=1 / unit)
    np.testing.assert_allclose(scaled, whole, rtol=0, atol=1e-11 * np.abs(whole).max())


@pytest.mark.parametrize("noisy", [False, True])
def test_built_in_and_own_are_the_same(noisy):
    model = ln.dynamics.TwoBody(SUN_MU, acceleration_psd=1e-10 if noisy else 0.0)
    rng = np.random.default_rng(3)
    states = STATE_0 * (1 + 0.1 * rng.standard_normal((2, 3, 6)))
    times = np.arange(0.0, 3e6, 1e5)
    turned = ln.attitude.dcm_from_mrp(0.1 * rng.standard_normal((len(times), 3)))
    sensors = [DIRECTION, ln.sensors.RangeBearing(1e3, 1e-4, target=[0.0, 1e9, 0.0])]
    control = 1e-4 * rng.standard_normal((len(times) - 1, 3))
    own = [Own(s) for s in sensors]
    fast = crlb(model, sensors, states, times, PRIOR_0, dcm=turned, controls=control)
    assert fast.shape == (2, 3, 30, 6, 6)
    slow = crlb(Own(model), own, states, times, PRIOR_0, dcm=turned, controls=control)
    assert in_sigma(fast, slow) < IN_SIGMA
    alone = crlb(model, sensors, states[1, 2], times, PRIOR_0, dcm=turned, controls=control)
    assert in_sigma(fast[1, 2], alone) < IN_SIGMA
    fast = gramian(model, sensors, states, times, dcm=turned, controls=control)
    slow = gramian(Own(model), own, states, times, dcm=turned, controls=control)
    np.testing.assert_allclose(fast, slow, rtol=0, atol=SAME_SUM * np.abs(slow).max(axis=(-2, -1)).min())
    # As the filter takes them: an entry for each epoch, the first acting before it.
    longer = np.concatenate([np.full((1, 3), 9.9), control])
    np.testing.assert_array_equal(
        gramian(model, sensors, states[0], times, dcm=turned, controls=longer), fast[0]
    )


def test_epoch_of_the_state():
    """A state at ``start`` is the same as an epoch at which nothing is measured; attitudes go with it."""
    times = np.arange(1e5, 3e6, 1e5)
    turned = ln.attitude.dcm_from_mrp(0.1 * np.random.default_rng(1).standard_normal((len(times), 3)))
    model = ln.dynamics.TwoBody(SUN_MU, acceleration_psd=1e-10)
    found = crlb(model, DIRECTION, STATE_0, times, PRIOR_0, start=0.0, dcm=turned)
    every, attitudes = np.concatenate([[0.0], times]), np.concatenate([EYE[None], turned])
    seen = np.arange(len(every)) > 0
    expected = crlb(model, [(DIRECTION, seen)], STATE_0, every, PRIOR_0, dcm=attitudes)
    np.testing.assert_array_equal(found, expected[1:])
    a = gramian(model, DIRECTION, STATE_0, times, start=0.0, dcm=turned)
    np.testing.assert_array_equal(a, gramian(model, [(DIRECTION, seen)], STATE_0, every, dcm=attitudes))


def test_only_what_lies_across_a_direction_is_measured():
    """Three components, two across the direction, and three without noise along it: one information."""
    times = np.arange(0.0, 3e6, 1e5)

    def across(x):
        return np.linalg.svd(x[None, :3])[2][1:]

    @dataclass(frozen=True)
    class Two:
        def jacobian(self, x, dcm):
            return across(x) @ DIRECTION.jacobian(x, dcm=dcm)

        def noise(self, x, dcm):
            return 5e-5**2 * np.eye(2)

    @dataclass(frozen=True)
    class Flat:
        def jacobian(self, x, dcm):
            return DIRECTION.jacobian(x, dcm=dcm)

        def noise(self, x, dcm):
            return 5e-5**2 * across(x).T @ across(x)

    expected = crlb(SUN, DIRECTION, STATE_0, times, PRIOR_0, dcm=EYE)
    for sensor in (Two(), Flat()):
        assert in_sigma(crlb(SUN, sensor, STATE_0, times, PRIOR_0, dcm=EYE), expected) < IN_SIGMA


def test_parts_of_a_measurement():
    """Columns of a mask; what is not seen is as if the sensor did not have it."""
    p = problem(5)
    c, r = np.eye(4, 6), np.eye(4) + 0.4
    mask = np.random.default_rng(0).random((12, 4)) < 0.5
    found = crlb(p.model, [(Rows(c, r), mask)], p.state, p.times, p.prior)

    @dataclass
    class Changing:
        k: int = -1

        def jacobian(self, x):
            self.k += 1
            return np.where(mask[self.epochs[self.k]][:, None], c, 0.0)

        def noise(self, x):
            m = mask[self.epochs[self.k]]
            return np.where(np.outer(m, m), r, np.eye(4))

    other = Changing()
    other.epochs = range(12)
    assert in_sigma(crlb(p.model, other, p.state, p.times, p.prior), found) < IN_SIGMA


# --- states with an attitude ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Gliding:
    """A body that moves straight on and does not turn: a user's model of a navigation state."""

    psd: float
    size: int = 9

    def propagate(self, x, dt, control=None):
        return ln.NavState(x.position + dt * x.velocity, x.velocity, x.quaternion)

    def transition(self, x, dt, control=None):
        phi = np.eye(self.size)
        phi[:3, 3:6] = dt * np.eye(3)
        return phi

    def process_noise(self, x, dt):
        q = np.zeros((self.size, self.size))
        dt = abs(dt)
        q[:6, :6] = self.psd * np.kron([[dt**3 / 3, dt**2 / 2], [dt**2 / 2, dt]], np.eye(3))
        q[6:9, 6:9] = 1e-9 * dt * np.eye(3)
        return q


MARKS = np.array([[50.0, 0.0, 0.0], [-40.0, 30.0, 5.0], [0.0, -60.0, 10.0], [20.0, 45.0, 0.0]])


def test_a_state_with_an_attitude():
    """Landmarks from a camera, one of them unseen at times: as a filter of the same model would have it."""
    camera = ln.sensors.LandmarkCamera(MARKS, 500.0, 0.5)
    start = ln.NavState.from_dcm([5.0, -3.0, 200.0], [0.5, 0.2, -3.0], np.diag([1.0, -1.0, -1.0]))
    times = np.arange(0.0, 30.0, 1.0)
    prior = np.diag([25.0] * 3 + [0.25] * 3 + [1e-4] * 3)
    states = [start]
    for _ in times[1:]:
        states.append(Gliding(1e-4).propagate(states[-1], 1.0))
    z = np.array([camera.predict(x) for x in states])
    z[::3, 2:4] = np.nan
    rows = []
    for x, measured in zip(states, z, strict=True):
        seen = np.isfinite(measured)
        rows.append(camera.jacobian(x)[seen, :9] / 0.5)
    model = Gliding(1e-4)
    steps = [model.transition(None, 1.0)] * 29, [model.process_noise(None, 1.0)] * 29
    expected = information.posterior_bounds(*steps, rows, prior)
    assert in_sigma(crlb(model, [(camera, z)], start, times, prior), expected) < IN_SIGMA
    # A model that carries biases and an acceleration: columns of the sensor are put where they belong.
    larger = np.zeros((18, 18))
    larger[:9, :9], larger[9:, 9:] = prior, np.eye(9)
    found = crlb(Gliding(1e-4, 18), [(camera, z)], start, times, larger)
    assert in_sigma(found[:, :9, :9], expected) < IN_SIGMA
    np.testing.assert_allclose(found[-1, 9:, 9:], np.eye(9), atol=1e-12)
    exact = gramian(model, camera, start, times)
    moved = empirical_gramian(model, camera, start, times, [0.01] * 3 + [0.001] * 3 + [1e-5] * 3)
    size = np.sqrt(np.diagonal(exact))
    assert np.abs((moved - exact) / size / size[:, None]).max() < FINITE_STEP


@pytest.mark.parametrize("biases", [False, True])
def test_inertial_navigation(biases):
    """Above Eros by landmarks: the covariance of a filter that flies at the truth, image by image."""
    site = ln.dynamics.Site.on_body(0.0349, 0.0, 15116.0, ln.gravity.eros.ROTATION_RATE)
    field = ln.gravity.eros.five_terms(brillouin_radius=0.0)
    model = ln.dynamics.Strapdown(site, field, ln.dynamics.Imu.navigation(), biases=biases)
    start = ln.NavState.from_dcm([100.0, -50.0, 2000.0], [0.5, 0.2, -3.0], np.diag([1.0, -1.0, -1.0]))
    hover = start.dcm @ np.stack(
        [-model.free_acceleration(start.position, start.velocity), site.angular_velocity], axis=-1
    )
    times = 0.5 * np.arange(101)
    controls = hover.T.ravel() + 1e-4 * np.random.default_rng(2).standard_normal((101, 6))
    truth = model.trajectory(start, times, controls[1:])
    camera = ln.sensors.LandmarkCamera(8 * MARKS, 500.0, 0.5)
    z = camera.predict(truth)
    z[np.arange(101) % 10 != 0] = np.nan
    z[::30, 2:4] = np.nan
    prior = np.diag([100.0] * 3 + [0.01] * 3 + [1e-4] * 3 + ([1e-8] * 3 + [1e-12] * 3 if biases else []))
    bound = crlb(model, [(camera, z)], start, times, prior, controls=controls)
    log = ln.ExtendedKalmanFilter(model, start, prior).run(times, [(camera, z)], controls=controls)
    assert in_sigma(log.covariance, bound) < IN_SIGMA


# --- what cannot be known ------------------------------------------------------------------------------


def test_without_a_prior_the_bound_starts_where_the_state_is_determined():
    """Two components of four epochs' directions: six unknowns need the fourth, for lack of curvature."""
    times = np.arange(0.0, 1.8e7, 7200.0)
    bound = crlb(SUN, DIRECTION, STATE_0, times, dcm=EYE)
    unknown = np.isinf(np.diagonal(bound, axis1=-2, axis2=-1)).any(axis=-1)
    assert unknown[:3].all()
    assert not unknown[8:].any()
    # A prior that says next to nothing.
    vague = crlb(SUN, DIRECTION, STATE_0, times, np.diag([1e14**2] * 3 + [1e8**2] * 3), dcm=EYE)
    assert in_sigma(bound[100:], vague[100:]) < 1e-6
    information_0 = gramian(SUN, DIRECTION, STATE_0, times, dcm=EYE)
    scale = 1 / np.sqrt(np.diagonal(information_0))
    inverse = np.linalg.inv(information_0 * scale * scale[:, None]) * scale * scale[:, None]
    phi = SUN.transition(STATE_0, times[-1])
    assert in_sigma(phi @ inverse @ phi.T, bound[-1]) < 1e-6


def test_straight_to_the_sun_nothing_tells_the_distance():
    """Rectilinear motion: rank 4; what lies across stays bounded."""
    state = np.array([2e11, 0.0, 0.0, 1e4, 0.0, 0.0])
    times = np.arange(0.0, 1e7, 1e5)
    bound = crlb(SUN, DIRECTION, state, times, dcm=EYE)
    diagonal = np.diagonal(bound, axis1=-2, axis2=-1)
    assert np.isinf(diagonal[:, [0, 3]]).all()
    assert np.isfinite(diagonal[2:, [1, 2, 4, 5]]).all()
    assert np.isnan(bound[-1, 0, 1:3]).all()
    root = gramian(SUN, DIRECTION, state, times, dcm=EYE, root=True)
    assert analyze(root, scale=[1e11] * 3 + [1e4] * 3, tolerance=1e-10).rank == 4


def test_a_component_without_a_prior():
    p = problem(7)
    wide = p.prior.copy()
    wide[2] = wide[:, 2] = 0.0
    expected = wide.copy()
    wide[2, 2], expected[2, 2] = np.inf, 1e14
    found = crlb(p.model, p.sensors, p.state, p.times, wide)
    assert in_sigma(found[5:], crlb(p.model, p.sensors, p.state, p.times, expected)[5:]) < 1e-6


W = 1.04248275e-3
RENDEZVOUS = np.array([-520.0, 10.0, 20.0, -0.0324, -0.02, 0.02])


def angles_only(control=None):
    model = ln.dynamics.ClohessyWiltshire(W)
    camera = ln.sensors.LineOfSight([[0.0, 0.0, 0.0]], 5e-4)
    times = np.arange(0.0, 6000.0, 60.0)
    root = gramian(model, camera, RENDEZVOUS, times, controls=control, dcm=EYE, root=True)
    return analyze(root, scale=[1.0] * 3 + [W] * 3)


def test_angles_alone_do_not_tell_the_distance():
    """A linear model: twice the state is seen in the same directions."""
    still = angles_only()
    assert still.rank == 5
    along = still.unobservable[:, 0] / still.scale
    expected = RENDEZVOUS / still.scale
    cosine = abs(along @ expected) / np.linalg.norm(along) / np.linalg.norm(expected)
    assert 1 - cosine < 1e-12
    assert still.degree < 1e-14


def test_an_impulse_tells_it():
    """0.1 m/s along the track, ten minutes into the arc."""
    burn = np.zeros((99, 3))
    burn[10, 0] = 0.1 / 60
    told = angles_only(burn)
    assert told.rank == 6
    assert told.degree == pytest.approx(1.3e-3, abs=0.05e-3)


# --- other Gramians and indices ------------------------------------------------------------------------


def test_small_moves_give_the_gramian():
    times = np.arange(0.0, 1.8e7, 1e5)
    sensors = [DIRECTION, (ln.sensors.RangeRate(1.0), np.arange(len(times)) % 3 == 0)]
    exact = gramian(SUN, sensors, STATE_0, times, dcm=EYE)
    scale = np.array([1e7] * 3 + [1.0] * 3)
    moved = empirical_gramian(SUN, sensors, STATE_0, times, scale, dcm=EYE)
    size = np.sqrt(np.diagonal(exact))
    assert np.abs((moved - exact) / size / size[:, None]).max() < FINITE_STEP
    own = empirical_gramian(
        Own(SUN), [Own(DIRECTION), (Own(sensors[1][0]), sensors[1][1])], STATE_0, times, scale, dcm=EYE
    )
    np.testing.assert_allclose(own, moved, rtol=1e-6, atol=1e-9 * np.abs(moved).max())


def test_angles_are_compared_the_short_way():
    """A target in the direction where the azimuth jumps."""
    model = ln.dynamics.ClohessyWiltshire(W)
    camera = ln.sensors.RangeBearing(0.2, 1e-3)
    state, times = [500.0, 0.0, 0.0, 0.0, 0.0, 0.0], np.arange(0.0, 300.0, 60.0)
    exact = gramian(model, camera, state, times, dcm=EYE)
    moved = empirical_gramian(model, camera, state, times, [0.01] * 3 + [1e-4] * 3, dcm=EYE)
    np.testing.assert_allclose(moved, exact, rtol=0, atol=1e-6 * np.abs(exact).max())


def test_indices():
    rng = np.random.default_rng(4)
    a = rng.standard_normal((3, 8, 4))
    w = np.swapaxes(a, -1, -2) @ a
    values = np.linalg.eigvalsh(w)
    np.testing.assert_allclose(unobservability_index(w), 1 / values[:, 0])
    np.testing.assert_allclose(estimation_condition(w), values[:, -1] / values[:, 0])
    unit = 10.0 ** np.arange(4)
    np.testing.assert_allclose(unobservability_index(w / unit / unit[:, None], scale=unit), 1 / values[:, 0])
    lost = np.diag([1.0, 0.0])
    assert unobservability_index(lost) == estimation_condition(lost) == np.inf


def test_weights_of_derivatives():
    lie = np.arange(24.0).reshape(2, 6, 2)
    found = horizon_weighted(lie, 3.0, 2, scale=[1.0, 2.0])
    expected = lie * np.repeat([1.0, 3.0, 4.5], 2)[:, None] * [1.0, 2.0]
    np.testing.assert_array_equal(found, expected)


# --- the doorway ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"dynamics": object()}, "dynamics"),
        ({"sensor": object()}, "sensor"),
        ({"sensor": [DIRECTION, object()]}, r"sensor\[1\]"),
        ({"sensor": [(DIRECTION, [True])]}, r"sensor\[0\]"),
        ({"times": [[0.0]]}, "times"),
        ({"times": []}, "times"),
        ({"times": [0.0, np.nan]}, "times"),
        ({"state": 1.0}, "state"),
        ({"state": np.full(6, np.nan)}, "state"),
        ({"prior": np.eye(5)}, "prior"),
        ({"prior": -np.eye(6)}, "prior"),
        ({"prior": np.diag([1.0, 1, 1, 1, 1, 0])}, "prior"),
        ({"controls": np.zeros((7, 3))}, "controls"),
    ],
)
def test_bad_input(change, word):
    arguments = {"dynamics": SUN, "sensor": DIRECTION, "state": STATE_0, "times": [0.0, 1e5], **change}
    with pytest.raises(InvalidInputError, match=word):
        crlb(**arguments, dcm=EYE)
    if "prior" not in change:
        with pytest.raises(InvalidInputError, match=word):
            gramian(**arguments, dcm=EYE)


def test_models_that_make_no_sense():
    p = problem(1)
    still = SimpleNamespace(
        propagate=lambda x, dt: x,
        transition=lambda x, dt: np.zeros((6, 6)),
        process_noise=lambda x, dt: np.eye(6),
    )
    with pytest.raises(InvalidInputError, match="transition"):
        crlb(still, p.sensors, p.state, p.times, p.prior)
    with pytest.raises(InvalidInputError, match="jacobian"):
        crlb(p.model, Rows(np.eye(5), np.eye(5)), p.state, p.times, p.prior)
    with pytest.raises(InvalidInputError, match="noise"):
        crlb(p.model, Rows(np.eye(2, 6), np.diag([1.0, -1.0])), p.state, p.times, p.prior)
    with pytest.raises(InvalidInputError, match="noise"):
        crlb(p.model, Rows(np.eye(2, 6), np.diag([1.0, 0.0])), p.state, p.times, p.prior)


def test_one_epoch():
    bound = crlb(SUN, DIRECTION, STATE_0, [5.0], PRIOR_0, dcm=EYE)
    h = DIRECTION.jacobian(STATE_0, dcm=EYE) / 5e-5
    scale = np.diag([1e9] * 3 + [1e2] * 3)
    expected = scale @ np.linalg.inv(scale @ (h.T @ h + np.linalg.inv(PRIOR_0)) @ scale) @ scale
    assert in_sigma(bound[0], expected) < 1e-6
    own = crlb(Own(SUN), Own(DIRECTION), STATE_0, [5.0], PRIOR_0, dcm=EYE)
    assert in_sigma(own, bound) < IN_SIGMA
