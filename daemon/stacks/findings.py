"""Findings about the parameters of a stack: errors, warnings, values without effect."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TypeAlias

ParameterLocation: TypeAlias = tuple[str | int, ...]
"""Where a value stands in the tree, such as ``("move_base", "DWAPlannerROS", "sim_time")``."""


@dataclass(frozen=True, slots=True)
class ParameterFinding:
    """A message about the value at ``path``, with the remedy in ``hint``.

    ``unread``: no part of the stack reads a value of that name.
    """

    path: ParameterLocation
    message: str
    hint: str = ""
    unread: bool = False

    def __str__(self) -> str:
        hint = f"; {self.hint}" if self.hint else ""
        return f"{format_path(self.path)}: {self.message}{hint}"


@dataclass(frozen=True, slots=True)
class ParameterFindings:
    """Findings that stop no run: ``problems`` are warnings, most of them about unknown names.

    ``without_effect`` are known parameters that change nothing here, each with the reason.
    """

    problems: tuple[ParameterFinding, ...] = ()
    without_effect: tuple[ParameterFinding, ...] = ()


class ParameterError(ValueError):
    """Unusable parameters: ``problems`` are the errors, ``findings`` the warnings."""

    def __init__(
        self, problems: Iterable[ParameterFinding], findings: ParameterFindings | None = None
    ) -> None:
        self.problems = tuple(dict.fromkeys(problems))
        self.findings = findings or ParameterFindings()
        super().__init__("; ".join(str(problem) for problem in self.problems))


@dataclass(slots=True)
class FindingCollector:
    """Collector of findings while a tree is read."""

    fatal: list[ParameterFinding] = field(default_factory=list)
    problems: list[ParameterFinding] = field(default_factory=list)
    without_effect: list[ParameterFinding] = field(default_factory=list)

    def refuse(self, path: ParameterLocation, message: str, hint: str = "") -> None:
        """Add an error."""
        self.fatal.append(ParameterFinding(path, message, hint))

    def warn(self, path: ParameterLocation, message: str, hint: str = "") -> None:
        """Add a warning."""
        self.problems.append(ParameterFinding(path, message, hint))

    def ignore(self, path: ParameterLocation, reason: str) -> None:
        """Add a known parameter that changes nothing here."""
        self.without_effect.append(ParameterFinding(path, reason))

    def findings(self) -> ParameterFindings:
        """Return the findings; raises :class:`ParameterError` if one is fatal."""
        findings = ParameterFindings(
            tuple(dict.fromkeys(self.problems)), tuple(dict.fromkeys(self.without_effect))
        )
        if self.fatal:
            raise ParameterError(self.fatal, findings)
        return findings


def format_path(path: ParameterLocation) -> str:
    """Return a path as ROS writes names, indices in brackets: ``move_base/footprint[2]``."""
    words = "/".join(str(part) for part in path if isinstance(part, str))
    return words + "".join(f"[{part}]" for part in path if isinstance(part, int))
