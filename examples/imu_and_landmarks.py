"""Navigate by an inertial unit and the tracks of mapped landmarks in a camera, and name the wrong tracks.

    python examples/imu_and_landmarks.py FILE.npz [FIGURE.png]

FILE.npz holds, in metres, seconds, radians, world axes inertial enough for the unit at hand:

    imu_t (T,), accel (T, 3), gyro (T, 3)        what the unit showed, body axes
    frame_t (F,)                                 when images were taken, within imu_t
    obs_t, obs_lm (K,), obs_uv (K, 2)            a landmark seen: when, which, where: undistorted x/z, y/z
    landmarks (L, 3), landmark_sigma (L, 3)      the map, world axes, and how well it is known
    R_bc (3, 3), t_bc (3,)                       body from camera, and where the camera is, body axes
    gravity (3,)                                 world axes
    p_wb_vicon (F, 3)                            optional: where the body was, to compare with

The first pose comes from the landmarks of the first image alone (``losnav.solve_pose_robust``), the biases
of the unit from nowhere: they are found. A gate judges every landmark of every image by itself. The bands are
too narrow where the map errs: each landmark errs the same way in every image, and is taken to err anew.
"""

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import losnav as ln

FOCAL = 458.0  # px, to speak of pixels where the file has x/z
PIXEL = 1.0  # 1-sigma of a track, px
GATE = 0.99  # probability with which a good look passes
# An ADIS16448, as its users publish it.
UNIT = ln.dynamics.Imu(
    velocity_random_walk=2e-3,
    angle_random_walk=1.7e-4,
    accelerometer_bias_walk=3e-3,
    gyroscope_bias_walk=1.94e-5,
    accelerometer_bias=0.2,
    gyroscope_bias=0.1,
)
SETTLED = 1.0  # s


@dataclass
class Drive:
    """A recording as the filter takes it."""

    times: np.ndarray  # (F,)
    pixels: np.ndarray  # (F, 2 L), NaN where a landmark was not seen
    controls: np.ndarray  # ((F - 1) substeps, 6)
    substeps: int
    camera: ln.sensors.LandmarkCamera
    gravity: np.ndarray
    truth: np.ndarray | None


@dataclass
class Found:
    """What the filter made of it."""

    log: ln.filters.FilterLog
    state: ln.NavState  # the last one
    sigma: np.ndarray  # of it
    seen: np.ndarray  # (F - 1, L) bool
    used: np.ndarray  # likewise

    @property
    def wrong(self) -> np.ndarray:
        """Tracks that were rejected more often than not."""
        looks, taken = self.seen.sum(axis=0), self.used.sum(axis=0)
        return np.flatnonzero((looks >= 5) & (taken < looks / 2))


def load(file) -> Drive:
    with np.load(file) as arrays:
        d = {name: arrays[name] for name in arrays.files}
    times, count = d["frame_t"], len(d["landmarks"])
    frames = np.argmin(np.abs(d["obs_t"][:, np.newaxis] - times), axis=1)
    pixels = np.full((len(times), count, 2), np.nan)
    pixels[frames, d["obs_lm"]] = FOCAL * d["obs_uv"]
    # As many steps from image to image as the unit has samples there, the mean of what it showed over each.
    substeps = round(float(np.median(np.diff(times)) / np.median(np.diff(d["imu_t"]))))
    parts = np.arange(substeps) / substeps
    edges = np.append((times[:-1, np.newaxis] + np.diff(times)[:, np.newaxis] * parts).ravel(), times[-1])
    shown = np.concatenate([d["accel"], d["gyro"]], axis=1)
    areas = np.diff(d["imu_t"])[:, np.newaxis] * (shown[1:] + shown[:-1]) / 2
    integral = np.concatenate([np.zeros((1, 6)), np.cumsum(areas, axis=0)])
    at_edges = np.stack([np.interp(edges, d["imu_t"], column) for column in integral.T], axis=1)
    controls = np.diff(at_edges, axis=0) / np.diff(edges)[:, np.newaxis]
    camera = ln.sensors.LandmarkCamera(
        d["landmarks"],
        FOCAL,
        PIXEL,
        np.square(d["landmark_sigma"])[:, :, np.newaxis] * np.eye(3),
        camera_from_body=d["R_bc"].T,
        lever_arm=d["t_bc"],
    )
    flat = pixels.reshape(len(times), -1)
    return Drive(times, flat, controls, substeps, camera, d["gravity"], d.get("p_wb_vicon"))


