"""Runs judged again, in words: what every oracle says now and said before, what is different.

``styles`` are those of the terminal or those of the dashboard.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from daemon.analysis.rejudge import OracleChange, RejudgedTrace
from daemon.model.verdicts import Outcome, Verdict
from grammars.text import codec
from scenario_tui.text.formatting import (
    DASHBOARD_STYLES,
    GLYPHS,
    NOTHING,
    SEVERITY,
    Styles,
    glyph_word,
    margin,
    moment_text,
    pluralise,
    quantity,
    verdict_line,
)

LISTED: Final = 20
"""Verdicts that changed, as many as are listed."""


def parse_judge_answer(answer: Mapping[str, Any]) -> tuple[RejudgedTrace, ...]:
    """Read what ``scenario judge --json`` wrote."""
    plain = ({k: v for k, v in one.items() if k != "changes"} for one in answer["traces"])
    return tuple(codec.from_plain(RejudgedTrace, one) for one in plain)


def rejudge_report(found: Sequence[RejudgedTrace]) -> RenderableType:
    """Return everything about runs judged again, for a dialog."""
    judged = [one for one in found if not one.problem]
    lines = change_lines(judged, DASHBOARD_STYLES)
    parts: list[RenderableType] = [Text(rejudge_summary(judged, len(found) - len(judged)) + "\n")]
    if judged:
        said = f"{pluralise(len(lines), 'verdict')} changed" if lines else "no verdict changed"
        parts.append(Text(said, "bold"))
    parts += lines[:LISTED]
    if len(lines) > LISTED:
        parts.append(Text(f"and {len(lines) - LISTED} more"))
    if judged:
        parts += [Text(""), rejudge_table(judged, DASHBOARD_STYLES)]
    parts += [Text(f"{one.trace}: {one.problem}") for one in found if one.problem][:LISTED]
    return Group(*parts)


def change_lines(judged: Sequence[RejudgedTrace], styles: Styles) -> list[Text]:
    """Return a line for each verdict that is not what it was."""
    labels = _labels(judged)
    return [
        _line(labels[one.trace], change, styles)
        for one in judged
        for change in one.changes
        if change.kind == "verdict"
    ]


def rejudge_summary(judged: Sequence[RejudgedTrace], unreadable: int) -> str:
    """Return how many runs were judged, and with what they were compared."""
    same = sum(one.outcome is one.outcome_before for one in judged)
    known = sum(one.origin == "ledger" for one in judged)
    words = [f"{pluralise(len(judged), 'trace')} judged, {same} with the verdict they had"]
    if known:
        words.append(f"{known} compared with the ledger")
    if known < len(judged):
        words.append(f"{len(judged) - known} with what the oracles inside of the trace say")
    if unreadable:
        words.append(f"{unreadable} not readable")
    return ", ".join(words)


def rejudge_table(judged: Sequence[RejudgedTrace], styles: Styles) -> Table:
    """Return a row per oracle: how it judges, by how much, and how it judged before."""
    rows = Table(box=box.SIMPLE_HEAD, pad_edge=False, show_edge=False)
    for title in ("oracle", "before", "now", "worst margin", "in run"):
        rows.add_column(title, overflow="fold")
    labels = _labels(judged)
    names = dict.fromkeys(v.oracle for one in judged for v in (*one.verdicts, *one.before))
    for name in names:
        now = [(labels[one.trace], v) for one in judged for v in one.verdicts if v.oracle == name]
        before = [v.outcome for one in judged for v in one.before if v.oracle == name]
        rows.add_row(
            name,
            _counts(before, styles),
            _counts((v.outcome for _, v in now), styles),
            *_worst(now),
        )
    whole = [one.outcome_before for one in judged if one.outcome_before is not None]
    rows.add_section()
    rows.add_row(
        "the run", _counts(whole, styles), _counts((one.outcome for one in judged), styles), "", ""
    )
    return rows


def _labels(judged: Sequence[RejudgedTrace]) -> dict[str, str]:
    """Name each trace by its run, or by its file where runs of one name are judged together."""
    # Copies of a campaign, or traces of other state directories, have runs of the same names.
    runs = Counter(one.run for one in judged)
    return {one.trace: one.run if runs[one.run] == 1 else one.trace for one in judged}


def _counts(outcomes: Iterable[Outcome], styles: Styles) -> Text:
    counts = Counter(map(str, outcomes))
    text = Text()
    for word in (w for w in SEVERITY if counts[w]):
        text.append("  " if text else "")
        text.append(f"{GLYPHS[word]} {counts[word]} {word}", style=styles[word])
    return text if counts else Text(NOTHING, style="dim")


def _worst(verdicts: Sequence[tuple[str, Verdict]]) -> tuple[str, str]:
    """Return the smallest margin that decided something, and the run and moment it is from.

    For a measure, the range of its values.
    """
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
    run = " ".join(filter(None, (label, moment_text(verdict.evidence.time))))
    return margin(least, verdict.unit), run


def _line(label: str, change: OracleChange, styles: Styles) -> Text:
    if change.before is None or change.now is None:
        raise ValueError("only a verdict that was and is can have changed")
    then, now = str(change.before.outcome), str(change.now.outcome)
    return Text.assemble(
        (glyph_word(then), styles[then]),
        " → ",
        (glyph_word(now), styles[now]),
        "  ",
        (label, "bold"),
        f"  {verdict_line(change.now)}",
    )
