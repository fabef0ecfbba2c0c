"""The tables of RESULTS.md as text."""

from __future__ import annotations

import math

# Targets: for N landmarks with a guess, microseconds and times faster than the named contender.
TARGETS = {
    4: {
        "microseconds": 1.2,
        "PoseLib refine": 3.5,
        "OpenCV solvePnPRefineLM": 60,
        "SciPy least_squares lm": 350,
    },
    8: {"PoseLib refine": 3.0},
    50: {"PoseLib refine": 5.0},
    1000: {"PoseLib refine": 25.0},
}
BATCH_NANOSECONDS = 100
BATCH_TARGETS = {"numba prange": 4.0}
THREAD_TARGET = 1.8
# Filters: the first row of each table in microseconds, and times faster than the named contender.
FILTER_TARGETS = [
    {"losnav step": 0.4, "losnav predict + update": 0.8, "filterpy": 50, "Stone Soup": 1000},
    {"losnav run": 0.15},
    {"losnav run": 0.025, "numba prange": 4.0},
]

# Inertial navigation, likewise.
INERTIAL_TARGETS = [
    {"losnav predict": 1.0, "numba twin": 1.0, "NumPy twin": 20},
    {"losnav update": 2.0, "numba twin": 5.0, "NumPy twin": 20},
    {"losnav run": 3.0, "numba twin": 4.0},
]


def head(machine, versions, quick):
    """Title, machine, how to read the tables."""
    return "\n".join(
        [
            "# Speed",
            "",
            f"Written by `make bench`{' (quick)' if quick else ''}; not edited by hand.",
            "",
            f"- Machine: {machine}.",
            f"- {versions}.",
            "- Every table is one interleaved run: each round times each contender once, on the same",
            "  scenes; the table gives the median of the rounds (minimum in brackets). Ratio: their",
            "  median over ours.",
            "- `losnav` is the public call: arguments checked, directions normalised, exact Hessian",
            "  tested at the end, information for the covariance kept. The others do less; the note says",
            "  what.",
            "- Error: median over the scenes against the optimum in directions (the oracle's), attitude",
            "  in rad and position in m. OpenCV and PoseLib minimise pixels of a camera of focal length",
            "  1000: with noise of 2e-5 rad their optimum differs from ours by a part of the noise. So",
            "  *exact* gives the attitude error on the same scenes without noise, where all optima are",
            "  the truth, and *solved* the number of those scenes on which it is below 1e-6 rad. Errors",
            "  are over the solved scenes.",
            "- The mapping of everybody's conventions stands at the head of `benches/peers.py`.",
            "",
        ]
    )


def section_warm():
    """Heading."""
    return (
        "## With a guess, 50 m and 5° off\n\n"
        "500 m above landmarks 30 m around; σ = 2e-5 rad; tolerance 1e-12.\n"
    )


def section_free():
    """Heading."""
    return (
        "## Without a guess\n\n"
        "losnav polishes every candidate and lists all minima of comparable cost; for N = 3 the nearest\n"
        "of the solutions counts, for everybody. OpenCV's solvers stop at their own cost, unrefined.\n"
    )


def section_robust():
    """Heading."""
    return "## With wrong directions\n\nGate at 5 σ for the peers, confidence 0.9999 for all.\n"


def _number(value, digits=2):
    return "–" if math.isnan(value) else f"{value:.{digits}g}"


def _time(microseconds):
    return f"{microseconds:.2f}" if microseconds < 100 else f"{microseconds:.0f}"


