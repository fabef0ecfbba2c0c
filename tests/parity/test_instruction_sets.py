"""One wheel, several instruction sets: the answers differ by rounding only."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import losnav as ln

SOLVE = """
import json, sys
import numpy as np
import losnav as ln

rng = np.random.default_rng(5)
landmarks = rng.uniform(-30, 30, (9, 3))
position, mrp = rng.normal(0, 40, (37, 3)) + [0, 0, 300], rng.uniform(-0.4, 0.4, (37, 3))
los = ln.predict_los(landmarks, position, mrp) + 1e-4 * rng.standard_normal((37, 9, 3))
guess = np.concatenate([position + 5, mrp + 0.01], axis=1)
answers = {}
for loss in ("squared", "huber"):
    for start in (guess, None):
        pose = ln.solve_pose(landmarks, los, sigma=1e-4, guess=start, loss=loss)
        assert pose.converged.all()
        answers[f"{loss} {start is None}"] = np.concatenate([pose.position, pose.mrp], axis=1).tolist()
stars = rng.standard_normal((37, 9, 3))
stars /= np.linalg.norm(stars, axis=2, keepdims=True)
dcm = ln.attitude.dcm_from_mrp(mrp)
body = np.einsum("kij,knj->kni", dcm, stars) + 1e-4 * rng.standard_normal(stars.shape)
body /= np.linalg.norm(body, axis=2, keepdims=True)
attitude = ln.solve_attitude(body, stars, sigma=1e-4)
assert attitude.converged.all()
answers["attitude"] = np.concatenate([attitude.mrp, 1e4 * attitude.loss[:, None]], axis=1).tolist()
one = [ln.solve_pose(landmarks, b, sigma=1e-4).position.tolist() for b in los[:5]]
json.dump({"isa": ln._core.ISA, "batch": answers, "one": one}, sys.stdout)
"""


def answers(isa):
    run = subprocess.run(
        [sys.executable, "-c", SOLVE],
        env={**os.environ, "LOSNAV_ISA": isa},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(run.stdout)


@pytest.fixture(scope="module")
def baseline():
    found = answers("baseline")
    assert found["isa"] == "baseline"
    return found


@pytest.mark.parametrize("isa", ["avx2", "avx512"])
def test_answers_differ_by_rounding(baseline, isa):
    found = answers(isa)
    if found["isa"] != isa:
        pytest.skip(f"this CPU has no {isa}")
    for name, rows in baseline["batch"].items():
        # Stop tests leave 1e-6 sigma, and sigma is 2 cm here.
        assert np.abs(np.array(rows) - np.array(found["batch"][name])).max() < 1e-6
    assert np.abs(np.array(baseline["one"]) - np.array(found["one"])).max() < 1e-6


def test_one_sigma_for_each_problem():
    rng = np.random.default_rng(6)
    landmarks = rng.uniform(-30, 30, (6, 3))
    sigma = np.array([1e-5, 1e-4, 1e-3])
    los = ln.predict_los(landmarks, np.full((3, 3), [0, 0, 200.0]), np.zeros(3))
    guess = np.full((3, 6), [3, 3, 190.0, 0, 0, 0.01])
    for start in (guess, None):
        narrow = ln.solve_pose(landmarks, los, sigma=sigma[:, None], guess=start)
        wide = ln.solve_pose(landmarks, los, sigma=np.repeat(sigma[:, None], 6, axis=1), guess=start)
        assert np.array_equal(narrow.covariance, wide.covariance)
