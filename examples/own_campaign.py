"""A Monte Carlo campaign of your own: how often is the pose within its 3-sigma when a landmark is misplaced?

    python examples/own_campaign.py

The task gets the seeds of a block of runs and returns arrays with one row for each run, so the whole block is
solved as one batch. Any executor of concurrent.futures may run it (threads, processes, Dask, MPI, Ray).
"""

import numpy as np

import losnav as ln
from losnav.campaign import run_campaign
from losnav.consistency import binomial_interval

LANDMARKS = np.array([[32.5, 0, 0], [0, 30, 0], [-31.5, 0, 0], [0, -30.5, 0], [15, 12, 3]])
POSITION, MRP = np.array([-50.0, 50.0, 500.0]), np.array([0.09, -0.04, 0.03])
SIGMA = 2e-5  # rad
MAP_SIGMA = 0.02  # m


def task(seeds):
    """Solve one block: every run has its own map error and its own image noise."""
    rngs = [np.random.default_rng(seed) for seed in seeds]
    true_map = LANDMARKS + MAP_SIGMA * np.stack([rng.standard_normal(LANDMARKS.shape) for rng in rngs])
    los = ln.predict_los(true_map, np.broadcast_to(POSITION, (len(rngs), 3)), MRP)
    los = los + SIGMA * np.stack([rng.standard_normal(LANDMARKS.shape) for rng in rngs])
    los /= np.linalg.norm(los, axis=-1, keepdims=True)
    solution = ln.solve_pose(LANDMARKS, los, sigma=SIGMA)
    sigma = np.sqrt(np.diagonal(solution.covariance, axis1=-2, axis2=-1))[:, :3]
    return {"within": (abs(solution.position - POSITION) <= 3 * sigma).all(axis=1), "chi2": solution.chi2}


if __name__ == "__main__":
    result = run_campaign(task, runs=2000, seed=7, block=250, progress=True)
    within = result["within"]
    low, high = binomial_interval(int(within.sum()), within.size)
    print(f"within 3 sigma: {within.mean():.1%} [{low:.1%}, {high:.1%}] (about 99.2 % if the map were exact)")
    print(f"mean chi2: {result['chi2'].mean():.1f} for 4 degrees of freedom: the fit notices the map errors")
