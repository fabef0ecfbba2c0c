"""``losnav list``, ``run`` and ``reproduce``: published systems and their claims."""

from __future__ import annotations

import argparse
import contextlib
import importlib.util
import json
import math
import sys
from dataclasses import MISSING, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from losnav import scenarios
from losnav.campaign import is_finished
from losnav.errors import InvalidInputError

if TYPE_CHECKING:
    import concurrent.futures

__all__ = ["add_commands", "parse_setting"]

CHECK_FAILED = 1
_REPRODUCE_RUNS = 1000


def add_commands(commands: Any) -> None:
    """Add the three commands to a parser's subparsers."""
    command = commands.add_parser("list", help="list the scenarios", description="List the scenarios.")
    command.add_argument("--json", action="store_true", help="print JSON")
    command.set_defaults(command=_list)

    command = commands.add_parser(
        "run",
        help="run a scenario",
        description="Run a scenario's Monte Carlo campaign and print its tables.",
        epilog=(
            "With --out the campaign is stored as it goes; after an interrupt or a crash, --resume "
            "completes it with exactly the results of an uninterrupted one. A finished campaign is read back."
        ),
    )
    command.add_argument("name", metavar="NAME", help="see losnav list")
    command.add_argument("--runs", type=int, default=100, metavar="N", help="Monte Carlo runs (default 100)")
    command.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        dest="settings",
        help=(
            "replace a parameter; SI and radians, or with the suffix deg or arcsec; lists as 1,2,3, lists of "
            "points as 1,2,3;4,5,6"
        ),
    )
    command.add_argument("--resume", action="store_true", help="continue the campaign stored in --out")
    _add_common(command)
    command.set_defaults(command=_run)

    command = commands.add_parser(
        "reproduce",
        help="judge the published claims of a scenario",
        description="Run a scenario as published, judge every claim, and draw the figures.",
        epilog=(
            "Figures go to DIR/NAME (DIR is 'out' by default). With --out the campaign is stored there too "
            "and continued if the command is repeated."
        ),
    )
    command.add_argument(
        "name", metavar="NAME", nargs="?", default="all", help="a scenario, or all (default)"
    )
    command.add_argument(
        "--runs",
        type=int,
        default=_REPRODUCE_RUNS,
        metavar="N",
        help=f"Monte Carlo runs (default {_REPRODUCE_RUNS})",
    )
    command.add_argument(
        "--strict", action="store_true", help="exit with 1 if a verdict differs from the established one"
    )
    _add_common(command)
    command.set_defaults(command=_reproduce)


def _add_common(command: argparse.ArgumentParser) -> None:
    command.add_argument("--seed", type=int, default=0, metavar="S", help="seed of the campaign (default 0)")
    command.add_argument("--out", metavar="DIR", help="folder for checkpoints, results and figures")
    command.add_argument("--jobs", type=int, default=1, metavar="J", help="worker processes (default 1)")
    command.add_argument("--json", action="store_true", help="print JSON")
    command.add_argument("--no-plot", action="store_true", help="draw no figures")


def _list(arguments: argparse.Namespace) -> int:
    available = scenarios.available()
    if arguments.json:
        print(
            json.dumps([{"name": name, "available": name in available} for name in scenarios.NAMES], indent=1)
        )
        return 0
    for name in scenarios.NAMES:
        print(f"{name:<22}{_summary(name) if name in available else '(in a later version)'}")
    return 0


def _summary(name: str) -> str:
    module = sys.modules[type(scenarios.load(name)).__module__]
    return (module.__doc__ or "").strip().splitlines()[0]


