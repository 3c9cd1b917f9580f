"""The command that runs a recorded specification again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated, Final

import typer

from scenario_tui.cli.exit_codes import ExitCode
from scenario_tui.cli.options import AsJson, Connect, RunOrTrace, State
from scenario_tui.cli.output import Output, plain_table, stdout_console, track_progress

if TYPE_CHECKING:
    from daemon.analysis.verification import ExecutedRun, Spread, Verification

_REPEATABLE: Final = 1
_EXTERNAL: Final = 5


class VerifyOutput(Output, schema="verify"):
    """A recorded run and executions of its specification.

    ``same_bytes`` of the ``executions`` left the bytes of the recording; ``outcomes`` and
    ``spreads`` count the recording too. ``versions`` of packages are those that differ: then, now.
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
    versions: dict[str, tuple[str, str]]

    @classmethod
    def of(cls, found: Verification) -> VerifyOutput:
        """Return what was found."""
        return cls(
            found.trace,
            found.run,
            found.sut,
            found.digest,
            found.repeatable,
            found.same_bytes,
            found.recorded,
            found.executions,
            found.outcomes,
            found.spreads,
            dict(found.versions),
        )


def verify(
    run: RunOrTrace,
    repeats: Annotated[
        int | None,
        typer.Option(
            "--repeats",
            "-n",
            min=1,
            max=1000,
            help=f"Executions. Default: {_REPEATABLE}, and {_EXTERNAL} of a system that is not "
            "repeatable.",
        ),
    ] = None,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Run a recorded specification again and say whether the bytes are the same.

    Of a system under test that is not repeatable, an external stack, it says how far outcomes,
    margins, path and duration spread. Results of the ledger stay as they are.
    """
    from daemon.analysis.verification import verify as execute_again
    from daemon.trace import read_spec
    from scenario_tui.cli.target import DaemonTarget, one_trace

    target = DaemonTarget(connect, state)
    path = one_trace(run, target, "RUN")
    count = repeats or (_REPEATABLE if read_spec(path).sut.repeatable else _EXTERNAL)
    found = execute_again(path, count, places=target.paths, watch=_watch)
    if as_json:
        VerifyOutput.of(found).emit()
    else:
        _print(found)
    raise typer.Exit(_code(found))


def _watch(executions: Iterator[ExecutedRun], count: int) -> Sequence[ExecutedRun]:
    return tuple(track_progress(executions, count, "running again"))


def _code(found: Verification) -> ExitCode:
    if not found.all_executed:
        return ExitCode.INFRASTRUCTURE
    # Nobody can say what an external system should have given.
    same = not found.repeatable or found.same_bytes == len(found.executions)
    return ExitCode.EXPECTED if same else ExitCode.UNEXPECTED


def _print(found: Verification) -> None:
    console = stdout_console()
    count = len(found.executions)
    console.print(_headline(found, count), markup=False, soft_wrap=True)
    for number, execution in enumerate(found.executions, 1):
        if execution.problem:
            console.print(f"execution {number}: {execution.problem}", markup=False, style="yellow")
    if found.repeatable and found.same_bytes == count:
        return
    outcomes = ", ".join(f"{number} {word}" for word, number in found.outcomes.items())
    console.print(f"with the recorded one: {outcomes}", markup=False)
    table = plain_table("", "recorded", "least", "most", "of", figures=True)
    for spread in found.spreads:
        recorded = found.recorded.values.get(spread.name)
        table.add_row(
            spread.name,
            "" if recorded is None else _text(recorded, spread.unit),
            _text(spread.least, spread.unit),
            _text(spread.most, spread.unit),
            str(spread.count),
        )
    console.print(table)
    if found.repeatable and found.versions:
        listed = ", ".join(f"{n} {then} ({now} here)" for n, (then, now) in found.versions.items())
        console.print(f"recorded with {listed}", markup=False, soft_wrap=True)


def _headline(found: Verification, count: int) -> str:
    if not found.repeatable:
        return (
            f"{found.run}: {found.sut} is not repeatable; {count} more executions, "
            f"{found.same_bytes} of them with the same bytes"
        )
    if found.same_bytes == count:
        return f"{found.run}: {count} of {count} executions left the same bytes"
    return f"{found.run}: not the same bytes, {found.same_bytes} of {count} executions left them"


def _text(value: float, unit: str) -> str:
    from scenario_tui.text.formatting import quantity

    return quantity(value, unit)
