"""The command that runs specifications again and holds the recordings against each other."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from scenario_tui.cli import completion
from scenario_tui.cli.exit_codes import ExitCode
from scenario_tui.cli.options import AsJson, Connect, State, Wall, read_wall
from scenario_tui.cli.output import (
    Output,
    OutputPart,
    plain_table,
    report_findings,
    stdout_console,
    track_progress,
)

if TYPE_CHECKING:
    from daemon.analysis.verification import ExecutedRun, Spread, Verification
    from daemon.model.spec import RunSpec
    from daemon.trace import TraceDifference
    from scenario_tui.cli.target import DaemonTarget

_REPEATABLE: Final = 2
_EXTERNAL: Final = 5
_REMEDY: Final = (
    "what is random in a system under test has to come from briefing.seed, as in "
    "numpy.random.default_rng(briefing.seed); nothing from the clock, from threads, or from the "
    "order of a set"
)

_OTHER_CODE: Final = (
    "executions agree with each other: the recording is of other code, packages or another machine"
)


class VerifiedRun(OutputPart):
    """A recorded run and executions of its specification.

    ``same_bytes`` of the ``executions`` left the bytes of the recording; ``outcomes`` and
    ``spreads`` count the recording too. ``versions`` of packages are those that differ: then, now.
    ``nondeterministic`` is a system whose executions here differ; the traces first part at
    ``first_difference``. Without a ``trace`` the recording is the first execution.
    """

    trace: str
    run: str
    sut: str
    digest: str
    repeatable: bool
    same_bytes: int
    recorded: ExecutedRun
    executions: tuple[ExecutedRun, ...]
    outcomes: dict[str, int]
    spreads: tuple[Spread, ...]
    versions: Mapping[str, tuple[str, str]]
    nondeterministic: bool
    first_difference: TraceDifference | None


class VerifyOutput(VerifiedRun, Output, schema="verify"):
    """Executions of one specification."""


class VerificationsOutput(Output, schema="verifications"):
    """Several runs and executions of their specifications; ``runs`` as of one run."""

    runs: tuple[VerifiedRun, ...]


def _values(verification: Verification) -> dict[str, Any]:
    """Return the values of a :class:`VerifiedRun` by name."""
    return {field.name: getattr(verification, field.name) for field in fields(VerifiedRun)}


def verify(
    named: Annotated[
        list[str],
        typer.Argument(
            metavar="RUN|CAMPAIGN...",
            help="Runs, traces (.mcap), folders of traces, campaigns, or campaign files, whose "
            "specifications nobody has to have run before.",
            autocompletion=completion.campaign_files_or_recorded,
        ),
    ],
    repeats: Annotated[
        int | None,
        typer.Option(
            "--repeats",
            "-n",
            min=1,
            max=1000,
            help=f"Executions. Default: {_REPEATABLE}, and {_EXTERNAL} of a system that is not "
            "repeatable. Of a campaign file the first takes the place of the recording.",
        ),
    ] = None,
    every: Annotated[
        bool,
        typer.Option(
            "--all", help="Every run of a campaign, not only one of each scenario and system."
        ),
    ] = False,
    wall: Wall = "",
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Run specifications twice and say whether the bytes are the same, or where they part.

    Recorded runs are held against their recording. Of a system under test that is not repeatable,
    an external stack, it says how far outcomes, margins, path and duration spread. Results of the
    ledger stay as they are.
    """
    from scenario_tui.cli.suggestions import refuse_missing_file
    from scenario_tui.cli.target import DaemonTarget

    for name in named:
        refuse_missing_file(name)
    target = DaemonTarget(connect, state)
    jobs = _jobs(named, target, repeats, read_wall(wall), every)
    if len(jobs) == 1:
        check = jobs[0](watch=_watch)
        if as_json:
            VerifyOutput(**_values(check)).emit()
        else:
            _print(check)
        raise typer.Exit(_code([check]))
    several = []
    for job in track_progress(jobs, len(jobs), "running again"):
        check = job()
        several.append(check)
        if not as_json:
            _print(check, details=False)
    if as_json:
        VerificationsOutput(tuple(VerifiedRun(**_values(one)) for one in several)).emit()
    else:
        _print_remedy(several)
    raise typer.Exit(_code(several))


