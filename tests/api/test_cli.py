"""The command line: what it prints, its exit codes, and one clear line for bad input."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from losnav import __version__
from losnav.cli import main
from losnav.cli.scenario_commands import parse_setting
from losnav.errors import InvalidInputError
from losnav.scenarios import NAMES, available

SMALL = ["--set", "sampling=43", "--set", "cold_times=0,100", "--runs", "6"]


def refused(capsys, arguments):
    """Run a command that must be refused and return its one line."""
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("losnav")
    return captured.err


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"losnav {__version__}\n"


@pytest.mark.parametrize("command", [[], ["list"], ["run"], ["reproduce"], ["solve-pose"], ["bench"]])
def test_help(capsys, command):
    assert main([*command, "--help"]) == 0
    assert "usage: losnav" in capsys.readouterr().out


def test_module_runs_as_a_program():
    done = subprocess.run(
        [sys.executable, "-m", "losnav.cli", "list"], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0
    assert done.stderr == ""
    assert [line.split()[0] for line in done.stdout.splitlines()] == list(NAMES)


def test_list_json(capsys):
    assert main(["list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    assert [entry["name"] for entry in listed] == list(NAMES)
    assert listed[0]["available"] is True


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        ([], "COMMAND"),
        (["fly"], "fly"),
        (["run"], "NAME"),
        (["run", "moon"], "moon"),
        (["run", "landmark-landing", "--runs", "0"], "runs"),
        (["run", "landmark-landing", "--runs", "many"], "many"),
        (["run", "landmark-landing", "--seed", "-1"], "seed"),
        (["run", "landmark-landing", "--jobs", "0"], "jobs"),
        (["run", "landmark-landing", "--set", "duration"], "KEY=VALUE"),
        (["run", "landmark-landing", "--set", "durations=4"], "durations"),
        (["run", "landmark-landing", "--set", "duration=long"], "long"),
        (["run", "landmark-landing", "--set", "duration=-4"], "duration"),
        (["run", "landmark-landing", "--resume"], "--out"),
        (["run", "landmark-landing", "--out", "/proc/none"], "/proc/none"),
        (["reproduce", "moon"], "moon"),
        (["bench", "--calls", "0"], "--calls"),
    ],
)
def test_bad_input_is_one_line(capsys, arguments, word):
    assert word in refused(capsys, arguments)


def test_a_later_scenario_is_refused(capsys):
    for name in set(NAMES) - set(available()):
        assert "landmark-landing" in refused(capsys, ["run", name])


@pytest.mark.parametrize(
    ("text", "default", "value"),
    [
        ("3", 1, 3),
        ("1e-6", 0.5, 1e-6),
        ("tangent", "focal-plane", "tangent"),
        ("1,2", (0.0,), (1.0, 2.0)),
        ("1,2,3;4,5,6", ((0.0,),), ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))),
    ],
)
def test_settings_take_the_type_of_the_default(text, default, value):
    assert parse_setting("key", text, default) == value


@pytest.mark.parametrize(
    ("text", "default"), [("1.5", 1), ("a", 0.5), ("1,b", (0.0,)), ("", 0.5), ("deg", 0.5)]
)
def test_settings_of_the_wrong_type(text, default):
    with pytest.raises(InvalidInputError, match="key"):
        parse_setting("key", text, default)


def test_run_prints_tables(capsys):
    assert main(["run", "landmark-landing", *SMALL]) == 0
    captured = capsys.readouterr()
    assert "altitude [m]" in captured.out
    assert captured.err == ""


def test_run_json_and_out(capsys, tmp_path):
    pytest.importorskip("matplotlib")
    out = tmp_path / "landing"
    assert main(["run", "landmark-landing", *SMALL, "--out", str(out), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report == json.loads((out / "report.json").read_text())
    assert report["parameters"]["sampling"] == 43
    assert report["tables"][0]["rows"][0]["t [s]"] == 0
    assert len(report["figures"]) == len(list(out.glob("*.png"))) == 7


def test_stored_campaign(capsys, tmp_path):
    command = ["run", "landmark-landing", *SMALL, "--out", str(tmp_path), "--no-plot", "--json"]
    assert main(command) == 0
    first = capsys.readouterr().out
    assert main([*command, "--resume"]) == 0
    assert capsys.readouterr().out == first
    assert main(command) == 0
    again = capsys.readouterr()
    assert again.out == first
    assert "finished campaign" in again.err
    assert main([*command, "--resume", "--seed", "8"]) == 2
    assert "seed 0 instead of 8" in capsys.readouterr().err
    (tmp_path / "results.npz").unlink()
    assert "resume" in refused(capsys, command)


def test_jobs_change_nothing(capsys):
    command = ["run", "landmark-landing", *SMALL, "--json"]
    assert main(command) == 0
    alone = capsys.readouterr().out
    assert main([*command, "--jobs", "2"]) == 0
    assert capsys.readouterr().out == alone


def test_reproduce(capsys, tmp_path):
    pytest.importorskip("matplotlib")
    command = ["reproduce", "landmark-landing", "--runs", "20", "--out", str(tmp_path)]
    assert main(command) == 0
    text = capsys.readouterr().out
    assert "printed:" in text
    assert "GLSDC" in text
    folder = tmp_path / "landmark-landing"
    stored = json.loads((folder / "claims.json").read_text())
    assert "printed:" in (folder / "claims.txt").read_text()
    assert len(list(folder.glob("*.png"))) == 7
    assert main([*command, "--json", "--no-plot"]) == 0
    again = json.loads(capsys.readouterr().out)
    assert again[0]["claims"] == stored["claims"]


def test_strict_fails_when_a_verdict_differs(capsys, monkeypatch):
    from losnav.scenarios.landmark_landing.result import LandingResult
    from losnav.scenarios.verdicts import Claim, Claims

    def claims(verdict):
        claim = Claim("1", "it lands", "-", "-", 1.0, (1.0, 1.0), 0.95, verdict, "seen", "holds")
        monkeypatch.setattr(LandingResult, "claims", lambda self: Claims([claim]))

    command = ["reproduce", "landmark-landing", "--runs", "1", "--no-plot"]
    claims("does not")
    assert main(command) == 0
    assert main([*command, "--strict"]) == 1
    assert "landmark-landing 1" in capsys.readouterr().err
    claims("holds")
    assert main([*command, "--strict"]) == 0


def test_no_matplotlib_is_said_and_not_fatal(capsys, monkeypatch, tmp_path):
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    assert main(["run", "landmark-landing", *SMALL, "--out", str(tmp_path)]) == 0
    captured = capsys.readouterr()
    assert "losnav[plot]" in captured.err
    assert "altitude" in captured.out


def test_bench(capsys):
    assert main(["bench", "--calls", "20", "--batch", "50", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    for size in report["solve_pose"]:
        assert 0 < size["latency_us"]["p50"] <= size["latency_us"]["p99"] <= size["latency_us"]["max"]
        assert size["converged"] > 0.95
    assert main(["bench", "--calls", "5", "--batch", "5"]) == 0
    assert "N = 4" in capsys.readouterr().out


def test_interrupt_keeps_the_finished_runs(tmp_path):
    # The program itself, listening to Ctrl-C even where the tests run in the background of a shell.
    listening = "import signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler)"
    program = [
        sys.executable,
        "-c",
        f"{listening}; from losnav.cli import main; sys.exit(main(sys.argv[1:]))",
    ]
    command = [*program, "run", "landmark-landing", "--runs", "100000", "--no-plot"]
    process = subprocess.Popen([*command, "--out", str(tmp_path)], stderr=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 30
    while not list(tmp_path.glob("block-*.npz")):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.01)
    os.kill(process.pid, signal.SIGINT)
    _, message = process.communicate(timeout=30)
    assert process.returncode == 130
    assert "--resume" in message
    assert "Traceback" not in message
    assert list(tmp_path.glob("block-*.npz"))


def test_death_of_a_worker_is_one_line(capsys, monkeypatch):
    from concurrent.futures.process import BrokenProcessPool

    def dies(*_arguments, **_options):
        raise BrokenProcessPool

    monkeypatch.setattr("losnav.scenarios.landmark_landing.run_campaign", dies)
    assert main(["run", "landmark-landing", "--runs", "2"]) == 1
    assert capsys.readouterr().err.count("\n") == 1


def test_closed_pipe_is_no_error():
    script = f"{sys.executable} -m losnav.cli run landmark-landing --runs 2 --json | head -c 10"
    done = subprocess.run(
        ["bash", "-c", f"set -o pipefail; {script}"], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.stderr == ""
    assert done.returncode == 0
