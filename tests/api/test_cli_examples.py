"""The examples run and say what they promise."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np

from losnav.cli import main

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def run(script, *arguments):
    command = [sys.executable, str(EXAMPLES / script), *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=True).stdout


def test_pose_from_files(capsys):
    folder = EXAMPLES / "pose_from_files"
    command = [
        "solve-pose",
        str(folder / "landmarks.csv"),
        str(folder / "observations.csv"),
        "--focal",
        "1200",
    ]
    command += [
        "--principal-point",
        "640,480",
        "--distortion",
        "-0.05",
        "--sigma-px",
        "0.3",
        "--robust",
        "--json",
    ]
    assert main(command) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["rejected"] == ["Gully"]
    # The camera the files were made with.
    error = np.subtract(report["position_m"], (-120.0, 80.0, 900.0))
    assert np.all(abs(error) < 4 * np.array(report["sigma_position_m"]))


def test_own_campaign():
    text = run("own_campaign.py")
    assert "within 3 sigma" in text
    assert "4 degrees of freedom" in text


def test_landing_in_parallel_resumes(tmp_path):
    first = run("landing_in_parallel.py", str(tmp_path / "campaign"))
    assert "DOES NOT" in first
    assert run("landing_in_parallel.py", str(tmp_path / "campaign")) == first
