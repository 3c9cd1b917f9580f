"""Findings of the doctor: one line each, with the remedy."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Final

from daemon.batch.paths import Endpoint

_LONGEST: Final = 400
"""Longest text of an unexpected exception [characters]."""

_SHOWN: Final = 3


class FindingLevel(StrEnum):
    """Severity of a finding; a problem prevents runs or endangers their results."""

    OK = "ok"
    WARNING = "warning"
    PROBLEM = "problem"


@dataclass(frozen=True, slots=True)
class DoctorFinding:
    """Finding of a check of ``subject``; ``remedy`` is empty if all is well."""

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
    """Return a finding that all is well."""
    return DoctorFinding(FindingLevel.OK, subject, message)


def warning(subject: str, message: str, remedy: str) -> DoctorFinding:
    """Return a finding that works but needs attention."""
    return DoctorFinding(FindingLevel.WARNING, subject, message, remedy)


def problem(subject: str, message: str, remedy: str) -> DoctorFinding:
    """Return a finding that does not work."""
    return DoctorFinding(FindingLevel.PROBLEM, subject, message, remedy)


def names(things: Sequence[Path | str]) -> str:
    """Return the first of some paths or runs, and the number of the others."""
    more = f" and {len(things) - _SHOWN} more" if len(things) > _SHOWN else ""
    return ", ".join(map(str, things[:_SHOWN])) + more


def guarded(subject: str, check: Callable[[], Iterable[DoctorFinding]]) -> Iterator[DoctorFinding]:
    """Yield the findings of a check; its failure is a finding too, and never stops the others."""
    try:
        yield from check()
    except Exception as error:
        words = f"cannot be examined: {type(error).__name__}: {error}"[:_LONGEST]
        yield problem(subject, words, "it is damaged or in use in an unexpected way: report it")
