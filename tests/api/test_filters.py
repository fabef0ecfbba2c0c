"""What the filters refuse: one error that names the argument, and a filter that is as it was."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

import losnav as ln

ORBIT = ln.dynamics.ClohessyWiltshire(1.04e-3, 1e-9)
CAMERA = ln.sensors.RangeBearing(0.2, 6e-4)
MARKS = ln.sensors.LineOfSight([[0.0, 0, 50], [40, 0, 0]], 1e-3)
STATE = np.array([-510.0, 0, 10, 0, 0, 0])
PRIOR = np.diag([100.0] * 3 + [0.0025] * 3)
LOOK = [510.0, 0.0, 0.02]


def made(**changes):
    arguments = {"dynamics": ORBIT, "state": STATE, "covariance": PRIOR} | changes
    return ln.ExtendedKalmanFilter(
        arguments.pop("dynamics"), arguments.pop("state"), arguments.pop("covariance"), **arguments
    )


def skewed():
    p = PRIOR.copy()
    p[0, 1] = 5.0
    return p


@pytest.mark.parametrize(
    ("changes", "argument"),
    [
        ({"state": STATE[:5]}, "state"),
        ({"state": 5.0}, "state"),
        ({"state": []}, "state"),
        ({"state": [*STATE[:5], np.nan]}, r"state\[5\]"),
        ({"state": "here"}, "state"),
        ({"state": STATE + 1j}, "state"),
        ({"covariance": np.eye(5)}, "covariance"),
        ({"covariance": np.ones(6)}, "covariance"),
        ({"covariance": -PRIOR}, "covariance"),
        ({"covariance": np.ones((6, 6))}, "covariance"),
        ({"covariance": skewed()}, "covariance"),
        ({"covariance": np.full((6, 6), np.inf)}, r"covariance\[0, 0\]"),
        ({"covariance": np.zeros((6, 6))}, "covariance"),
        ({"gate": 0.0}, "gate"),
        ({"gate": -3.0}, "gate"),
        ({"gate": np.nan}, "gate"),
        ({"gate": "tight"}, "gate"),
        ({"relock_after": -1}, "relock_after"),
        ({"relock_after": 1.5}, "relock_after"),
        ({"iterations": 0}, "iterations"),
        ({"iterations": None}, "iterations"),
        ({"underweighting": -0.1}, "underweighting"),
        ({"underweighting": np.nan}, "underweighting"),
        ({"form": "cholesky"}, "form"),
        ({"consider": [6]}, "consider"),
        ({"consider": [-7]}, "consider"),
        ({"consider": [0.5]}, "consider"),
        ({"time": np.nan}, "time"),
    ],
)
def test_what_is_refused_at_the_start(changes, argument):
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        made(**changes)


@pytest.mark.parametrize("form", ["joseph", "ud"])
@pytest.mark.parametrize(
    ("call", "argument"),
    [
        (lambda f: f.predict(np.nan), "dt"),
        (lambda f: f.predict([1.0, 2.0]), "dt"),
        (lambda f: f.predict("soon"), "dt"),
        (lambda f: f.predict(1.0, [1.0, 2.0]), "control"),
        (lambda f: f.predict(1.0, [1.0, 2.0, np.inf]), "control"),
        (lambda f: f.update(CAMERA, LOOK[:2], dcm=np.eye(3)), "z"),
        (lambda f: f.update(CAMERA, [LOOK], dcm=np.eye(2)), "dcm"),
        (lambda f: f.update(CAMERA, LOOK), "dcm"),
        (lambda f: f.update(CAMERA, LOOK, dcm=2 * np.eye(3)), "dcm"),
        (lambda f: f.update(CAMERA, LOOK, dcm=np.diag([1.0, 1, -1])), "dcm"),
        (lambda f: f.update(CAMERA, [np.inf, 0, 0], dcm=np.eye(3)), "z"),
        (lambda f: f.update(CAMERA, "LOOK", dcm=np.eye(3)), "z"),
        (lambda f: f.update(MARKS, np.zeros(3), dcm=np.eye(3)), "z"),
        (lambda f: f.update(MARKS, np.ones(6), dcm=np.eye(3), landmarks=[1.0, 2.0]), "landmarks"),
        (lambda f: f.step(np.inf, CAMERA, LOOK, dcm=np.eye(3)), "dt"),
        (lambda f: f.run([[1.0]], [(CAMERA, [LOOK])], dcm=np.eye(3)), "times"),
        (lambda f: f.run([np.nan], [(CAMERA, [LOOK])], dcm=np.eye(3)), "times"),
        (lambda f: f.run([1.0, 2.0], [(CAMERA, [LOOK])], dcm=np.eye(3)), r"measurements\[0\]"),
        (lambda f: f.run([1.0], [(CAMERA, [LOOK]), (CAMERA, [[1.0]])], dcm=np.eye(3)), r"measurements\[1\]"),
        (lambda f: f.run([1.0], [(CAMERA, [[np.inf, 0, 0]])], dcm=np.eye(3)), r"measurements\[0\]"),
        (lambda f: f.run([1.0], [(CAMERA, [LOOK])]), "dcm"),
        (lambda f: f.run([1.0], [(CAMERA, [LOOK])], dcm=np.zeros((2, 3, 3))), "dcm"),
        (lambda f: f.run([1.0], [(CAMERA, [LOOK])], np.zeros((2, 3)), dcm=np.eye(3)), "controls"),
        (lambda f: f.run([1.0], [(CAMERA, [LOOK])], np.full((1, 3), np.nan), dcm=np.eye(3)), "controls"),
        (
            lambda f: f.run(
                [1.0], [(CAMERA, np.zeros((2, 1, 3))), (CAMERA, np.zeros((3, 1, 3)))], dcm=np.eye(3)
            ),
            r"measurements\[1\]",
        ),
    ],
)
def test_what_is_refused_changes_nothing(call, argument, form):
    filter_ = made(form=form)
    before = filter_.state.tobytes(), filter_.covariance.tobytes(), filter_.time
    with pytest.raises(ln.InvalidInputError, match=f"^{argument}"):
        call(filter_)
    assert (filter_.state.tobytes(), filter_.covariance.tobytes(), filter_.time) == before


def test_undefined_geometry_is_an_error_and_changes_nothing():
    filter_ = made(state=np.zeros(6))
    before = filter_.state.tobytes(), filter_.covariance.tobytes(), filter_.time
    with pytest.raises((ln.DegenerateGeometryError, ln.InvalidInputError)):
        filter_.update(CAMERA, LOOK, dcm=np.eye(3))
    with pytest.raises((ln.DegenerateGeometryError, ln.InvalidInputError)):
        filter_.step(0.0, CAMERA, LOOK, dcm=np.eye(3))
    assert (filter_.state.tobytes(), filter_.covariance.tobytes(), filter_.time) == before


@pytest.mark.parametrize(
    ("missing", "call"), [("propagate", "predict"), ("transition", "predict"), ("process_noise", "predict")]
)
def test_half_a_model_is_refused(missing, call):
    methods = {name: getattr(ORBIT, name) for name in ("propagate", "transition", "process_noise")}
    half = type("Half", (), {n: staticmethod(m) for n, m in methods.items() if n != missing})()
    with pytest.raises(ln.InvalidInputError, match=missing):
        getattr(made(dynamics=half), call)(1.0)


@pytest.mark.parametrize("missing", ["predict", "jacobian", "noise"])
def test_half_a_sensor_is_refused(missing):
    methods = {name: getattr(CAMERA, name) for name in ("predict", "jacobian", "noise")}
    half = type("Half", (), {n: staticmethod(m) for n, m in methods.items() if n != missing})()
    with pytest.raises(ln.InvalidInputError, match=missing):
        made().update(half, LOOK, dcm=np.eye(3))


def test_results_say_what_they_are():
    filter_ = made(gate=0.999)
    step = filter_.step(60.0, CAMERA, LOOK, dcm=np.eye(3))
    assert "ExtendedKalmanFilter" in repr(filter_)
    assert "object at 0x" not in repr(step)
    log = filter_.run([120.0, 180.0], [(CAMERA, [LOOK, LOOK])], dcm=np.eye(3))
    assert "object at 0x" not in repr(log)
    assert log.innovation.shape == (2, 3)
    assert log.dof.tolist() == [3]


# --- the surface user code is written against --------------------------------------------------------------


@pytest.mark.parametrize("kind", [ln.ExtendedKalmanFilter, ln.UnscentedKalmanFilter])
@pytest.mark.parametrize(
    ("method", "expected"),
    [
        ("predict", ["dt", "control"]),
        ("update", ["sensor", "z", "context"]),
        ("step", ["dt", "sensor", "z", "control", "context"]),
        ("run", ["times", "measurements", "controls", "context"]),
    ],
)
def test_methods(kind, method, expected):
    found = inspect.signature(getattr(kind, method)).parameters
    assert list(found)[1:] == expected
    for optional in {"control", "controls"} & set(found):
        assert found[optional].default is None


@pytest.mark.parametrize("kind", [ln.ExtendedKalmanFilter, ln.UnscentedKalmanFilter])
def test_making_one(kind):
    found = inspect.signature(kind).parameters
    assert list(found)[:3] == ["dynamics", "state", "covariance"]
    defaults = {"gate": None, "relock_after": 3}
    if kind is ln.ExtendedKalmanFilter:
        defaults |= {"iterations": 1, "underweighting": 0.0, "form": "joseph"}
    for name, default in defaults.items():
        assert found[name].kind is inspect.Parameter.KEYWORD_ONLY
        assert found[name].default == default


@pytest.mark.parametrize("kind", [ln.ExtendedKalmanFilter, ln.UnscentedKalmanFilter])
def test_shapes(kind):
    """One run and many, a measurement and none."""
    filter_ = kind(ORBIT, STATE, PRIOR)
    step = filter_.step(60.0, CAMERA, LOOK, dcm=np.eye(3))
    assert step.innovation.shape == (3,)
    assert step.innovation_covariance.shape == (3, 3)
    assert step.gain.shape == (6, 3)
    assert np.ndim(step.nis) == 0
    assert bool(step.accepted)
    nothing = filter_.update(CAMERA, [np.nan] * 3, dcm=np.eye(3))
    assert np.isnan(nothing.nis)
    assert not nothing.accepted
    assert filter_.state.shape == (6,)
    assert filter_.covariance.shape == (6, 6)
    times, z = np.array([120.0, 180.0]), np.tile(LOOK, (4, 2, 1))
    for lead, measured in (((), z[0]), ((4,), z)):
        log = kind(ORBIT, STATE, PRIOR).run(times, [(CAMERA, measured)], dcm=np.eye(3))
        assert log.time.shape == (2,)
        assert log.state.shape == (*lead, 2, 6)
        assert log.covariance.shape == (*lead, 2, 6, 6)
        assert log.nis.shape == log.accepted.shape == (*lead, 2, 1)
        assert log.innovation.shape == (*lead, 2, 3)
        assert log.smooth().state.shape == (*lead, 2, 6)
        assert ln.consistency.nees(log, log.state).mean == 0
        assert ln.consistency.nis(log).value.shape == (*lead, 2)


class Drag(ln.dynamics.TwoBody):
    """A user's orbit that loses a little speed."""

    def propagate(self, state, dt, control=None, **known):
        moved = super().propagate(state, dt, control, **known).copy()
        moved[..., 3:] *= 1 - 1e-9 * dt
        return moved


class Biased(ln.sensors.Range):
    """A user's range that is a metre too long."""

    def predict(self, state, **context):
        return super().predict(state, **context) + 1.0


def test_a_users_subclass_is_asked_itself():
    x = np.array([7.0e6, 0.0, 0.0, 0.0, 7.5e3, 0.0])
    mu = 3.986004418e14
    mine, plain = Drag(mu), ln.dynamics.TwoBody(mu)
    assert 0 < np.abs(mine.propagate(x, 10.0) - plain.propagate(x, 10.0)).max() < 1e-3
    np.testing.assert_array_equal(mine.transition(x, 10.0), plain.transition(x, 10.0))
    ekf = ln.ExtendedKalmanFilter(mine, x, np.eye(6))
    ekf.predict(10.0)
    np.testing.assert_allclose(ekf.state, mine.propagate(x, 10.0), rtol=1e-15)
    step = ekf.update(Biased(1.0), [7.0e6])
    assert step.innovation[0] == pytest.approx(7.0e6 - np.linalg.norm(mine.propagate(x, 10.0)[:3]) - 1.0)
