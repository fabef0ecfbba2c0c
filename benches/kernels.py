"""Numbers of the Rust kernels: criterion's times, callgrind's instructions, allocations of a public call."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
CALLS = 200
"""Calls in the shorter of two runs; the longer does twice as many, the difference is what the calls cost."""


def criterion():
    """Nanoseconds by kernel, from ``cargo bench``."""
    command = ["cargo", "bench", "-q", "-p", "losnav-core", "--bench", "kernels"]
    subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.DEVNULL)
    found = {}
    for path in sorted((ROOT / "target" / "criterion").rglob("new/estimates.json")):
        name = json.loads((path.parent / "benchmark.json").read_text())["full_id"]
        found[name] = json.loads(path.read_text())["median"]["point_estimate"]
    return found


def instructions():
    """Instructions of one call by kernel, by callgrind."""
    if shutil.which("valgrind") is None:
        return {}
    command = ["cargo", "bench", "-q", "-p", "losnav-core", "--bench", "instructions", "--no-run"]
    command += ["--message-format=json"]
    built = subprocess.run(command, cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True).stdout
    messages = [json.loads(line) for line in built.splitlines()]
    [binary] = [
        m["executable"] for m in messages if m.get("executable") and m["target"]["name"] == "instructions"
    ]
    names = subprocess.run([binary, "list"], check=True, stdout=subprocess.PIPE, text=True).stdout.split("\n")
    return {name: _difference("callgrind", [binary, name]) for name in names if name}


CALL = """
import sys
sys.path.insert(0, {root!r})
import losnav as ln
from benches.scenes import SIGMA, scenes
[scene] = scenes({n}, 1)
landmarks, los, guess, solve = scene.landmarks, scene.los, scene.guess, ln.solve_pose
for _ in range(int(sys.argv[1])):
    solve(landmarks, los, sigma=SIGMA, guess=guess)
"""


def public_call():
    """Instructions and heap allocations (Python's objects included) of one warm ``solve_pose``."""
    if shutil.which("valgrind") is None:
        return {}
    found = {}
    for n in (4, 8, 50, 1000):
        command = [sys.executable, "-c", CALL.format(root=str(ROOT), n=n)]
        found[f"solve_pose N={n}, warm"] = {
            "instructions": _difference("callgrind", command),
            "allocations": _difference("memcheck", command),
        }
    return found


_PATTERNS = {"callgrind": r"Collected\s*:\s*(\d+)", "memcheck": r"total heap usage:\s*([\d,]+) allocs"}


def _difference(tool, command):
    """What one call adds to the count of a whole process."""
    # Valgrind knows no AVX-512; plain malloc makes Python's own objects visible; a fixed seed of the
    # hashes repeats the run.
    environment = os.environ | {"LOSNAV_ISA": "avx2", "PYTHONMALLOC": "malloc", "PYTHONHASHSEED": "0"}
    environment |= {"OPENBLAS_CORETYPE": "Haswell", "NPY_DISABLE_CPU_FEATURES": "AVX512F"}
    options = {"callgrind": ["--callgrind-out-file=/dev/null"], "memcheck": ["--undef-value-errors=no"]}[tool]
    counts = []
    for calls in (CALLS, 2 * CALLS):
        run = subprocess.run(
            ["valgrind", f"--tool={tool}", *options, *command, str(calls)],
            env=environment,
            check=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )
        match = re.search(_PATTERNS[tool], run.stderr)
        if match is None:
            raise RuntimeError(f"{tool} said nothing of its count: {run.stderr[-500:]}")
        counts.append(int(match[1].replace(",", "")))
    return (counts[1] - counts[0]) / CALLS