def _run(arguments: argparse.Namespace) -> int:
    if arguments.resume and not arguments.out:
        raise InvalidInputError("--resume: expected --out with the folder of the campaign, got none")
    scenario = scenarios.load(arguments.name, **_settings(arguments.name, arguments.settings))
    read_back = bool(arguments.out) and is_finished(arguments.out)
    if read_back and not arguments.resume:
        print(f"losnav: reading the finished campaign in {arguments.out}", file=sys.stderr)
    with _executor(arguments.jobs) as executor:
        result = scenario.run(
            arguments.runs,
            arguments.seed,
            executor=executor,
            progress=True,
            out=arguments.out,
            resume=arguments.resume or read_back,
        )
    figures = [] if arguments.no_plot or not arguments.out else _draw(result, Path(arguments.out))
    tables = [{"title": table.title, "rows": table.records()} for table in result.tables()]
    report = {
        "scenario": arguments.name,
        "runs": arguments.runs,
        "seed": arguments.seed,
        "parameters": scenario.parameters(),
        "tables": tables,
        "figures": [str(path) for path in figures],
    }
    if arguments.out:
        Path(arguments.out, "report.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    if arguments.json:
        print(json.dumps(report, indent=1))
        return 0
    print("\n\n".join(str(table) for table in result.tables()))
    _print_figures(figures)
    return 0


def _reproduce(arguments: argparse.Namespace) -> int:
    names = scenarios.available() if arguments.name == "all" else (arguments.name,)
    reports, failed = [], []
    for name in names:
        scenario = scenarios.load(name)
        folder = Path(arguments.out or "out", name)
        with _executor(arguments.jobs) as executor:
            result = scenario.run(
                arguments.runs,
                arguments.seed,
                executor=executor,
                progress=True,
                out=folder if arguments.out else None,
                resume=True,
            )
        claims = result.claims()
        figures = [] if arguments.no_plot else _draw(result, folder)
        failed += [f"{name} {claim.number}" for claim in claims if not claim.as_established]
        report = {"scenario": name, "runs": arguments.runs, "seed": arguments.seed}
        report["claims"] = [claim.as_dict() for claim in claims]
        report["figures"] = [str(path) for path in figures]
        reports.append(report)
        if arguments.out:
            (folder / "claims.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
            (folder / "claims.txt").write_text(f"{claims}\n", encoding="utf-8")
        if not arguments.json:
            print(f"{name}, {arguments.runs} runs, seed {arguments.seed}\n")
            print(claims)
            _print_figures(figures)
    if arguments.json:
        print(json.dumps(reports, indent=1))
    if failed and arguments.strict:
        print(f"losnav: verdicts that differ from the established ones: {', '.join(failed)}", file=sys.stderr)
        return CHECK_FAILED
    return 0


def _executor(jobs: int) -> contextlib.AbstractContextManager[concurrent.futures.Executor | None]:
    if jobs == 1:
        return contextlib.nullcontext()
    from losnav.campaign import worker_pool

    return worker_pool(jobs)


def _draw(result: scenarios.Result, folder: Path) -> list[Path]:
    if importlib.util.find_spec("matplotlib") is None:
        print("losnav: no figures: matplotlib is not installed (pip install 'losnav[plot]')", file=sys.stderr)
        return []
    return result.plot(folder)


def _print_figures(figures: list[Path]) -> None:
    if figures:
        print("\nfigures:", *figures, sep="\n  ")


def _settings(name: str, settings: list[str]) -> dict[str, object]:
    """Turn ``key=value`` texts into parameters of a scenario."""
    if not settings:
        return {}
    known = {field.name: field.default for field in fields(scenarios.load(name))}  # type: ignore[arg-type]
    values: dict[str, object] = {}
    for setting in settings:
        key, separator, text = setting.partition("=")
        if not separator:
            raise InvalidInputError(f"--set: expected KEY=VALUE, got {setting!r}")
        if key not in known:
            raise InvalidInputError(f"--set: expected one of {', '.join(sorted(known))}, got {key!r}")
        values[key] = parse_setting(key, text, known[key])
    return values


def parse_setting(key: str, text: str, default: object) -> object:
    """Read a parameter's value in the type of its default.

    Parameters
    ----------
    key : str
        Name, for the error message.
    text : str
        Value: a number (``1e-6``, ``45deg``, ``5arcsec``), a word, ``1,2,3``, or ``1,2,3;4,5,6``.
    default : object
        The parameter's default.

    Returns
    -------
    int, float, str or tuple

    Raises
    ------
    InvalidInputError
        If the text is not of that type.

    Examples
    --------
    >>> from losnav.cli.scenario_commands import parse_setting
    >>> parse_setting("half_fov", "180deg", 1.0)
    3.141592653589793
    >>> parse_setting("times", "0,100", (0.0,))
    (0.0, 100.0)
    """
    try:
        if isinstance(default, str) or default is MISSING:
            return text
        if isinstance(default, int):
            return int(text)
        if isinstance(default, tuple) and isinstance(default[0], tuple):
            return tuple(tuple(_number(part) for part in row.split(",")) for row in text.split(";"))
        if isinstance(default, tuple):
            return tuple(_number(part) for part in text.split(","))
        return _number(text)
    except ValueError:
        kind = {int: "an integer", float: "a number"}.get(type(default), "numbers like 1,2,3")
        raise InvalidInputError(f"--set {key}: expected {kind}, got {text!r}") from None


def _number(text: str) -> float:
    text = text.strip()
    for unit, size in (("deg", 1.0), ("arcsec", 1 / 3600)):
        if text.endswith(unit):
            return math.radians(float(text[: -len(unit)]) * size)
    return float(text)
