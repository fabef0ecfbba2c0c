"""How the time grows with landmarks and with the batch: tables, and one picture if matplotlib is there."""

from __future__ import annotations

from pathlib import Path

from benches import peers
from benches.clock import interleaved
from benches.scenes import scenes

LANDMARKS = [4, 8, 16, 32, 64, 128, 256, 512, 1000, 2000, 5000, 10_000]
SIZES = [1, 4, 16, 64, 256, 1000, 4000, 10_000, 100_000]


def over_landmarks(counts, rounds):
    """Microseconds of one warm solve for each number of landmarks."""
    contenders = [peers.losnav_warm(scenes(n, 4)) for n in counts]
    return [1e6 * time.median for time in interleaved(contenders, rounds)]


def draw(landmarks, batch_one, batch_two, path: Path):
    """Both curves on logarithmic axes, small enough for a repository."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3.2), layout="constrained")
    left.loglog(*landmarks, "o-", ms=3)
    left.set(xlabel="landmarks", ylabel="one warm solve, µs")
    right.loglog(*batch_one, "o-", ms=3, label="1 thread")
    right.loglog(*batch_two, "s-", ms=3, label="2 threads")
    right.set(xlabel="problems of 4 landmarks in one call", ylabel="the whole call, µs")
    right.legend(frameon=False)
    for axes in (left, right):
        axes.grid(alpha=0.3, which="both", linewidth=0.4)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=90, metadata={"Software": None})
    plt.close(figure)
