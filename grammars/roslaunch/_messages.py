"""Words and places that several tags of launch files have in common."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from grammars.roslaunch._names import to_bool
from grammars.roslaunch._substitution import Substituted
from grammars.text.diagnostics import Diagnostic, InputError, Where


@dataclass(frozen=True, slots=True)
class NeededDiagnostic(Diagnostic):
    """Something that is missing, with who needs it; ``missing`` is what is said without that."""

    missing: str = ""


def needed(
    missing: Iterable[Diagnostic], by: str, where: Where, hint: str = ""
) -> list[Diagnostic]:
    """Return what is missing as errors that say who needs it."""
    return [
        NeededDiagnostic(
            one.where,
            f"{one.message}, which is needed for {by} ({Path(where.file).name}:{where.line})",
            "; ".join(filter(None, (one.hint, hint))),
            one.severity,
            _without_needs(one),
        )
        for one in missing
    ]


def _without_needs(problem: Diagnostic) -> str:
    return problem.missing if isinstance(problem, NeededDiagnostic) else problem.message


def said_once(problems: Iterable[Diagnostic]) -> list[Diagnostic]:
    """Return problems without those that say of one place that somebody else needs it too."""
    found: dict[tuple[Where, str], Diagnostic] = {}
    for problem in problems:
        found.setdefault((problem.where, _without_needs(problem)), problem)
    return list(found.values())


def truth(found: Substituted, name: str, where: Where) -> bool:
    """Return what the attribute ``name`` says, true or false; raises :class:`InputError`."""
    if found.missing:
        raise InputError(needed(found.missing, name, where))
    try:
        return to_bool(found.text)
    except ValueError as error:
        raise InputError.at(where, f"{name}: {error}", "write true or false") from error


def remedies(path: Path, near: str) -> str:
    """Return what to do about a file that is not there; ``near`` is what it may be meant to be."""
    skip = f'if it is not needed, write "{path.name}" under "skip"'
    return f"{near}; {skip}" if near else skip


def line_and_column(text: str, offset: int) -> tuple[int, int]:
    """Return line and column, both from 1, of a character offset."""
    before = text[:offset]
    return before.count("\n") + 1, offset - (before.rfind("\n") + 1) + 1