def rows(title, table):
    """One table."""
    lines = [
        f"### {title}",
        "",
        "| contender | µs | ratio | attitude, rad | position, m | exact, rad | solved | note |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in table:
        cells = [
            row.name,
            f"{_time(row.microseconds)} ({_time(row.minimum)})",
            f"{row.ratio:.2f}" if row.ratio < 10 else f"{row.ratio:.0f}",
            _number(row.attitude),
            _number(row.position),
            _number(row.exact),
            f"{row.reached} of {row.scenes}",
            row.note,
        ]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join([*lines, ""])


def verdict(what, got, wanted, *, at_least):
    """One line of a target: reached, or by how much it is missed."""
    reached = got >= wanted if at_least else got <= wanted
    sign = "≥" if at_least else "≤"
    word = "reached" if reached else f"**missed**, {got / wanted:.2f} of it"
    return f"- {what}: {got:.3g}, target {sign} {wanted:g}: {word}"


def warm(n, table):
    """The table of one N and its targets."""
    lines = [rows(f"N = {n}", table)]
    for name, wanted in TARGETS[n].items():
        if name == "microseconds":
            lines.append(verdict("µs for one call", table[0].microseconds, wanted, at_least=False))
        else:
            ratio = next(row.ratio for row in table if row.name == name)
            lines.append(verdict(f"times as fast as {name}", ratio, wanted, at_least=True))
    return "\n".join([*lines, ""])


def batch(runs):
    """Batch of 10,000 with one and two threads, beside the peers."""
    one, two = runs[1][0], runs[2][0]
    lines = [
        f"## Batch of {one['size']} problems, N = {one['landmarks']}",
        "",
        "Shared landmarks, a guess each; numba's twin gets its output memory, PoseLib and OpenCV run in a",
        "Python loop. One and two threads need their own process: in turn, three times (growth twice),",
        "and each number is its own best run by median, ours and theirs alike, not one interleaved run.",
        "",
        "| contender | 1 thread, ns each | 2 threads | ratio | attitude from ours, rad | position, m |",
        "|---|---|---|---|---|---|",
    ]
    ours = two["ns"]["losnav"][0]
    for name in one["ns"]:
        (a, low_a), (b, low_b) = one["ns"][name], two["ns"][name]
        attitude, position = two["difference"].get(name, (math.nan, math.nan))
        cells = [name, f"{a:.0f} ({low_a:.0f})", f"{b:.0f} ({low_b:.0f})", f"{b / ours:.2f}"]
        lines.append("| " + " | ".join([*cells, _number(attitude), _number(position)]) + " |")
    lines += ["", f"Converged: {one['converged']:.2%}.", ""]
    lines.append(verdict("ns each, 2 threads", ours, BATCH_NANOSECONDS, at_least=False))
    for name, wanted in BATCH_TARGETS.items():
        lines.append(verdict(f"times as fast as {name}", two["ns"][name][0] / ours, wanted, at_least=True))
    scaling = one["ns"]["losnav"][0] / ours
    lines.append(verdict("times as fast with 2 threads as with 1", scaling, THREAD_TARGET, at_least=True))
    return "\n".join([*lines, ""])


def filters(found):
    """The section of the extended Kalman filter."""
    lines = [
        "## Extended Kalman filter",
        "",
        "Six states, range and two angles; every row filters the same measurements. Difference: the largest",
        "of state and covariance from losnav's, in standard deviations. Mapping of conventions and what each",
        "is spared: head of `benches/filters.py`.",
        "",
    ]
    return "\n".join([*lines, *_filter_tables(found, FILTER_TARGETS)])


def inertial(found):
    """The section of the filter on inertial navigation."""
    lines = [
        "## Inertial navigation",
        "",
        "Fifteen errors; every row takes the same samples and images. Difference: the largest of state and",
        "covariance from losnav's, in standard deviations. What each is spared: head of",
        "`benches/inertial.py`.",
        "",
    ]
    return "\n".join([*lines, *_filter_tables(found, INERTIAL_TARGETS)])


def _filter_tables(found, all_targets):
    lines = []
    for (title, table), targets in zip(found.items(), all_targets, strict=True):
        lines += [
            f"### {title}",
            "",
            "| contender | µs | ratio | difference | note |",
            "|---|---|---|---|---|",
        ]
        for row in table:
            times = [_filter_time(row.nanoseconds), _filter_time(row.minimum)]
            ratio = f"{row.ratio:.2f}" if row.ratio < 10 else f"{row.ratio:.0f}"
            cells = [row.name, f"{times[0]} ({times[1]})", ratio, _number(row.difference), row.note]
            lines.append("| " + " | ".join(cells) + " |")
        lines.append("")
        for name, wanted in targets.items():
            row = next(row for row in table if row.name == name)
            if name.startswith("losnav"):
                lines.append(verdict(f"µs for {name}", row.nanoseconds / 1e3, wanted, at_least=False))
            else:
                lines.append(verdict(f"times as fast as {name}", row.ratio, wanted, at_least=True))
        lines.append("")
    return lines


def _filter_time(nanoseconds):
    return f"{nanoseconds / 1e3:.3f}" if nanoseconds < 1e4 else _time(nanoseconds / 1e3)


WHY = """## Where the time goes

Profiles (`perf`) taken by hand while these kernels were written, not by `make bench`; that of N = 1000 came
before the last changes to checks and gathers, that of the batch before those to threads.

- One call, N = 4: 60 % is the kernel (7.4 trial steps on average, each waiting for the one before), 13 %
  Python's own call, a good half of that looking up the keyword-only defaults. The rest is reading arguments,
  checks and the result.
- N = 1000: three quarters are the sums over the landmarks, eight at a time, in about nine passes. An eighth
  was checks (finite, unit, no landmark twice).
- Batch: four fifths are the kernel. Eight problems in the lanes go on until the slowest of them is done, 7.7
  trial steps on average, and the last pass is the exact Hessian's.
- Relative cost tolerance 1e-12 takes two trial steps more than 1e-6 (7.7 against 5.7); the default is strict.
"""


def growth(landmarks, curves):
    """Time against landmarks and against the batch."""
    lines = [
        "## Growth",
        "",
        "One warm solve:",
        "",
        "| landmarks | " + " | ".join(map(str, landmarks[0])) + " |",
        "|---|" + "---|" * len(landmarks[0]),
        "| µs | " + " | ".join(_time(t) for t in landmarks[1]) + " |",
        "| ns per landmark | "
        + " | ".join(f"{1e3 * t / n:.0f}" for n, t in zip(*landmarks, strict=True))
        + " |",
        "",
        "One call with a batch of problems of four landmarks, ns each:",
        "",
        "| problems | " + " | ".join(str(row["size"]) for row in curves[1]) + " |",
        "|---|" + "---|" * len(curves[1]),
    ]
    for threads, table in curves.items():
        cells = [f"{row['ns']['losnav'][0]:.0f}" for row in table]
        lines.append(f"| {threads} thread{'s' if threads > 1 else ''} | " + " | ".join(cells) + " |")
    return "\n".join([*lines, ""])


def kernels(criterion, instructions, call):
    """The Rust kernels: time of one f64, instructions of one call; allocations of a public call."""
    lines = [
        "## Kernels",
        "",
        "One problem in plain `f64`, baseline build: time by criterion, instructions by callgrind.",
        "",
        "| kernel | ns | instructions |",
        "|---|---|---|",
    ]
    # In the order of the workload where it is known.
    for name in instructions or sorted(criterion):
        time = f"{criterion[name]:.0f}" if name in criterion else "–"
        count = f"{instructions[name]:.0f}" if name in instructions else "–"
        lines.append(f"| {name} | {time} | {count} |")
    lines += ["", "The whole public call, Python and checks included, under valgrind (AVX2 lanes):", ""]
    lines += ["| call | instructions | allocations |", "|---|---|---|"]
    lines += [
        f"| {name} | {row['instructions']:.0f} | {row['allocations']:.1f} |" for name, row in call.items()
    ]
    return "\n".join([*lines, ""])
