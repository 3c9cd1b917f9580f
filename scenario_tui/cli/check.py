"""The command that finds problems in files."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from grammars.text.diagnostics import Finding, InputError, Severity
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer, ExitCode
from scenario_tui.cli.options import Base, refuse_missing_file
from scenario_tui.cli.output import report_findings, say


@dataclass(frozen=True, slots=True)
class CheckedFiles:
    """The findings about each file."""

    files: dict[str, tuple[Finding, ...]]


def check(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="FILE",
            help="Campaigns, floor plans, scenery or other layers.",
            autocompletion=completion.offers(
                completion.files(
                    ".yaml", ".yml", ".fpm", ".scenery", ".variation", ".jsonld", ".json"
                )
            ),
        ),
    ],
    base: Base = "",
) -> Answer[CheckedFiles]:
    """Find every problem in campaigns and layers.

    The check includes the geometry of every run, but executes none.
    """
    checks = {str(file): _check(file, base) for file in files}
    value = CheckedFiles({name: findings for name, (_, findings) in checks.items()})
    everything = (one for findings in value.files.values() for one in findings)
    wrong = any(one.severity is Severity.ERROR for one in everything)
    code = ExitCode.BAD_INPUT if wrong else ExitCode.EXPECTED
    return Answer("check", value, partial(_print_checks, checks), code)


def _check(file: Path, base: str) -> tuple[str, tuple[Finding, ...]]:
    """Return the kind of a file and its findings; a missing file gets a suggestion."""
    from scenario_tui.library.checking import check_file

    try:
        refuse_missing_file(str(file))
    except InputError as error:
        return "", error.findings
    return check_file(file, base=base)


def _print_checks(checks: dict[str, tuple[str, tuple[Finding, ...]]]) -> None:
    from scenario_tui.text.diagnostics import diagnostic_counts

    for name, (about, findings) in checks.items():
        report_findings(findings)
        say(f"{name}: {about + ', ' if about else ''}{diagnostic_counts(findings)}")
