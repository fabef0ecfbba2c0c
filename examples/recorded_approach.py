"""Filter a recorded approach of two satellites with three models, and see which one can be trusted where.

    python examples/recorded_approach.py FILE.npz [FIGURE.png]

FILE.npz holds the times ``t`` (s) and the inertial states ``chief_r``, ``chief_v`` of the target and
``deputy_r``, ``deputy_v`` of the chaser (m, m/s; pole along z), one row for each time. A range (0.6 m,
3-sigma) and two angles (0.1 degrees, 3-sigma) of every epoch are simulated. For each model and process noise
the table has, in bands of the range, the mean of NIS (3 if consistent), of NEES (6 if consistent) and the rms
position error.
"""

import sys
from pathlib import Path

import numpy as np

from losnav.scenarios import Table
from losnav.scenarios.relative_navigation.recorded import Recorded, follow

FILTERS = (("cw", 1e-9), ("cw", 1e-3), ("curvilinear", 1e-9), ("curvilinear", 2e-5), ("j2", 1e-9))
BANDS = (0.0, 10e3, 30e3, 100e3)  # m
SETTLED = 30  # epochs


def main(file: str, figure: str | None) -> None:
    with np.load(file) as arrays:
        states = [np.concatenate([arrays[f"{w}_r"], arrays[f"{w}_v"]], axis=1) for w in ("chief", "deputy")]
        recorded = Recorded(arrays["t"], *states).every(4)
    distance = recorded.range[1:]
    band = np.digitize(distance, BANDS) - 1
    rows, all_followed = [], []
    for model, psd in FILTERS:
        followed = follow(recorded, model, psd, runs=2)
        all_followed.append(followed)
        cells = []
        for k in range(len(BANDS)):
            inside = (band == k) & (np.arange(len(distance)) >= SETTLED)
            nis, nees = (test.value[:, inside].mean() for test in (followed.nis, followed.nees))
            error = np.sqrt((followed.error[:, inside, :3] ** 2).sum(axis=-1).mean())
            cells.append(f"{nis:.3g} / {nees:.3g} / {error:.3g} m")
        rows.append((model, psd, followed.nis.verdict, *cells))
    ends = [f"{BANDS[k] / 1e3:g} to {BANDS[k + 1] / 1e3:g} km" for k in range(len(BANDS) - 1)]
    columns = ("model", "q [m^2/s^3]", "NIS says", *ends, f"beyond {BANDS[-1] / 1e3:g} km")
    print(Table("NIS / NEES / rms position error", columns, tuple(rows)))
    if figure:
        draw(recorded, all_followed, Path(figure))


def draw(recorded, all_followed, path):
    """Range, error and NIS over time."""
    from losnav.plotting import BLUE, GREEN, GREY, ORANGE, PURPLE, RED, figure_style, new_figure, save_figure

    names = {"cw": "Clohessy-Wiltshire", "curvilinear": "curvilinear", "j2": "two J2 orbits"}
    hours = recorded.times / 3600
    with figure_style():
        title = "A recorded approach, 160 km to 2 km and away again: which model can be trusted where"
        drawing, axes = new_figure(3, 1, size=(10.0, 8.5), title=title, sharex=True)
        axes[0, 0].semilogy(hours, recorded.range / 1e3, color="black")
        for followed, colour in zip(all_followed, (RED, ORANGE, PURPLE, BLUE, GREEN), strict=True):
            label = f"{names[followed.model]}, q = {followed.acceleration_psd:g}"
            error = np.sqrt((followed.error[..., :3] ** 2).sum(axis=-1).mean(axis=0))
            axes[1, 0].semilogy(hours[1:], error, color=colour, label=label, linewidth=1.0)
            smooth = np.convolve(followed.nis.average, np.ones(15) / 15, mode="valid")
            axes[2, 0].semilogy(hours[8:-7], smooth, color=colour, linewidth=1.0)
        axes[2, 0].axhline(3, color=GREY, linewidth=4, alpha=0.4)
        axes[0, 0].set(ylabel="range [km]")
        axes[1, 0].set(ylabel="position error, rms [m]")
        axes[2, 0].set(ylabel="NIS, mean of half an hour", xlabel="time [h]")
        drawing.legend(*axes[1, 0].get_legend_handles_labels(), loc="outside lower center", ncol=3)
        save_figure(drawing, path)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else None)
