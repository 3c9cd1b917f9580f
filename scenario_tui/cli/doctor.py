"""The command that examines an installation: settings, connections, results."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Final

import typer

from grammars.text.diagnostics import InputError
from grammars.text.words import count_noun
from scenario_tui.cli.answer import Answer, ExitCode
from scenario_tui.cli.output import open_progress, print_line
from scenario_tui.source import DaemonTarget

if TYPE_CHECKING:
    from daemon.batch.doctor import DoctorFinding, Examination

_SIGNS: Final = {"ok": ("✓", "green"), "warning": ("!", "yellow"), "problem": ("✗", "bold red")}


def doctor(
    target: DaemonTarget,
    quick: Annotated[bool, "Verify the newest results only, and no files."] = False,
    traces: Annotated[bool, "Also read every trace and verify its digest."] = False,
) -> Answer[Examination]:
    """Examine the installation: settings, connections, results; with remedies.

    Compares every result with its digest. Changes nothing. Exits with 3 if there is a problem.
    """
    from daemon.batch.doctor import Examination, FindingLevel, examine, guarded
    from daemon.batch.paths import find_endpoint

    if quick and traces:
        raise typer.BadParameter("contradicts --quick: leave one out", param_hint="--traces")
    endpoint = find_endpoint(target.connect, target.state)
    with open_progress() as display:
        task = display.add_task("verifying", total=None)

        def progress(what: str, done: int, total: int) -> None:
            display.update(task, description=f"verifying {what}", completed=done, total=total)

        findings = examine(target.paths, endpoint, quick=quick, traces=traces, progress=progress)
    # Examined here because the daemon's packages do not know the dashboard.
    findings = (*findings, *guarded("config", lambda: [_check_settings()]))
    value = Examination(target.paths.state, endpoint, findings)
    is_ill = any(finding.level is FindingLevel.PROBLEM for finding in findings)
    code = ExitCode.INFRASTRUCTURE if is_ill else ExitCode.EXPECTED
    return Answer("doctor", value, partial(_print_findings, findings), code)


def _check_settings() -> DoctorFinding:
    """Return the finding about the settings file of the dashboard."""
    from daemon.batch.doctor import DoctorFinding, FindingLevel
    from scenario_tui.dashboard.config import config_path, read_config

    try:
        config = read_config()
    except InputError as error:
        remedy = "correct the file: the dashboard does not start until then"
        problem = str(error).splitlines()[0]
        return DoctorFinding(FindingLevel.PROBLEM, "config", problem, remedy)
    message = f"{config_path()} does not exist: the defaults apply"
    if config.path is not None:
        parts = [count_noun(len(config.keys), "key")] if config.keys else []
        parts += [f"theme {config.theme}"] if config.theme else []
        parts += ["read-only"] if config.read_only else []
        message = f"{config.path} {', '.join(parts)}".rstrip()
    return DoctorFinding(FindingLevel.OK, "config", message)


def _print_findings(findings: tuple[DoctorFinding, ...]) -> None:
    """Print a line for each finding, and its remedy below it."""
    from rich.text import Text

    for finding in findings:
        sign, style = _SIGNS[finding.level]
        line = Text(f"{sign} {finding.level:<8}", style=style)
        line.append(f"{finding.subject:<11} {finding.message}", style="default")
        if finding.remedy:
            line.append(f"\n            {finding.remedy}", style="cyan")
        print_line(line)