def first_state(drive: Drive) -> ln.NavState:
    """Pose of the first image, at rest."""
    seen = np.isfinite(drive.pixels[0, ::2])
    los = np.column_stack([drive.pixels[0].reshape(-1, 2)[seen] / FOCAL, np.ones(seen.sum())])
    los /= np.linalg.norm(los, axis=1, keepdims=True)
    pose = ln.solve_pose_robust(drive.camera.landmarks[seen], los, sigma=2 * PIXEL / FOCAL)
    dcm = drive.camera.camera_from_body.T @ pose.dcm
    return ln.NavState.from_dcm(pose.position - dcm.T @ drive.camera.lever_arm, np.zeros(3), dcm)


def navigate(drive: Drive, gate: float | None = GATE) -> Found:
    model = ln.dynamics.Strapdown(ln.dynamics.Site.inertial(), ln.gravity.Uniform(drive.gravity), UNIT)
    sigma = np.repeat([0.05, 0.5, 0.02, UNIT.accelerometer_bias, UNIT.gyroscope_bias], 3)
    ekf = ln.ExtendedKalmanFilter(
        model, first_state(drive), np.diag(sigma**2), gate=gate, time=float(drive.times[0])
    )
    pairs = [(drive.camera, drive.pixels[1:])]
    log = ekf.run(drive.times[1:], pairs, controls=drive.controls, substeps=drive.substeps)
    seen, used = np.isfinite(drive.pixels[1:, ::2]), log.used[:, ::2]
    return Found(log, ekf.state, np.sqrt(np.diag(ekf.covariance)), seen, used)


def error(drive: Drive, found: Found) -> np.ndarray:
    """``(F - 1, 3)`` metres."""
    return np.asarray(found.log.state.position - drive.truth[1:])


def main(file: str, figure: str | None) -> None:
    drive = load(file)
    found = navigate(drive)
    state, sigma = found.state, found.sigma
    print(f"{len(drive.times)} images, {found.seen.sum()} looks at landmarks, {drive.substeps} samples each")
    print(f"rejected: {1 - found.used.sum() / found.seen.sum():.1%}")
    print(f"tracks that are wrong: {', '.join(map(str, found.wrong)) or 'none'}")
    for name, bias, three in (
        ("accelerometer", state.accelerometer_bias, sigma[9:12]),
        ("gyroscope", state.gyroscope_bias, sigma[12:15]),
    ):
        print(f"bias of the {name}: {np.round(bias, 4)} +- {np.round(three, 4)}")
    if drive.truth is not None:
        settled = drive.times[1:] > drive.times[0] + SETTLED
        for label, run in (("with the gate", found), ("without it", navigate(drive, gate=None))):
            rms = np.sqrt((error(drive, run)[settled] ** 2).sum(axis=1).mean())
            print(f"position error {label}: {1e3 * rms:.1f} mm rms")
    if figure:
        draw(drive, found, Path(figure))


def draw(drive, found, path):
    """Errors with 3 sigma, looks and rejections over time."""
    from losnav.plotting import BLUE, GREY, RED, figure_style, new_figure, save_figure

    with figure_style():
        title = "An inertial unit and tracks of mapped landmarks"
        drawing, axes = new_figure(4, 1, size=(9.0, 8.0), title=title, sharex=True)
        time = drive.times[1:]
        for k, axis in enumerate("xyz"):
            panel = axes[k, 0]
            three = 3e3 * found.log.sigma[:, k]
            panel.fill_between(time, -three, three, color=GREY, alpha=0.4, linewidth=0, label="3 sigma")
            if drive.truth is not None:
                panel.plot(time, 1e3 * error(drive, found)[:, k], color=BLUE, label="error")
            panel.set(ylabel=f"{axis} [mm]", ylim=(-60, 60))
        axes[0, 0].legend(ncol=2)
        axes[3, 0].step(time, found.seen.sum(axis=1), color=GREY, label="seen")
        axes[3, 0].step(time, (found.seen & ~found.used).sum(axis=1), color=RED, label="rejected")
        axes[3, 0].set(ylabel="landmarks", xlabel="time [s]")
        axes[3, 0].legend(ncol=2)
        save_figure(drawing, path)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else None)
