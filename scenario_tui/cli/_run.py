"""Commands about one run: show, logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

import typer

from scenario_tui.cli import _completion
from scenario_tui.cli._options import AsJson, Connect, RunOrTrace, State

if TYPE_CHECKING:
    from collections.abc import Iterable

    from rich.text import Text

    from daemon.history import Said, Step
    from daemon.protocol import RunDetail, RunRow
    from scenario_tui.cli._session import Target

Run: TypeAlias = Annotated[
    str,
    typer.Argument(
        metavar="RUN",
        help="Id of a run, or a campaign's name, a dot and the run's number.",
        autocompletion=_completion.runs,
    ),
]


def show(run: Run, connect: Connect = "", state: State = None, as_json: AsJson = False) -> None:
    """Show one run: what each oracle says and why, what it was, where its trace lies."""
    from scenario_tui.cli._output import emit, out
    from scenario_tui.cli._session import Target, find_run
    from scenario_tui.cli._summary import print_commands
    from scenario_tui.widgets.run_text import run_text

    with Target(connect, state).open() as daemon:
        detail = find_run(daemon, run)
    if as_json:
        emit("run", run=detail)
        return
    out().print(_coloured(run_text(detail, None)), soft_wrap=True)
    print_commands(*_next(detail))


def _coloured(text: Text) -> Text:
    """Return a text of the dashboard in the colours of this terminal."""
    from rich.text import Span

    from scenario_tui import palette
    from scenario_tui.wording import STYLES

    ours = {style: STYLES[word] for word, style in palette.WORDS.items()}
    ours |= {palette.QUIET: "dim", palette.UNSURE: "yellow"}
    text.spans = [
        Span(span.start, span.end, ours.get(str(span.style), span.style)) for span in text.spans
    ]
    return text


def _next(detail: RunDetail) -> Iterable[tuple[str, str]]:
    row = detail.row
    if row.trace:
        begin = f" --from {row.oracle}" if row.outcome == "fail" else ""
        yield f"scenario replay {row.id}{begin}", "watch it"
    yield f"scenario logs {row.id}", "what happened, in order"
    if row.outcome == "fail":
        yield f"scenario blame {row.id}", "what makes it fail"


def logs(
    run: RunOrTrace,
    connect: Connect = "",
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Tell what happened in a run: its attempts, its mission, contacts, what the SUT said.

    Read from the state directory of this machine; no daemon is needed unless one is named.
    """
    from daemon.history import recorded
    from scenario_tui.cli._output import emit
    from scenario_tui.cli._session import Target

    if run.endswith(".mcap"):
        said = recorded(Path(run))
        if as_json:
            emit("logs", run="", attempts=0, reason="", steps=[], output=[], recorded=list(said))
        else:
            _print_recorded(said)
        return
    row, happened, printed, said = _logged(run, Target(connect, state))
    if as_json:
        emit("logs", run=row.id, attempts=row.attempt, reason=row.reason, steps=list(happened),
             output=list(printed), recorded=list(said))  # fmt: skip
        return
    _print_steps(happened, row.attempt)
    known = any(step.note.strip() == row.reason.strip() for step in happened)
    _print_texts((*printed, "" if known else row.reason))
    if said:
        _print_recorded(said)


def _logged(
    run: str, target: Target
) -> tuple[RunRow, tuple[Step, ...], tuple[str, ...], tuple[Said, ...]]:
    """Return a run, its attempts, what they print, what its trace recorded.

    A daemon elsewhere does not tell of attempts.
    """
    from daemon.history import outputs, recorded, steps
    from daemon.report import open_ledger
    from scenario_tui.cli._chosen import one_trace
    from scenario_tui.cli._session import find_run

    happened: tuple[Step, ...] = ()
    printed: tuple[str, ...] = ()
    if target.named:
        with target.open() as daemon:
            row = find_run(daemon, run).row
    else:
        with open_ledger(target.places) as ledger:
            row = find_run(ledger, run).row
        happened, printed = steps(target.places, row.id), outputs(target.places, row.id)
    said = recorded(one_trace(row.id, target, "RUN")) if row.trace else ()
    return row, happened, printed, said


def _print_steps(happened: tuple[Step, ...], attempts: int) -> None:
    from datetime import datetime

    from scenario_tui.cli._output import out
    from scenario_tui.wording import counted

    console = out()
    for step in happened:
        when = datetime.fromtimestamp(step.at).astimezone().strftime("%Y-%m-%d %H:%M:%S")
        note = f"  {step.note.strip()}" if step.note else ""
        console.print(f"{when}  {step.state}{note}", markup=False, soft_wrap=True)
    if not happened:
        console.print(f"{counted(attempts, 'attempt')}; when is not remembered any more")


def _print_texts(texts: tuple[str, ...]) -> None:
    from scenario_tui.cli._output import out

    for text in filter(None, texts):
        out().print(f"\n{text.strip()}", markup=False, soft_wrap=True)


def _print_recorded(said: tuple[Said, ...]) -> None:
    from rich.text import Text

    from scenario_tui.cli._output import out

    console = out()
    console.print("\nin simulated time", style="dim")
    styles = {"warn": "yellow", "error": "bold red", "fatal": "bold red"}
    width = max(len(line.source) for line in said)
    for line in said:
        text = Text(f"{line.time:8.1f} s  {line.source:<{width}}  ")
        console.print(text.append(line.text, style=styles.get(line.level, "")), soft_wrap=True)
