"""Strapdown at the door: bad input, copies, warnings."""

import copy
import pickle

import numpy as np
import pytest

import losnav as ln
from losnav.gravity import eros

SITE = ln.dynamics.Site.on_body(0.0349, 0.0, 15116.0, eros.ROTATION_RATE)
IMU = ln.dynamics.Imu.navigation()
FIELD = ln.gravity.PointMass(eros.MU)
STATE = ln.NavState([0.0, 0.0, 2000.0], [0.0, 0.0, -5.0], [0.0, 0.0, 0.0, 1.0])
ZERO = np.zeros(3)


def model(**options):
    return ln.dynamics.Strapdown(SITE, FIELD, IMU, **options)


class Twice(ln.gravity.PointMass):
    """Means something else than the engine thinks."""

    def acceleration(self, r):
        return 2.0 * super().acceleration(r)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ln.dynamics.Strapdown(None, FIELD, IMU), "site: expected a losnav Site, got NoneType"),
        (lambda: ln.dynamics.Strapdown(SITE, FIELD, 1e-4), "imu: expected a losnav Imu, got float"),
        (lambda: ln.dynamics.Strapdown(SITE, lambda r: -r, IMU), "gravity: expected one of losnav.gravity's"),
        (lambda: ln.dynamics.Strapdown(SITE, Twice(1.0), IMU), "gravity: expected one of.* got Twice"),
        (lambda: model(acceleration=1e-3), "acceleration: expected a GaussMarkov or None, got float"),
        (lambda: model(acceleration_psd=-1.0), "acceleration_psd: expected a number >= 0"),
        (lambda: model().propagate(np.zeros(6), 0.1), "state: expected a NavState, got ndarray"),
        (lambda: model().propagate(STATE, [0.1, np.nan]), r"dt\[1\]: expected a finite number"),
        (
            lambda: model().propagate(STATE, 0.1, ZERO),
            r"control: expected \(specific_force, angular_rate\) or shape \(\.\.\., 6\), got \(3,\)",
        ),
        (
            lambda: model().propagate(STATE, 0.1, (ZERO, [np.inf, 0, 0])),
            r"control\[3\]: expected a finite",
        ),
        (
            lambda: model().propagate(STATE, 0.1, (np.zeros((2, 3)), np.zeros((3, 3)))),
            r"control: shapes \(2, 3\) and \(3, 3\) do not broadcast",
        ),
        (lambda: model().propagate(STATE, np.zeros(2), np.zeros((3, 6))), "do not broadcast.*control.*dt"),
        (lambda: model().trajectory(STATE, 0.0), r"times: expected shape \(T,\)"),
        (
            lambda: model().trajectory(STATE, [0, 1, 2], np.zeros((3, 6))),
            "control: expected one sample or one",
        ),
        (lambda: model().trajectory(STATE, [0, 1], longest_step=0.0), "longest_step: expected a number > 0"),
        (lambda: model().free_acceleration([0, 0], ZERO), "position: expected shape"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(ln.InvalidInputError, match=message):
        call()


def test_the_result_is_a_number_or_an_error():
    """At the centre of a point mass there is none."""
    center = ln.NavState([0.0, 0.0, -15116.0], ZERO, [0.0, 0.0, 0.0, 1.0])
    with pytest.raises(ln.InvalidInputError, match="not a finite number"):
        model().propagate(center, 0.1)


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))])
def test_copies_and_pickles(duplicate):
    original = model(acceleration=ln.dynamics.GaussMarkov(1e-3, 300.0), biases=False)
    twin = duplicate(original)
    control = np.array([1e-3, 2e-3, 3e-3, 0.01, 0.02, 0.03])
    np.testing.assert_array_equal(
        twin.transition(STATE, 0.1, control), original.transition(STATE, 0.1, control)
    )
    np.testing.assert_array_equal(
        twin.process_noise(STATE, 0.1, control), original.process_noise(STATE, 0.1, control)
    )
    assert repr(twin).startswith("Strapdown(site=Site(")
    assert "object at 0x" not in repr(twin)


def test_frozen():
    with pytest.raises(AttributeError):
        model().imu = None


def test_harmonics_warn_when_the_site_is_inside_the_sphere():
    with pytest.warns(ln.gravity.BrillouinWarning, match="15116 m from the centre"):
        ln.dynamics.Strapdown(SITE, eros.five_terms(), IMU)
    ln.dynamics.Strapdown(SITE, eros.five_terms(brillouin_radius=0.0), IMU)
    far = ln.dynamics.Site.on_body(0.0, 0.0, 18e3, eros.ROTATION_RATE)
    ln.dynamics.Strapdown(far, eros.five_terms(), IMU)


def test_forms_of_the_control():
    """A pair, an array, a list: the same."""
    force, rate = np.array([1e-3, 2e-3, 3e-3]), np.array([0.01, 0.02, 0.03])
    expected = model().propagate(STATE, 0.1, (force, rate))
    for control in ((force.tolist(), rate.tolist()), np.concatenate([force, rate]), [*force, *rate]):
        np.testing.assert_array_equal(model().propagate(STATE, 0.1, control).velocity, expected.velocity)
    batch = model().propagate(STATE, 0.1, (np.tile(force, (4, 1)), rate))
    assert batch.shape == (4,)


def test_empty_batches():
    none = ln.NavState(np.zeros((0, 3)), ZERO, [0.0, 0.0, 0.0, 1.0])
    assert model().propagate(none, 0.1).shape == (0,)
    assert model().transition(none, 0.1).shape == (0, 15, 15)
    assert model().trajectory(none, [0.0, 1.0]).shape == (0, 2)
    assert model().trajectory(STATE, [0.0]).shape == (1,)
