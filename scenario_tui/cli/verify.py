"""The command that runs specifications again and compares the recordings."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from grammars.text.words import format_quantity
from scenario_tui.cli import completion
from scenario_tui.cli.answer import Answer, ExitCode
from scenario_tui.cli.options import Wall, refuse_missing_file
from scenario_tui.cli.output import (
    open_progress,
    plain_table,
    print_line,
    report_findings,
    stdout_console,
)
from scenario_tui.source import DaemonTarget, all_traces

if TYPE_CHECKING:
    from daemon.analysis.verification import Verification, Verifications
    from daemon.model.spec import RunSpec
    from grammars.model.scene import Scene

_REPEATABLE: Final = 2
_EXTERNAL: Final = 5
_REMEDY: Final = (
    "random numbers of a system under test must come from briefing.seed, as in "
    "numpy.random.default_rng(briefing.seed); nothing may depend on the clock, on threads, or on "
    "the order of a set"
)
_OTHER_CODE: Final = (
    "the executions agree with each other: the recording comes from other code, other packages or "
    "another machine"
)


def verify(
    named: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN|CAMPAIGN...",
            help="Runs, traces (.mcap), folders of traces, campaigns, or campaign files, which "
            "need no earlier run.",
            autocompletion=completion.offers(
                completion.campaigns,
                completion.runs,
                completion.files(".mcap"),
                completion.campaign_files,
            ),
        ),
    ],
    repeats: Annotated[
        int | None,
        typer.Option(
            "-n",
            min=1,
            max=1000,
            help=f"Executions. Default: {_REPEATABLE}, or {_EXTERNAL} for a system that is not "
            "repeatable. For a campaign file the first one serves as the recording.",
        ),
    ] = None,
    every: Annotated[
        bool, "--all", "Every run of a campaign, not only one per scenario and system."
    ] = False,
    wall: Wall = None,
    *,
    target: DaemonTarget,
) -> Answer[Verifications]:
    """Run specifications twice and compare the traces byte by byte.

    Recorded runs are compared with their recording. For an external stack, which is not
    repeatable, it prints the spread of outcomes, margins, path and duration. Results in the ledger
    do not change.
    """
    from daemon.analysis.verification import Verifications, verify, verify_spec

    for name in named:
        refuse_missing_file(name)
    runs = [one for name in named for one in _runs(name, target, every)]
    counts = [repeats or (_REPEATABLE if s.sut.repeatable else _EXTERNAL) for s, _ in runs]
    checks: list[Verification] = []
    # Processes are forked meanwhile; threads do not survive a fork.
    with open_progress(threads=False) as progress:
        task = progress.add_task("running again", total=sum(counts))
        advance = partial(progress.advance, task)
        for (spec, recording), count in zip(runs, counts, strict=True):
            if isinstance(recording, Path):
                execute = partial(verify, recording)
            else:
                execute = partial(verify_spec, spec, recording)
            checks.append(execute(count, places=target.paths, wall=wall or 0.0, advance=advance))
    value = Verifications(tuple(checks))
    return Answer("verify", value, partial(_print, value.runs), _code(value.runs))


def _runs(name: str, target: DaemonTarget, every: bool) -> list[tuple[RunSpec, Scene | Path]]:
    """Return the specifications of a name, each with its scene or its trace.

    Only the first of each scenario and system counts, unless ``every`` is set.
    """
    from daemon.trace import read_spec
    from scenario_tui.library.campaign import load

    runs: list[tuple[RunSpec, Scene | Path]]
    if Path(name).suffix in (".yaml", ".yml") and Path(name).is_file():
        campaign = load(name)
        submission = campaign.submission()
        report_findings(campaign.findings)
        scenes = {scene.digest: scene for scene in submission.scenes}
        runs = [(spec, scenes[spec.scene]) for spec in submission.specs]
    else:
        traces = all_traces([name], target, one_of_cell=not every)
        runs = [(read_spec(path), path) for path in traces]
    if every:
        return runs
    cells: dict[tuple[str, str], tuple[RunSpec, Scene | Path]] = {}
    for run in runs:
        cells.setdefault((run[0].scenario, run[0].sut.name), run)
    return list(cells.values())


def _code(checks: tuple[Verification, ...]) -> ExitCode:
    # An external system has no right answer to compare with.
    differing = any(
        check.repeatable and any(one.difference is not None for one in check.executions)
        for check in checks
    )
    # A difference counts even if other runs could not be executed.
    if differing:
        return ExitCode.UNEXPECTED
    if not all(check.all_executed for check in checks):
        return ExitCode.INFRASTRUCTURE
    if not all(check.executions for check in checks):
        return ExitCode.INCONCLUSIVE
    return ExitCode.EXPECTED


def _print(checks: tuple[Verification, ...]) -> None:
    """Print every run; a single one with the spread of its values."""
    for check in checks:
        _print_check(check)
    if len(checks) == 1:
        _print_details(checks[0])
    if any(check.nondeterministic for check in checks):
        stdout_console().print(_REMEDY)


def _print_check(check: Verification) -> None:
    count = len(check.executions)
    print_line(_headline(check, count))
    problems = [] if check.trace else [("the first execution", check.recorded.problem)]
    for number, execution in enumerate(check.executions, 1):
        problems.append((f"execution {number}", execution.problem))
    for which, problem in problems:
        if problem:
            print_line(f"{which}: {problem}", style="yellow")
    agreeing = check.all_executed and not check.nondeterministic and not check.same_bytes
    if check.repeatable and check.trace and count > 1 and agreeing:
        stdout_console().print(_OTHER_CODE)


def _print_details(check: Verification) -> None:
    done = any(not execution.problem for execution in check.executions)
    if not done or (check.repeatable and check.same_bytes == len(check.executions)):
        return
    outcomes = ", ".join(f"{number} {word}" for word, number in check.outcomes.items())
    print_line(f"including the recording: {outcomes}")
    table = plain_table("", "recorded", "least", "most", "of", figures=True)
    for spread in check.spreads:
        recorded = check.recorded.values.get(spread.name)
        table.add_row(
            spread.name,
            "" if recorded is None else format_quantity(recorded, spread.unit),
            format_quantity(spread.least, spread.unit),
            format_quantity(spread.most, spread.unit),
            str(spread.count),
        )
    stdout_console().print(table)
    if check.repeatable and check.versions:
        listed = ", ".join(f"{n} {then} ({now} here)" for n, (then, now) in check.versions.items())
        print_line(f"recorded with {listed}")


def _headline(check: Verification, count: int) -> str:
    executed = count + (0 if check.trace else 1)
    if check.recorded.problem or (count and all(one.problem for one in check.executions)):
        return f"{check.run}: could not be executed"
    if not count:
        return f"{check.run}: executed once, so nothing to compare; use --repeats 2 or more"
    if not check.repeatable:
        return (
            f"{check.run}: {check.sut} is not repeatable; {count} more executions, "
            f"{check.same_bytes} of them with the same bytes"
        )
    where = check.first_difference
    if where is None and check.same_bytes == count:
        same = count if check.trace else executed
        return f"{check.run}: {same} of {same} executions have the same bytes"
    if where is None:
        return f"{check.run}: {check.same_bytes} of {count} executions have the same bytes"
    if check.nondeterministic:
        return f"{check.run}: {check.sut} is not deterministic, executions differ {where}"
    result = f"{check.same_bytes} of {count} executions have the same bytes"
    return f"{check.run}: {result}; they differ {where}"
