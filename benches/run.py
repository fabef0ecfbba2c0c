"""Everything: ``python benches/run.py`` rewrites ``benches/RESULTS.md``; ``--quick`` is a smoke test.

Run it from an environment with ``losnav[bench]`` on a machine with nothing else to do.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import re
import subprocess
import sys
import time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
# A waiting BLAS thread spins on the core the other contenders need.
for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from benches import attitude, filters, growth, inertial, kernels, lie, report, single  # noqa: E402

RESULTS = ROOT / "benches" / "RESULTS.md"
PICTURE = ROOT / "docs" / "images" / "growth.png"


def main(arguments=None):
    """Measure, write, print where."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="under a minute, few rounds, writes nothing")
    parser.add_argument("--output", type=Path, default=None, help="file instead of benches/RESULTS.md")
    parser.add_argument("--rounds", type=int, default=None, help="interleaved rounds of each table")
    parser.add_argument("--only-filters", action="store_true", help="that section alone, the others kept")
    parser.add_argument("--only-inertial", action="store_true", help="likewise")
    parser.add_argument("--only-lie", action="store_true", help="likewise")
    options = parser.parse_args(arguments)
    quick = options.quick
    rounds = options.rounds or (3 if quick else 25)
    for wanted, section in (
        (options.only_filters, _filter_section),
        (options.only_inertial, _inertial_section),
        (options.only_lie, _lie_section),
    ):
        if wanted:
            _replace_section(section(quick, rounds), options.output or (None if quick else RESULTS))
            return
    parts = [report.head(machine(), versions(), quick)]
    parts += _single_tables(quick, rounds)
    parts += _batch_tables(quick, rounds)
    _say("attitude from vectors")
    parts.append(attitude.section(quick, rounds))
    parts.append(_filter_section(quick, rounds))
    parts.append(_inertial_section(quick, rounds))
    parts.append(_lie_section(quick, rounds))
    if not quick:
        parts.append(report.kernels(kernels.criterion(), kernels.instructions(), kernels.public_call()))
        parts.append(report.WHY)
    text = "\n".join(parts)
    output = options.output or (None if quick else RESULTS)
    if output is None:
        print(text)
    else:
        output.write_text(text, encoding="utf-8")
        print(f"written: {output}")


def _say(what):
    print(f"{time.strftime('%H:%M:%S')} {what}", file=sys.stderr, flush=True)


def _single_tables(quick, rounds):
    parts = [report.section_warm()]
    count = 4 if quick else 16
    for n in [4, 50] if quick else [4, 8, 50, 1000]:
        _say(f"warm start, N = {n}")
        makers = [m for m in single.warm_contenders(n) if not (quick and m.__name__ == "oracle_warm")]
        parts.append(report.warm(n, single.measure(makers, n, rounds=rounds, count=count)))
    parts.append(report.section_free())
    for n in [4] if quick else [3, 4, 8, 50]:
        _say(f"no guess, N = {n}")
        rows = single.measure(single.free_contenders(n), n, rounds=rounds, count=count)
        parts.append(report.rows(f"N = {n}", rows))
    parts.append(report.section_robust())
    for n, outliers in [(50, 0.4)] if quick else [(50, 0.3), (50, 0.5), (200, 0.3), (200, 0.5)]:
        _say(f"robust, N = {n}, {outliers:.0%} wrong")
        rows = single.measure(
            single.robust_contenders(n), n, rounds=max(3, rounds // 3), count=count, outliers=outliers
        )
        parts.append(report.rows(f"N = {n}, {outliers:.0%} of the directions wrong", rows))
    return parts


def _batch_tables(quick, rounds):
    repeats = 1 if quick else 3
    _say("batch")
    main_table = _alternating(repeats, [10_000], rounds, ["--peers"])
    parts = [report.batch(main_table)]
    _say("growth")
    counts = growth.LANDMARKS[:4] if quick else growth.LANDMARKS
    sizes = growth.SIZES[:4] if quick else growth.SIZES
    landmarks = counts, growth.over_landmarks(counts, max(3, rounds // 2))
    curves = _alternating(1 if quick else 2, sizes, max(3, rounds // 3), [])
    parts.append(report.growth(landmarks, curves))
    if not quick:
        whole = [
            (sizes, [row["ns"]["losnav"][0] * row["size"] / 1e3 for row in curves[threads]])
            for threads in (1, 2)
        ]
        growth.draw(landmarks, *whole, PICTURE)
        parts.append(f"![growth](../{PICTURE.relative_to(ROOT).as_posix()})\n")
    return parts


def _filter_section(quick, rounds):
    _say("filters")
    return report.filters(filters.tables(quick=quick, rounds=rounds))


def _inertial_section(quick, rounds):
    _say("inertial navigation")
    return report.inertial(inertial.tables(rounds=3 if quick else rounds))


def _lie_section(quick, rounds):
    _say("Lie derivatives")
    return lie.section(quick=quick, rounds=rounds)


def _replace_section(section, path):
    """One section of the results, measured by itself: the machine's state is noted under its heading."""
    title, rest = section.split("\n", 1)
    section = f"{title}\n\nMeasured by itself: {machine()}; {versions()}.\n{rest}"
    if path is None:
        print(section)
        return
    parts = re.split(r"(?m)^(?=## )", path.read_text(encoding="utf-8"))
    places = [i for i, part in enumerate(parts) if part.startswith(title)]
    kernels_at = next((i for i, part in enumerate(parts) if part.startswith("## Kernels")), len(parts))
    at, end = (places[0], places[0] + 1) if places else (kernels_at, kernels_at)
    parts[at:end] = [section + "\n"]
    path.write_text("".join(parts), encoding="utf-8")
    print(f"written: {path}")


def _alternating(repeats, sizes, rounds, extra):
    """Runs of one and two threads in turn; of each number the best run (the other runs met other work)."""
    best = {}
    for _ in range(repeats):
        for threads in (1, 2):
            command = [sys.executable, "-m", "benches.batches", "--threads", str(threads)]
            command += ["--rounds", str(rounds), "--sizes", *map(str, sizes), *extra]
            rows = json.loads(subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE).stdout)
            for old, new in zip(best.setdefault(threads, rows), rows, strict=True):
                for name, times in new["ns"].items():
                    old["ns"][name] = min(old["ns"][name], times)
    return best


def machine():
    """One line."""
    model = platform.processor() or platform.machine()
    information = Path("/proc/cpuinfo")
    if information.exists():
        names = [
            line.split(":")[1].strip()
            for line in information.read_text().splitlines()
            if "model name" in line
        ]
        model = names[0] if names else model
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    isa = os.environ.get("LOSNAV_ISA", "widest the CPU has")
    system = platform.system()
    return f"{model}, {os.cpu_count()} cores, {system}, LOSNAV_ISA: {isa}, load at the start {load:.1f}"


def versions():
    """Python and everybody timed."""
    names = [
        "losnav",
        "numpy",
        "scipy",
        "opencv-python-headless",
        "poselib",
        "numba",
        "filterpy",
        "stonesoup",
    ]
    found = [f"Python {platform.python_version()}"]
    for name in names:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} missing")
    return ", ".join(found)


if __name__ == "__main__":
    main()