def _jobs(
    named: Sequence[str], target: DaemonTarget, repeats: int | None, wall: float, every: bool
) -> list[Callable[..., Verification]]:
    """Return the verifications that are meant: one of each cell, or of ``every`` run."""
    from daemon.analysis import verification
    from daemon.trace import read_spec
    from scenario_tui.cli.named_traces import all_traces
    from scenario_tui.library.submission import prepare_submission

    jobs: list[Callable[..., Verification]] = []
    for name in named:
        runs: list[tuple[RunSpec, Callable[..., Verification]]]
        if Path(name).suffix in (".yaml", ".yml") and Path(name).is_file():
            prepared = prepare_submission(Path(name))
            report_findings(prepared.warnings)
            scenes = {scene.digest: scene for scene in prepared.submission.scenes}
            verify_spec = verification.verify_spec
            specs = prepared.submission.specs
            runs = [(spec, partial(verify_spec, spec, scenes[spec.scene])) for spec in specs]
        else:
            traces = all_traces([name], target, "RUN|CAMPAIGN", one_of_cell=not every)
            runs = [(read_spec(path), partial(verification.verify, path)) for path in traces]
        cells = set[tuple[str, str]]()
        for spec, job in runs:
            cell = (spec.scenario, spec.sut.name)
            if every or cell not in cells:
                count = repeats or (_REPEATABLE if spec.sut.repeatable else _EXTERNAL)
                jobs.append(partial(job, count, places=target.paths, wall=wall))
            cells.add(cell)
    return jobs


def _watch(executions: Iterator[ExecutedRun], count: int) -> Sequence[ExecutedRun]:
    return tuple(track_progress(executions, count, "running again"))


def _code(verified: Sequence[Verification]) -> ExitCode:
    # Nobody can say what an external system should have given.
    differing = any(
        check.repeatable and any(one.difference is not None for one in check.executions)
        for check in verified
    )
    # A finding stays one when other runs could not be executed.
    if differing:
        return ExitCode.UNEXPECTED
    if not all(check.all_executed for check in verified):
        return ExitCode.INFRASTRUCTURE
    if not all(check.executions for check in verified):
        return ExitCode.INCONCLUSIVE
    return ExitCode.EXPECTED


def _print(check: Verification, *, details: bool = True) -> None:
    console = stdout_console()
    count = len(check.executions)
    console.print(_headline(check, count), markup=False, soft_wrap=True)
    problems = [("the first execution", check.recorded.problem)] if not check.trace else []
    problems += [
        (f"execution {number}", execution.problem)
        for number, execution in enumerate(check.executions, 1)
    ]
    for which, problem in problems:
        if problem:
            console.print(f"{which}: {problem}", markup=False, style="yellow", soft_wrap=True)
    agreeing = check.all_executed and not check.nondeterministic and not check.same_bytes
    if check.repeatable and check.trace and count > 1 and agreeing:
        console.print(_OTHER_CODE, markup=False)
    done = any(not execution.problem for execution in check.executions)
    if not details or (check.repeatable and check.same_bytes == count) or not done:
        return
    _print_spreads(check)
    if check.repeatable and check.versions:
        listed = ", ".join(f"{n} {then} ({now} here)" for n, (then, now) in check.versions.items())
        console.print(f"recorded with {listed}", markup=False, soft_wrap=True)
    _print_remedy([check])


def _print_spreads(check: Verification) -> None:
    console = stdout_console()
    outcomes = ", ".join(f"{number} {word}" for word, number in check.outcomes.items())
    console.print(f"with the recorded one: {outcomes}", markup=False)
    table = plain_table("", "recorded", "least", "most", "of", figures=True)
    for spread in check.spreads:
        recorded = check.recorded.values.get(spread.name)
        table.add_row(
            spread.name,
            "" if recorded is None else _text(recorded, spread.unit),
            _text(spread.least, spread.unit),
            _text(spread.most, spread.unit),
            str(spread.count),
        )
    console.print(table)


def _print_remedy(verified: Sequence[Verification]) -> None:
    """Say what to do about executions that differ from one another."""
    if any(check.nondeterministic for check in verified):
        stdout_console().print(_REMEDY, markup=False)


def _headline(check: Verification, count: int) -> str:
    executed = count + (0 if check.trace else 1)
    if check.recorded.problem or (count and all(one.problem for one in check.executions)):
        return f"{check.run}: could not be executed"
    if not count:
        return f"{check.run}: executed once, which compares nothing; say --repeats 2 or more"
    if not check.repeatable:
        return (
            f"{check.run}: {check.sut} is not repeatable; {count} more executions, "
            f"{check.same_bytes} of them with the same bytes"
        )
    where = check.first_difference
    if where is None and check.same_bytes == count:
        same = count if check.trace else executed
        return f"{check.run}: {same} of {same} executions left the same bytes"
    if where is None:
        return f"{check.run}: {check.same_bytes} of {count} executions left the same bytes"
    if check.nondeterministic:
        return f"{check.run}: {check.sut} is not deterministic, executions part {where}"
    result = f"not the same bytes, {check.same_bytes} of {count} executions left them"
    return f"{check.run}: {result}; they part {where}"


def _text(value: float, unit: str) -> str:
    from grammars.text.words import format_quantity

    return format_quantity(value, unit)
