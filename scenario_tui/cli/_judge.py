"""The command that judges recorded runs again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final

import typer

from scenario_tui.cli import _completion
from scenario_tui.cli._exits import exit_code
from scenario_tui.cli._files import oracle_files
from scenario_tui.cli._options import AsJson, State

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from rich.table import Table
    from rich.text import Text

    from daemon.rejudge import Change, Rejudged
    from daemon.verdict import Outcome, Verdict

LISTED: Final = 20


def judge(
    traces: Annotated[
        list[str],
        typer.Argument(
            metavar="TRACES...",
            help="Traces (.mcap), folders of them, or ids of campaigns or runs.",
            autocompletion=_completion.recorded,
        ),
    ],
    oracles: Annotated[
        Path | None,
        typer.Option(
            "--oracles",
            "-o",
            metavar="FILE",
            help="Oracle layer to judge by, such as navigation.oracles.yaml. "
            "Default: the oracles inside of each trace.",
            autocompletion=_completion.files(oracle_files),
        ),
    ] = None,
    processes: Annotated[
        int | None,
        typer.Option("--processes", "-j", min=1, max=1024, help="Default: one per core."),
    ] = None,
    state: State = None,
    as_json: AsJson = False,
) -> None:
    """Judge recorded runs again and say which verdicts differ; traces stay as they are."""
    from daemon.places import Places
    from daemon.rejudge import find_traces, rejudge
    from daemon.spec import OracleText
    from grammars.oracle import load_oracles
    from scenario_tui.cli._output import emit, watched

    written = None
    if oracles is not None:
        written = tuple(OracleText(o.name, o.text) for o in load_oracles(oracles).values())
    places = Places.find(state)
    try:
        paths = find_traces(traces, places)
    except ValueError as error:
        raise typer.BadParameter(str(error), param_hint="TRACES") from error
    judged = rejudge(paths, written, places=places, processes=processes)
    found = tuple(watched(judged, len(paths), "judging"))
    if as_json:
        emit("judge", oracles=str(oracles or ""), traces=[_plain(one) for one in found])
    else:
        _print(found)
    raise typer.Exit(exit_code(str(one.outcome) for one in found))


def _plain(one: Rejudged) -> dict[str, Any]:
    from grammars.codec import to_plain

    changes = [
        {
            "oracle": change.oracle,
            "change": change.kind,
            "before": None if change.before is None else change.before.outcome,
            "now": None if change.now is None else change.now.outcome,
            "margin_before": None if change.before is None else change.before.margin,
            "margin_now": None if change.now is None else change.now.margin,
        }
        for change in one.changes
    ]
    plain: dict[str, Any] = to_plain(one)
    return plain | {"changes": changes}


def _print(found: Sequence[Rejudged]) -> None:
    from scenario_tui.cli._output import out, say

    judged = [one for one in found if not one.problem]
    if judged:
        out().print(_table(judged))
        _print_changes(judged)
    for one in found:
        if one.problem:
            say(f"{one.trace}: error: {one.problem}")
    out().print(_closing(judged, len(found) - len(judged)), soft_wrap=True)


def _closing(judged: Sequence[Rejudged], unreadable: int) -> str:
    from scenario_tui.wording import counted

    same = sum(one.outcome is one.outcome_before for one in judged)
    known = sum(one.origin == "ledger" for one in judged)
    words = [f"{counted(len(judged), 'trace')} judged, {same} with the verdict they had"]
    if known:
        words.append(f"{known} compared with the ledger")
    if known < len(judged):
        words.append(f"{len(judged) - known} with what the oracles inside of the trace say")
    if unreadable:
        words.append(f"{unreadable} not readable")
    return ", ".join(words)


def _table(judged: Sequence[Rejudged]) -> Table:
    """One row per oracle: how it judges, by how much, and how it judged before."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for title in ("oracle", "before", "now", "worst margin", "in run"):
        table.add_column(title, overflow="fold")
    labels = _labels(judged)
    names = dict.fromkeys(v.oracle for one in judged for v in (*one.verdicts, *one.before))
    for name in names:
        now = [(labels[one.trace], v) for one in judged for v in one.verdicts if v.oracle == name]
        before = [v.outcome for one in judged for v in one.before if v.oracle == name]
        table.add_row(name, _counts(before), _counts(v.outcome for _, v in now), *_worst(now))
    whole = [one.outcome_before for one in judged if one.outcome_before is not None]
    table.add_section()
    table.add_row("the run", _counts(whole), _counts(one.outcome for one in judged), "", "")
    return table


def _labels(judged: Sequence[Rejudged]) -> dict[str, str]:
    """Name each trace by its run, or by its file where runs of one name are judged together."""
    from collections import Counter

    runs = Counter(one.run for one in judged)
    return {one.trace: one.run if runs[one.run] == 1 else one.trace for one in judged}


def _counts(outcomes: Iterable[Outcome]) -> Text:
    from collections import Counter

    from rich.text import Text

    from scenario_tui.wording import GLYPHS, NOTHING, SEVERITY, STYLES

    counts = Counter(map(str, outcomes))
    text = Text()
    for word in (w for w in SEVERITY if counts[w]):
        text.append("  " if text else "")
        text.append(f"{GLYPHS[word]} {counts[word]} {word}", style=STYLES[word])
    return text if counts else Text(NOTHING, style="dim")


def _worst(verdicts: Sequence[tuple[str, Verdict]]) -> tuple[str, str]:
    """Return the smallest margin that decided something, and the run and moment it is from.

    For a measure, the range of its values.
    """
    from daemon.verdict import Outcome
    from scenario_tui.wording import NOTHING, margin, moment, quantity

    measured = [v.evidence.value for _, v in verdicts if v.outcome is Outcome.MEASURE]
    values = [value for value in measured if value is not None]
    if values:
        unit = verdicts[0][1].unit
        return f"{quantity(min(values), unit)} to {quantity(max(values), unit)}", ""
    decided = [(label, v) for label, v in verdicts if v.outcome in (Outcome.PASS, Outcome.FAIL)]
    known = [(v.margin, label, v) for label, v in decided if v.margin is not None]
    if not known:
        return NOTHING, ""
    least, label, verdict = min(known, key=lambda entry: entry[0])
    at = verdict.evidence.time
    return margin(least, verdict.unit), label + ("" if at is None else f" at {moment(at)}")


def _print_changes(judged: Sequence[Rejudged]) -> None:
    """List verdicts that are not what they were."""
    from scenario_tui.cli._output import out

    labels = _labels(judged)
    lines = [
        _line(labels[one.trace], change)
        for one in judged
        for change in one.changes
        if change.kind == "verdict"
    ]
    console = out()
    console.print()
    for line in lines[:LISTED]:
        console.print(line, soft_wrap=True)
    if len(lines) > LISTED:
        console.print(f"and {len(lines) - LISTED} more verdicts that changed (--json lists all)")
    if lines:
        console.print()


def _line(label: str, change: Change) -> Text:
    from rich.text import Text

    from scenario_tui.cli._summary import verdict_line
    from scenario_tui.wording import STYLES, glyph_word

    if change.before is None or change.now is None:
        raise ValueError("only a verdict that was and is can have changed")
    then, now = str(change.before.outcome), str(change.now.outcome)
    return Text.assemble(
        (glyph_word(then), STYLES[then]),
        " → ",
        (glyph_word(now), STYLES[now]),
        "  ",
        (label, "bold"),
        f"  {verdict_line(change.now)}",
    )
