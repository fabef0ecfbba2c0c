"""Rewrite the speed section of the README from benches/RESULTS.md, which ``make bench`` writes.

python docs/speed.py [RESULTS.md]
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BEGIN, END = "<!-- speed: written by docs/speed.py -->", "<!-- /speed -->"
NOTE = """
Times of one public call, checks and the exact Hessian at the end included (the covariance is formed when
asked for), and how many times longer the others take for the same scenes in the same interleaved run; below
1 the other is faster. {machine}
PoseLib and OpenCV minimise pixels and give no covariance, OpenCV's solvers without a guess stop unrefined (in
brackets: how far from the optimum), the numba twin checks nothing. All rows, with errors beside the times:
[benches/RESULTS.md](benches/RESULTS.md), written by `make bench`; `losnav bench` shows latency percentiles on
your machine.
"""
OURS = ("losnav", "losnav step", "losnav predict", "losnav update", "losnav run", "losnav lie_matrix")
FILTER_PEERS = ("numba twin", "numba prange", "filterpy", "Stone Soup")
PEERS = ("numba twin", "PoseLib refine", "OpenCV solvePnPRefineLM", "SciPy least_squares lm")


def tables(text):
    """``{(section, subsection): {contender: cells}}`` and the bullets of targets not reached."""
    found, section, subsection, missed = {}, "", "", []
    for line in text.splitlines():
        if line.startswith("## "):
            section, subsection = line[3:], ""
        elif line.startswith("### "):
            subsection = line[4:]
        elif line.startswith("| "):
            name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
            part = subsection
            if section.startswith("Attitude") and name.isdigit():
                part, name, cells = f"N = {name}", cells[0], cells[1:]
            found.setdefault((section, part), {})[name] = cells
        elif "**missed**" in line:
            missed.append(f"{subsection or section}, {line[2:]}")
    return found, missed


def others(rows):
    """Names of the contenders that solved anything."""
    solved = [name for name, cells in rows.items() if cells[1][:1].isdigit() and cells[2] != "–"]
    return [name for name in solved if name != "contender" and not name.startswith("losnav")]


def against(rows, peers, ratio=1, off=None):
    """``3.3× PoseLib …`` of each peer that is there."""
    words = []
    for name in (name for name in peers if name in rows):
        metres = f" ({rows[name][off]} m)" if off else ""
        words.append(f"{rows[name][ratio]}× {name}{metres}")
    return ", ".join(words)


def row(title, part, rows):
    """One line of the table, or nothing."""
    ours = next((name for name in OURS if name in rows), None)
    if ours is None:
        return ""
    time = rows[ours][0].split(" ")[0]
    if title.startswith("With a guess"):
        return f"| guess 50 m and 5° off, {part} | {time} µs | {against(rows, PEERS)} |"
    if title.startswith("Without a guess"):
        return f"| no guess, {part} | {time} µs | {against(rows, others(rows), off=3)} |"
    if title.startswith("With wrong") and "50%" in part:
        return f"| {part} | {time} µs | {against(rows, others(rows))} |"
    if title.startswith("Batch"):
        both = rows["losnav"][1].split(" ")[0]
        words = against(rows, others(rows), ratio=2)
        return f"| batch of 10 000, N = 4, guess | {time} ns each; 2 threads {both} ns | 2 threads: {words} |"
    if title.startswith("Attitude") and part == "N = 8":
        return f"| attitude, {part} | {time} µs | {against(rows, ('numba twin', 'SciPy align_vectors'))} |"
    if title.startswith("Attitude") and not part:
        both, words = rows[ours][1].split(" ")[0], against(rows, ("numba prange",), ratio=2)
        return (
            f"| batch of 10 000, attitude, N = 8 | {time} ns each; 2 threads {both} ns | 2 threads: {words} |"
        )
    if title.startswith("Extended"):
        return f"| filter of six states. {part} | {time} µs | {against(rows, FILTER_PEERS)} |"
    if title.startswith("Inertial"):
        return f"| inertial filter, 15 errors. {part} | {time} µs | {against(rows, others(rows))} |"
    if title.startswith("Lie"):
        return f"| 18 × 6 matrix of Lie derivatives. {part} | {time} µs | {against(rows, others(rows))} |"
    return ""


def section(text):
    """The README's section as Markdown."""
    found, missed = tables(text)
    machine = re.search(r"^- (Machine: .*)$", text, flags=re.M)
    table = ["| problem | losnav | others |", "|---|---|---|"]
    table += [row(*key, rows) for key, rows in found.items()]
    parts = [NOTE.format(machine=machine[1] if machine else "").strip(), "\n".join(filter(None, table))]
    if missed:
        parts += ["Targets not reached in that run:", "\n".join(f"- {line}" for line in missed)]
    return "\n\n".join(parts)


def main():
    results = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "benches" / "RESULTS.md"
    page = ROOT / "README.md"
    head, rest = page.read_text(encoding="utf-8").split(BEGIN)
    _, tail = rest.split(END)
    body = section(results.read_text(encoding="utf-8"))
    page.write_text(f"{head}{BEGIN}\n{body}\n{END}{tail}", encoding="utf-8")


if __name__ == "__main__":
    main()
