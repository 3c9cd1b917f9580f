"""Commands that keep an installation well: doctor, metrics, gc."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from scenario_tui.cli.exit_codes import ExitCode
from scenario_tui.cli.options import AsJson, Connect, State

if TYPE_CHECKING:
    from daemon.batch.ledger import SweepResult
    from daemon.batch.operation import DoctorFinding

_SIGNS = {"ok": ("✓", "green"), "warning": ("!", "yellow"), "problem": ("✗", "bold red")}


def doctor(connect: Connect = "", state: State = None, as_json: AsJson = False) -> None:
    """Say what is configured, what answers, and what is wrong, each with its remedy.

    Changes nothing. Leaves with 3 when there is a problem.
    """
    from pathlib import Path

    from daemon.batch.operation import FindingLevel, examine
    from daemon.batch.paths import StatePaths, find_endpoint
    from scenario_tui.cli.output import emit

    places, endpoint = StatePaths.find(state), find_endpoint(connect, state)
    findings = (*examine(places, endpoint, Path.cwd()), _check_settings())
    if as_json:
        emit("doctor", state=str(places.state), endpoint=endpoint, findings=list(findings))
    else:
        _print_findings(findings)
    if any(finding.level is FindingLevel.PROBLEM for finding in findings):
        raise typer.Exit(ExitCode.INFRASTRUCTURE)


def _check_settings() -> DoctorFinding:
    """Say which file the dashboard takes its settings from, and whether it can."""
    from daemon.batch.operation import DoctorFinding, FindingLevel
    from grammars.text.diagnostics import InputError
    from scenario_tui.dashboard.config import read_config
    from scenario_tui.text.formatting import pluralise

    try:
        config = read_config()
    except InputError as error:
        first, *_ = str(error).splitlines()
        return DoctorFinding(
            FindingLevel.PROBLEM,
            "config",
            first,
            "correct it: the dashboard does not start until then",
        )
    if not config.text:
        return DoctorFinding(
            FindingLevel.OK, "config", f"{config.path} is not there: everything as usual", ""
        )
    parts = [pluralise(len(config.keys), "key")] if config.keys else []
    parts += [f"theme {config.theme}"] if config.theme else []
    parts += ["read-only"] if config.read_only else []
    return DoctorFinding(
        FindingLevel.OK, "config", f"{config.path} {', '.join(parts)}".rstrip(), ""
    )


def _print_findings(findings: tuple[DoctorFinding, ...]) -> None:
    from rich.text import Text

    from scenario_tui.cli.output import stdout_console

    console = stdout_console()
    for finding in findings:
        sign, style = _SIGNS[finding.level]
        line = Text(f"{sign} {finding.level:<8}", style=style)
        line.append(f"{finding.subject:<11} {finding.message}", style="default")
        if finding.remedy:
            line.append(f"\n            {finding.remedy}", style="cyan")
        console.print(line, soft_wrap=True)


def metrics(connect: Connect = "", state: State = None, as_json: AsJson = False) -> None:
    """Write the daemon's numbers in the text format of Prometheus.

    Runs by state and outcome, workers and their slots, rate, disk; for node_exporter's textfile
    collector, say.
    """
    from daemon.batch.operation import DaemonStatus, prometheus_text
    from scenario_tui.cli.output import emit
    from scenario_tui.cli.target import DaemonTarget

    with DaemonTarget(connect, state).open() as daemon:
        standing = DaemonStatus(
            daemon.overview(), daemon.campaigns(), daemon.workers(), daemon.disk()
        )
    if as_json:
        emit("metrics", standing=standing)
        return
    typer.echo(prometheus_text(standing), nl=False)


def gc(
    keep: Annotated[
        int | None,
        typer.Option("--keep", min=0, help="Keep the traces of this many finished campaigns."),
    ] = None,
    older_than: Annotated[
        str, typer.Option("--older-than", metavar="AGE", help="Remove older ones: 30d, 12h.")
    ] = "",
    max_size: Annotated[
        str, typer.Option("--max-size", metavar="SIZE", help="Remove until they fit: 20GiB.")
    ] = "",
    dry_run: Annotated[
        bool, typer.Option("--dry-run", "-n", help="Say what would go; remove nothing.")
    ] = False,
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Remove traces of finished campaigns, the oldest first.

    Results stay, and say that the trace is gone; a daemon may be running. A trace goes when any
    of the options says so.
    """
    import time

    from daemon.batch.ledger import RetentionPolicy, sweep_traces
    from daemon.batch.paths import StatePaths
    from scenario_tui.cli.options import read_age, read_size
    from scenario_tui.cli.output import emit

    if keep is None and not older_than and not max_size:
        raise typer.BadParameter("say what to keep: --keep, --older-than or --max-size")
    keeping = RetentionPolicy(
        keep,
        read_age(older_than) if older_than else None,
        read_size(max_size) if max_size else None,
    )
    places = StatePaths.find(state)
    swept = sweep_traces(places, keeping, time.time(), dry=dry_run)
    if as_json:
        emit("gc", state=str(places.state), dry_run=dry_run, freed=swept.freed, kept=swept.kept,
             campaigns=_by_campaign(swept))  # fmt: skip
        return
    _print_swept(swept, dry_run)


def _by_campaign(swept: SweepResult) -> list[dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    for trace in swept.gone:
        entry = {"campaign": trace.campaign, "finished_at": trace.finished_at}
        one = found.setdefault(trace.campaign, {**entry, "traces": 0, "bytes": 0})
        one["traces"] += 1
        one["bytes"] += trace.size
    return list(found.values())


def _print_swept(swept: SweepResult, dry_run: bool) -> None:
    from daemon.batch.amounts import size_text
    from scenario_tui.cli.output import stdout_console
    from scenario_tui.text.formatting import pluralise

    console = stdout_console()
    for one in _by_campaign(swept):
        line = f"{one['campaign']}  {pluralise(one['traces'], 'trace')}  {size_text(one['bytes'])}"
        console.print(line, markup=False, soft_wrap=True)
    verb = "would remove" if dry_run else "removed"
    console.print(
        f"{verb} {pluralise(len(swept.gone), 'trace')}, {size_text(swept.freed)}; "
        f"{size_text(swept.kept)} of traces stay",
        soft_wrap=True,
    )
