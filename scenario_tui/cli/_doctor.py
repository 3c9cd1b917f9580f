"""The command that looks for trouble: doctor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import typer

from scenario_tui.cli._exits import ExitCode
from scenario_tui.cli._options import AsJson, Connect, State

if TYPE_CHECKING:
    from daemon.operation import Finding

_SIGNS = {"ok": ("✓", "green"), "warning": ("!", "yellow"), "problem": ("✗", "bold red")}


def doctor(connect: Connect = "", state: State = None, as_json: AsJson = False) -> None:
    """Say what is configured, what answers, and what is wrong, each with its remedy.

    Changes nothing. Leaves with 3 when there is a problem.
    """
    from pathlib import Path

    from daemon.operation import Level, examine
    from daemon.places import Places, find_endpoint
    from scenario_tui.cli._output import emit

    places, endpoint = Places.find(state), find_endpoint(connect, state)
    findings = (*examine(places, endpoint, Path.cwd()), _settings())
    if as_json:
        emit("doctor", state=str(places.state), endpoint=endpoint, findings=list(findings))
    else:
        _print(findings)
    if any(finding.level is Level.PROBLEM for finding in findings):
        raise typer.Exit(ExitCode.INFRASTRUCTURE)


def _settings() -> Finding:
    """Say which file the dashboard takes its settings from, and whether it can."""
    from daemon.operation import Finding, Level
    from grammars.diagnostics import InputError
    from scenario_tui.config import read_config
    from scenario_tui.wording import counted

    try:
        config = read_config()
    except InputError as error:
        first, *_ = str(error).splitlines()
        return Finding(
            Level.PROBLEM, "config", first, "correct it: the dashboard does not start until then"
        )
    if not config.text:
        return Finding(Level.OK, "config", f"{config.path} is not there: everything as usual", "")
    parts = [counted(len(config.keys), "key")] if config.keys else []
    parts += [f"theme {config.theme}"] if config.theme else []
    parts += ["read-only"] if config.read_only else []
    return Finding(Level.OK, "config", f"{config.path} {', '.join(parts)}".rstrip(), "")


def _print(findings: tuple[Finding, ...]) -> None:
    from rich.text import Text

    from scenario_tui.cli._output import out

    console = out()
    for finding in findings:
        sign, style = _SIGNS[finding.level]
        line = Text(f"{sign} {finding.level:<8}", style=style)
        line.append(f"{finding.subject:<11} {finding.message}", style="default")
        if finding.remedy:
            line.append(f"\n            {finding.remedy}", style="cyan")
        console.print(line, soft_wrap=True)
