"""``losnav bench``: how fast ``solve_pose`` is on this machine."""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from typing import Any

import numpy as np

import losnav as ln

__all__ = ["add_command"]

_COUNTS = (4, 8, 50)
_PERCENTILES = (50.0, 90.0, 99.0, 99.9)
_SIGMA = 2e-5  # rad


def add_command(commands: Any) -> None:
    """Add the command to a parser's subparsers."""
    command = commands.add_parser(
        "bench",
        help="latency and throughput on this machine",
        description=(
            "Latency percentiles of single solve_pose calls and throughput of a batch on this machine."
        ),
        epilog=(
            "Guess 50 m and 5 degrees off, from 500 m; the whole public call is timed, checks "
            "included (the covariance is formed when asked for)."
        ),
    )
    command.add_argument(
        "--calls", type=int, default=5000, metavar="N", help="timed calls for each size (default 5000)"
    )
    command.add_argument(
        "--batch", type=int, default=10000, metavar="N", help="poses in the batch (default 10000)"
    )
    command.add_argument("--json", action="store_true", help="print JSON")
    command.set_defaults(command=_bench)


def _bench(arguments: argparse.Namespace) -> int:
    if arguments.calls < 1 or arguments.batch < 1:
        raise ln.InvalidInputError("--calls, --batch: expected positive numbers")
    sizes = [_measure(count, arguments.calls, arguments.batch) for count in _COUNTS]
    report = {
        "losnav": ln.__version__,
        "machine": f"{platform.machine()}, {os.cpu_count()} cores",
        "python": platform.python_version(),
        "solve_pose": sizes,
    }
    if arguments.json:
        print(json.dumps(report, indent=1))
        return 0
    print(f"losnav {ln.__version__}, Python {report['python']}, {report['machine']}")
    print("solve_pose, guess 50 m and 5° off:")
    for size in sizes:
        latency = ", ".join(f"p{p:g} {size['latency_us'][f'p{p:g}']:.2f}" for p in _PERCENTILES)
        print(
            f"  N = {size['landmarks']:<3} one call: {latency}, max {size['latency_us']['max']:.2f} µs",
            end="",
        )
        print(
            f"   batch of {arguments.batch}: {size['batch_ns_each']:.0f} ns each "
            f"({size['poses_per_second']:.3g}/s)"
        )
    return 0


def _measure(count: int, calls: int, batch: int) -> dict[str, Any]:
    rng = np.random.default_rng(count)
    angle = 2 * np.pi * np.arange(count) / count
    landmarks = np.column_stack([31 * np.cos(angle), 31 * np.sin(angle), rng.uniform(-5, 5, count)])
    truth = np.array([-50.0, 50.0, 500.0, 0.09, -0.04, 0.03])
    los = ln.predict_los(landmarks, truth[:3], truth[3:]) + _SIGMA * rng.standard_normal((batch, count, 3))
    los /= np.linalg.norm(los, axis=-1, keepdims=True)
    guess = truth + rng.standard_normal((batch, 6)) * np.repeat([50.0, np.radians(5) / 4], 3)
    single = [(los[k % batch].copy(), guess[k % batch].copy()) for k in range(min(calls, 256))]
    for measured, start in single[:20]:
        ln.solve_pose(landmarks, measured, sigma=_SIGMA, guess=start)
    nanoseconds = np.empty(calls)
    for k in range(calls):
        measured, start = single[k % len(single)]
        begin = time.perf_counter_ns()
        ln.solve_pose(landmarks, measured, sigma=_SIGMA, guess=start)
        nanoseconds[k] = time.perf_counter_ns() - begin
    best = np.inf
    for _ in range(5):
        begin = time.perf_counter_ns()
        solution = ln.solve_pose(landmarks, los, sigma=_SIGMA, guess=guess)
        best = min(best, time.perf_counter_ns() - begin)
    latency = {f"p{p:g}": float(np.percentile(nanoseconds, p)) / 1e3 for p in _PERCENTILES}
    return {
        "landmarks": count,
        "latency_us": {**latency, "max": float(nanoseconds.max()) / 1e3},
        "batch_ns_each": best / batch,
        "poses_per_second": 1e9 * batch / best,
        "converged": float(np.mean(solution.converged)),
    }
