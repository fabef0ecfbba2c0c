"""``solve_attitude`` beside SciPy and numba: ``python -m benches.attitude`` prints the section of RESULTS.md.

With ``--threads 2`` it measures batches and prints JSON: nanoseconds for one problem, median and minimum of
interleaved rounds. The number of threads needs a process of its own.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SIGMA = 3.4e-5
"""1-sigma noise, rad: seven seconds of arc."""
DIRECTIONS = [2, 4, 8, 50, 1000]
SIZES = [1, 8, 64, 256, 1000, 4000, 10_000, 100_000]
BATCH = 10_000
LOOPED = 100
"""Problems of a batch that SciPy solves in a Python loop."""
TARGETS = {"microseconds": 0.7, "SciPy": 50.0, "nanoseconds": 30.0, "threads": 1.8}


def problems(n, count, seed=0):
    """``count`` problems of ``n`` directions over the sphere: body (count, n, 3), reference, true dcm."""
    import numpy as np
    from tests.oracle import attitude, wahba

    rng = np.random.default_rng([seed, n])
    reference = rng.standard_normal((count, n, 3))
    reference /= np.linalg.norm(reference, axis=-1, keepdims=True)
    turns = rng.uniform(-1.8, 1.8, (count, 3))
    dcm = np.array([attitude.dcm_from_rotation_vector(turn) for turn in turns])
    body = np.array(
        [wahba.measure(r, m, np.full(n, SIGMA), rng) for r, m in zip(reference, dcm, strict=True)]
    )
    return body, reference, dcm


def single(n, rounds, count=16):
    """Rows ``(name, median us, minimum us, ratio, rad from the oracle, note)`` of one problem."""
    import numpy as np
    from scipy.spatial.transform import Rotation
    from tests.oracle import wahba

    import losnav as ln
    from benches import attitude_twin
    from benches.clock import Contender, interleaved

    body, reference, _ = problems(n, count)
    pairs = list(zip(body, reference, strict=True))
    weights = np.full(n, SIGMA**-2)
    namespace = {"pairs": pairs, "S": SIGMA, "W": weights, "solve": ln.solve_attitude}
    namespace |= {"twin": attitude_twin.solve, "align": Rotation.align_vectors}
    loop = "for b, r in pairs: "
    contenders = [
        Contender("losnav", loop + "solve(b, r, sigma=S)", namespace, count),
        Contender("numba twin", loop + "twin(b, r, S)", namespace, count, note="no checks, no proof"),
        Contender(
            "SciPy align_vectors", loop + "align(b, r, weights=W)", namespace, count, note="no covariance"
        ),
    ]
    answers = {
        "losnav": [ln.solve_attitude(b, r, sigma=SIGMA).dcm for b, r in pairs],
        "numba twin": [
            ln.attitude.dcm_from_quaternion(attitude_twin.solve(b, r, SIGMA)[:4]) for b, r in pairs
        ],
        "SciPy align_vectors": [
            Rotation.align_vectors(b, r, weights=weights)[0].as_matrix() for b, r in pairs
        ],
    }
    sigmas = np.full(n, SIGMA)
    best = [wahba.refine(wahba.solve_svd(b, r, sigmas), b, r, sigmas, steps=3) for b, r in pairs]
    times = interleaved(contenders, rounds)
    rows = []
    for contender, time in zip(contenders, times, strict=True):
        off = [
            np.linalg.norm(ln.attitude.rotation_error(one, other))
            for one, other in zip(best, answers[contender.name], strict=True)
        ]
        ratio = time.median / times[0].median
        rows.append(
            (
                contender.name,
                1e6 * time.median,
                1e6 * time.minimum,
                ratio,
                float(np.median(off)),
                contender.note,
            )
        )
    return rows


def batch(n, size, rounds, peers):
    """Nanoseconds for one problem of a batch, by contender."""
    import numpy as np
    from scipy.spatial.transform import Rotation

    import losnav as ln
    from benches import attitude_twin
    from benches.clock import Contender, interleaved

    # A few hundred distinct problems, repeated: making them costs more than solving them.
    body, reference, _ = problems(n, min(size, 500))
    repeat = -(-size // len(body))
    body, reference = (np.tile(x, (repeat, 1, 1))[:size].copy() for x in (body, reference))
    namespace = {"b": body, "r": reference, "S": SIGMA, "solve": ln.solve_attitude}
    contenders = [Contender("losnav", "solve(b, r, sigma=S)", namespace, size)]
    report = {"size": size, "directions": n}
    report["converged"] = float(np.mean(ln.solve_attitude(body, reference, sigma=SIGMA).converged))
    if peers:
        out = np.empty((size, 11))
        attitude_twin.solve_batch(body, reference, SIGMA, out)
        namespace |= {"twin": attitude_twin.solve_batch, "out": out, "align": Rotation.align_vectors}
        namespace |= {"W": np.full(n, SIGMA**-2), "few": range(min(LOOPED, size))}
        contenders.append(Contender("numba prange", "twin(b, r, S, out)", namespace, size))
        loop = "for k in few: align(b[k], r[k], weights=W)"
        contenders.append(Contender("SciPy loop", loop, namespace, min(LOOPED, size)))
    times = interleaved(contenders, rounds)
    report["ns"] = {c.name: [1e9 * t.median, 1e9 * t.minimum] for c, t in zip(contenders, times, strict=True)}
    return report


def alternating(repeats, sizes, rounds, extra):
    """Runs of one and two threads in turn; of each number the best run."""
    best = {}
    for _ in range(repeats):
        for threads in (1, 2):
            command = [sys.executable, "-m", "benches.attitude", "--threads", str(threads)]
            command += ["--rounds", str(rounds), "--sizes", *map(str, sizes), *extra]
            rows = json.loads(subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout)
            for old, new in zip(best.setdefault(threads, rows), rows, strict=True):
                for name, times in new["ns"].items():
                    old["ns"][name] = min(old["ns"][name], times)
    return best


def section(quick=False, rounds=25):
    """The text of the attitude section."""
    counts = [4, 8] if quick else DIRECTIONS
    repeats = 1 if quick else 3
    tables = [(n, single(n, rounds)) for n in counts]
    full = alternating(repeats, [BATCH], rounds, ["--peers"])
    sizes = SIZES[:4] if quick else SIZES
    growth = alternating(1 if quick else 2, sizes, max(3, rounds // 3), [])
    return report(tables, full, growth)


def report(tables, full, growth):
    """Markdown of the measured numbers."""
    from benches.report import verdict

    lines = [
        "## Attitude from vectors",
        "",
        "Directions over the sphere, σ = 7 seconds of arc, random attitudes. Ours normalises, proves the",
        "minimum and keeps the information; difference: median from the oracle's optimum (QR).",
        "",
        "| N | contender | µs | ratio | difference, rad | note |",
        "|---|---|---|---|---|---|",
    ]
    for n, rows in tables:
        for name, median, minimum, ratio, off, note in rows:
            lines.append(
                f"| {n} | {name} | {median:.2f} ({minimum:.2f}) | {ratio:.2f} | {off:.1g} | {note} |"
            )
    lines.append("")
    for n, rows in tables:
        if n == 8:
            scipy = next(row[3] for row in rows if row[0].startswith("SciPy"))
            lines.append(
                verdict("µs for one call, N = 8", rows[0][1], TARGETS["microseconds"], at_least=False)
            )
            lines.append(verdict("times as fast as SciPy, N = 8", scipy, TARGETS["SciPy"], at_least=True))
    return "\n".join([*lines, *_batch_lines(full, growth), ""])


def _batch_lines(full, growth):
    from benches.report import verdict

    one, two = full[1][0], full[2][0]
    ours = two["ns"]["losnav"][0]
    lines = [
        "",
        f"Batch of {one['size']} problems, N = {one['directions']}, ns each, best of three runs by median:",
        "",
    ]
    lines += ["| contender | 1 thread | 2 threads | ratio |", "|---|---|---|---|"]
    for name in one["ns"]:
        (a, low_a), (b, low_b) = one["ns"][name], two["ns"][name]
        lines.append(f"| {name} | {a:.0f} ({low_a:.0f}) | {b:.0f} ({low_b:.0f}) | {b / ours:.1f} |")
    lines += ["", f"Converged: {one['converged']:.2%}.", ""]
    lines.append(verdict("ns each, 2 threads", ours, TARGETS["nanoseconds"], at_least=False))
    scaling = one["ns"]["losnav"][0] / ours
    lines.append(
        verdict("times as fast with 2 threads as with 1", scaling, TARGETS["threads"], at_least=True)
    )
    lines += ["", "| problems in one call | " + " | ".join(str(row["size"]) for row in growth[1]) + " |"]
    lines.append("|---|" + "---|" * len(growth[1]))
    for threads, table in growth.items():
        cells = [f"{row['ns']['losnav'][0]:.0f}" for row in table]
        word = "thread" if math.isclose(threads, 1) else "threads"
        lines.append(f"| {threads} {word}, ns each | " + " | ".join(cells) + " |")
    return lines


def main(arguments=None):
    """Fix the threads before anything counts the cores, then measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--threads", type=int)
    parser.add_argument("--rounds", type=int, default=25)
    parser.add_argument("--directions", type=int, default=8)
    parser.add_argument("--sizes", type=int, nargs="+", default=[BATCH])
    parser.add_argument("--peers", action="store_true")
    parser.add_argument("--quick", action="store_true")
    options = parser.parse_args(arguments)
    for name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")
    sys.path.insert(0, str(ROOT))
    if options.threads is None:
        print(section(options.quick, options.rounds))
        return
    for name in ("RAYON_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[name] = str(options.threads)
    rows = [batch(options.directions, size, options.rounds, options.peers) for size in options.sizes]
    json.dump(rows, sys.stdout)


if __name__ == "__main__":
    main()
