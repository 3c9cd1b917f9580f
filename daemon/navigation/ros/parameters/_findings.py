"""What is found while parameters are read: what cannot run, what means nothing."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import TypeAlias

Path: TypeAlias = tuple[str | int, ...]
"""Where a value stands in the tree, such as ``("move_base", "DWAPlannerROS", "sim_time")``."""


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing to say about the value at ``path``, with what to do about it in ``hint``."""

    path: Path
    message: str
    hint: str = ""

    def __str__(self) -> str:
        hint = f"; {self.hint}" if self.hint else ""
        return f"{joined(self.path)}: {self.message}{hint}"


@dataclass(frozen=True, slots=True)
class Findings:
    """What a run can live with: ``problems`` are warnings, most of them unknown names.

    ``without_effect`` are known parameters that change nothing here, each with the reason.
    """

    problems: tuple[Finding, ...] = ()
    without_effect: tuple[Finding, ...] = ()


class ParameterError(ValueError):
    """Parameters no robot could be driven with: ``problems`` holds everything wrong."""

    def __init__(self, problems: Iterable[Finding]) -> None:
        self.problems = tuple(dict.fromkeys(problems))
        super().__init__("; ".join(str(problem) for problem in self.problems))


@dataclass(slots=True)
class Report:
    """Collects findings while a tree is read."""

    fatal: list[Finding] = field(default_factory=list)
    problems: list[Finding] = field(default_factory=list)
    without_effect: list[Finding] = field(default_factory=list)

    def findings(self) -> Findings:
        """Return what was found; raises :class:`ParameterError` for what is fatal."""
        if self.fatal:
            raise ParameterError(self.fatal)
        return Findings(
            tuple(dict.fromkeys(self.problems)), tuple(dict.fromkeys(self.without_effect))
        )


def joined(path: Path) -> str:
    """Return a path as ROS writes names, indices in brackets: ``move_base/footprint[2]``."""
    words = "/".join(str(part) for part in path if isinstance(part, str))
    return words + "".join(f"[{part}]" for part in path if isinstance(part, int))
