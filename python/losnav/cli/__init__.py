"""The ``losnav`` command.

Exit codes: 0 done; 1 ran, but did not converge, or a claim check failed under ``--strict``; 2 bad input (one
line on standard error); 130 interrupted.
"""

from __future__ import annotations

import argparse
import os
import re
import sys
from collections.abc import Sequence
from concurrent.futures import BrokenExecutor
from typing import NoReturn

from losnav.cli import bench, scenario_commands, solve_attitude, solve_pose
from losnav.errors import LosnavError

__all__ = ["main"]

NOT_DONE, BAD_INPUT, INTERRUPTED = 1, 2, 130

_NEGATIVE_LIST = re.compile(r"-\.?\d[^,]*,")


class _Parser(argparse.ArgumentParser):
    """A parser that answers a mistake with one line."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code.

    Parameters
    ----------
    argv : sequence of str, optional
        Arguments without the program's name; those of the process by default.

    Returns
    -------
    int
        Exit code.

    Examples
    --------
    >>> from losnav.cli import main
    >>> main(["list"]) == 0        # doctest: +ELLIPSIS
    landmark-landing ...
    True
    """
    parser = _build_parser()
    try:
        arguments = parser.parse_args(_joined(sys.argv[1:] if argv is None else argv))
        code: int = arguments.command(arguments)
        sys.stdout.flush()
        return code
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else BAD_INPUT
    except KeyboardInterrupt:
        print(
            "losnav: interrupted; with --out, finished runs are kept and --resume continues", file=sys.stderr
        )
        return INTERRUPTED
    except BrokenPipeError:
        # The reader (head, less) has left; nothing more can be said, not even by the interpreter's last
        # flush.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except BrokenExecutor:
        print(
            "losnav: a worker process died; with --out, finished runs are kept for --resume", file=sys.stderr
        )
        return NOT_DONE
    except (LosnavError, OSError) as error:
        print(f"losnav: error: {' '.join(str(error).split())}", file=sys.stderr)
        return BAD_INPUT


def _joined(argv: Sequence[str]) -> list[str]:
    """Join options with values like -1,2: argparse takes a minus sign and a comma for another option."""
    joined: list[str] = []
    for word in argv:
        if joined and joined[-1].startswith("--") and "=" not in joined[-1] and _NEGATIVE_LIST.match(word):
            joined[-1] += f"={word}"
        else:
            joined.append(word)
    return joined


def _build_parser() -> argparse.ArgumentParser:
    from losnav import __version__

    parser = _Parser(
        prog="losnav",
        description="Line-of-sight navigation: where am I, how am I oriented, and how well can I know it.",
        epilog="Exit codes: 0 done, 1 not converged (or a claim check failed with --strict), 2 bad input.",
    )
    parser.add_argument("--version", action="version", version=f"losnav {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    scenario_commands.add_commands(commands)
    solve_pose.add_command(commands)
    solve_attitude.add_command(commands)
    bench.add_command(commands)
    return parser
