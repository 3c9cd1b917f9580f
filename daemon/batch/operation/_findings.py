"""Findings of the doctor: one line each, with the remedy; nothing is changed to come to them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Final

from daemon.batch.paths import Endpoint

_LONGEST: Final = 400
"""Characters of an exception that nobody has thought of."""

_SHOWN: Final = 3


class FindingLevel(StrEnum):
    """How a finding is to be taken; a problem keeps runs from being executed or kept safe."""

    OK = "ok"
    WARNING = "warning"
    PROBLEM = "problem"


@dataclass(frozen=True, slots=True)
class DoctorFinding:
    """``subject`` is what was looked at, ``remedy`` what to do, empty when all is well."""

    level: FindingLevel
    subject: str
    message: str
    remedy: str = ""


@dataclass(frozen=True, slots=True)
class Examination:
    """Findings about the installation whose state directory is ``state``."""

    state: Path
    endpoint: Endpoint
    findings: tuple[DoctorFinding, ...]


def ok(subject: str, message: str) -> DoctorFinding:
    """All is well."""
    return DoctorFinding(FindingLevel.OK, subject, message)


def warning(subject: str, message: str, remedy: str) -> DoctorFinding:
    """Works, but somebody should know."""
    return DoctorFinding(FindingLevel.WARNING, subject, message, remedy)


def problem(subject: str, message: str, remedy: str) -> DoctorFinding:
    """Does not work."""
    return DoctorFinding(FindingLevel.PROBLEM, subject, message, remedy)


def names(things: Sequence[Path | str]) -> str:
    """Name the first of some paths or runs, and how many more there are."""
    more = f" and {len(things) - _SHOWN} more" if len(things) > _SHOWN else ""
    return ", ".join(map(str, things[:_SHOWN])) + more


def guarded(subject: str, check: Callable[[], Iterable[DoctorFinding]]) -> Iterator[DoctorFinding]:
    """Yield what a check finds; that it fails is a finding too, and never the end of the others.

    What is examined may be damaged in ways that nobody has thought of.
    """
    try:
        yield from check()
    except Exception as error:
        words = f"cannot be examined: {type(error).__name__}: {error}"[:_LONGEST]
        yield problem(subject, words, "it is damaged or in use in a way unknown to us: report it")
