"""Exceptions of losnav: bad input is an exception, non-convergence is a value."""

from __future__ import annotations

__all__ = [
    "DegenerateGeometryError",
    "InvalidInputError",
    "LosnavError",
    "NumericalError",
    "UnobservableError",
]


class LosnavError(Exception):
    """Base of every exception losnav raises on purpose."""


class InvalidInputError(LosnavError, ValueError):
    """An argument breaks a rule; the message names argument, index and rule, and what came instead."""


class DegenerateGeometryError(LosnavError):
    """The geometry admits no answer, whatever the measurements (for instance all landmarks on one line)."""


class UnobservableError(LosnavError):
    """The measurements cannot determine what was asked for."""


class NumericalError(LosnavError):
    """A factorisation or iteration failed where the input was valid."""
