"""Commands that keep an installation well: doctor, gc."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Final

import typer

from scenario_tui.cli.exit_codes import ExitCode
from scenario_tui.cli.options import AsJson, Connect, State, read_age, read_size
from scenario_tui.cli.output import Output, OutputPart, stderr_console, stdout_console

if TYPE_CHECKING:
    from daemon.batch.ledger import StrayFile, SweepResult, VerificationProgress
    from daemon.batch.operation import DoctorFinding
    from daemon.batch.paths import Endpoint

_SIGNS: Final = {"ok": ("✓", "green"), "warning": ("!", "yellow"), "problem": ("✗", "bold red")}


class DoctorOutput(Output, schema="doctor"):
    """What is configured, what answers, and what is wrong."""

    state: str
    endpoint: Endpoint
    findings: tuple[DoctorFinding, ...]

    def print(self) -> None:
        """Print a line for each finding, and its remedy below."""
        from rich.text import Text

        for finding in self.findings:
            sign, style = _SIGNS[finding.level]
            line = Text(f"{sign} {finding.level:<8}", style=style)
            line.append(f"{finding.subject:<11} {finding.message}", style="default")
            if finding.remedy:
                line.append(f"\n            {finding.remedy}", style="cyan")
            stdout_console().print(line, soft_wrap=True)


def doctor(
    quick: Annotated[
        bool, typer.Option("--quick", help="Verify the newest results only, and no files.")
    ] = False,
    traces: Annotated[
        bool, typer.Option("--traces", help="Read every trace and verify its digest too.")
    ] = False,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Say what is configured, what answers, and what is wrong, each with its remedy.

    Every result is held against its digest. Changes nothing. Leaves with 3 when there is a problem.
    """
    from daemon.batch.operation import FindingLevel, examine, guarded
    from daemon.batch.paths import StatePaths, find_endpoint

    if quick and traces:
        raise typer.BadParameter("cannot be quick: leave one out", param_hint="--traces")
    paths, endpoint = StatePaths.find(state), find_endpoint(connect, state)
    with _verification_progress() as progress:
        found = examine(paths, endpoint, quick=quick, traces=traces, progress=progress)
    # The settings of the dashboard are examined here: the daemon's side knows no dashboard.
    findings = (*found, *guarded("config", lambda: [_check_settings()]))
    DoctorOutput(str(paths.state), endpoint, findings).show(as_json)
    if any(finding.level is FindingLevel.PROBLEM for finding in findings):
        raise typer.Exit(ExitCode.INFRASTRUCTURE)


@contextmanager
def _verification_progress() -> Iterator[VerificationProgress]:
    """Show on a terminal how much has been verified: a large ledger takes a while."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    console = stderr_console()
    columns = (TextColumn("verifying {task.description}"), BarColumn(), MofNCompleteColumn())
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as shown:
        task = shown.add_task("", total=None)
        yield lambda what, done, total: shown.update(
            task, description=what, completed=done, total=total
        )


def _check_settings() -> DoctorFinding:
    """Say which file the dashboard takes its settings from, and whether it can."""
    from daemon.batch.operation import DoctorFinding, FindingLevel
    from grammars.text.diagnostics import InputError
    from grammars.text.words import count_noun
    from scenario_tui.dashboard.config import config_path, read_config

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
    if config.path is None:
        return DoctorFinding(
            FindingLevel.OK, "config", f"{config_path()} is not there: everything as usual", ""
        )
    parts = [count_noun(len(config.keys), "key")] if config.keys else []
    parts += [f"theme {config.theme}"] if config.theme else []
    parts += ["read-only"] if config.read_only else []
    return DoctorFinding(
        FindingLevel.OK, "config", f"{config.path} {', '.join(parts)}".rstrip(), ""
    )


class SweptCampaign(OutputPart):
    """A campaign, and how many traces of it are gone."""

    campaign: str
    finished_at: float | None
    traces: int
    bytes: int


class GcOutput(Output, schema="gc"):
    """Traces that were removed, or would be; ``freed`` and ``kept`` are bytes.

    ``strays`` are files and folders nobody needs, which went, or would go, as well.
    """

    state: str
    dry_run: bool
    freed: int
    kept: int
    campaigns: list[SweptCampaign]
    strays: tuple[StrayFile, ...] = ()

    def print(self) -> None:
        """Print a line for each campaign and one for all."""
        from daemon.batch.amounts import size_text
        from grammars.text.words import count_noun

        console = stdout_console()
        for one in self.campaigns:
            line = f"{one.campaign}  {count_noun(one.traces, 'trace')}  {size_text(one.bytes)}"
            console.print(line, markup=False, soft_wrap=True)
        for stray in self.strays:
            line = f"{stray.what}  {stray.path}  {size_text(stray.bytes)}"
            console.print(line, markup=False, soft_wrap=True)
        verb = "would remove" if self.dry_run else "removed"
        gone = count_noun(sum(one.traces for one in self.campaigns), "trace")
        words = f"{verb} {gone}, {size_text(self.freed)}; {size_text(self.kept)} of traces stay"
        if self.strays:
            taken = size_text(sum(stray.bytes for stray in self.strays))
            words += f"; {count_noun(len(self.strays), 'stray')}, {taken}"
        console.print(words, soft_wrap=True)


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
    """Remove what nobody needs, and traces of finished campaigns, the oldest first.

    Results stay, and say that the trace is gone; a daemon may be running. A trace goes when any
    of the options says so; without one no trace goes, only strays: temporary files, uploads
    given up, scenes and files of no campaign, spools of workers long dead.
    """
    import time

    from daemon.batch.ledger import RetentionPolicy, find_strays, remove_strays, sweep_traces
    from daemon.batch.paths import StatePaths

    keeping = RetentionPolicy(
        keep,
        read_age(older_than) if older_than else None,
        read_size(max_size) if max_size else None,
    )
    paths = StatePaths.find(state)
    swept = sweep_traces(paths, keeping, time.time(), dry=dry_run)
    strays = (find_strays if dry_run else remove_strays)(paths, time.time())
    GcOutput(str(paths.state), dry_run, swept.freed, swept.kept, _by_campaign(swept), strays).show(
        as_json
    )


def _by_campaign(swept: SweepResult) -> list[SweptCampaign]:
    found: dict[str, SweptCampaign] = {}
    for trace in swept.gone:
        one = found.get(trace.campaign) or SweptCampaign(trace.campaign, trace.finished_at, 0, 0)
        found[one.campaign] = replace(one, traces=one.traces + 1, bytes=one.bytes + trace.size)
    return list(found.values())
