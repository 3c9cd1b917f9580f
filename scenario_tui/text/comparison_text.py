"""Differences in words: of two runs, and of two judgements of the same runs."""

from __future__ import annotations

import itertools
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, Final

from rich.table import Table
from rich.text import Text

from daemon.analysis.rejudge import OracleChange, RejudgedTrace
from daemon.model.assessments import NO_MARK, Mark
from daemon.model.spec import RunSpec
from daemon.model.verdicts import Outcome, Verdict
from grammars.text import codec
from grammars.text.words import NOTHING, count_noun, format_quantity
from scenario_tui.text.formatting import (
    brief_seed,
    glyph_word,
    keep_start,
    margin,
    moment_text,
    plain_table,
    verdict_line,
)
from scenario_tui.text.run_text import NO_MARKS, append_mark, marked_style
from scenario_tui.text.styles import GLYPHS, QUIET, SEVERITY

_IDENTITY: Final = ("campaign", "repeat")
"""Fields of a specification in which equal runs may differ."""
_LONGEST: Final = 40
"""Most characters of a value, unless two that differ would look the same."""
_FEW: Final = 2
"""Most differences of one part to list one by one."""


def pair_verdicts(first: tuple[Verdict, ...], second: tuple[Verdict, ...]) -> list[OracleChange]:
    """Return the verdicts of two runs oracle by oracle, those that differ first."""
    ours, theirs = ({v.oracle: v for v in verdicts} for verdicts in (first, second))
    pairs = [OracleChange(name, ours.get(name), theirs.get(name)) for name in ours | theirs]
    return sorted(pairs, key=_is_alike)


def _is_alike(pair: OracleChange) -> bool:
    return pair.kind in ("same", "margin")


def margin_change(pair: OracleChange) -> float | None:
    """Return how much larger the second margin is, or the second measured value.

    It is rounded to the third digit of the larger of both, as the values are printed.
    """
    amounts = [_amount(verdict) for verdict in (pair.before, pair.now) if verdict is not None]
    match amounts:
        case [float(a), float(b)]:
            size = max(abs(a), abs(b))
            if not size or not math.isfinite(size):
                return b - a
            return round(b - a, 2 - math.floor(math.log10(size)))
    return None


def _amount(verdict: Verdict) -> float | None:
    return verdict.evidence.value if verdict.margin is None else verdict.margin


def spec_differences(first: RunSpec, second: RunSpec) -> list[tuple[str, str, str]]:
    """Return the differences of two specifications: the path of a part, then two texts."""
    ours, theirs = (dict(_flat("", codec.to_plain(spec))) for spec in (first, second))
    parts = [
        (path, *_shown(ours.get(path, NOTHING), theirs.get(path, NOTHING)))
        for path in ours | theirs
        if ours.get(path) != theirs.get(path) and path not in _IDENTITY
    ]
    # Many differences in one part, such as the behaviour of a door, become one line.
    lines: list[tuple[str, str, str]] = []
    for part, group in itertools.groupby(parts, key=lambda one: one[0].partition("]")[0]):
        listed = list(group)
        if len(listed) > _FEW:
            sides = zip(*(one[1:] for one in listed), strict=True)
            words = [NOTHING if set(side) == {NOTHING} else "differs" for side in sides]
            listed = [(f"{part}]", words[0], f"{words[1]} in {len(listed)} places")]
        lines += listed
    return lines


def _shown(first: str, second: str) -> tuple[str, str]:
    """Return two texts as short as they can be and still differ."""
    short = (_short(first), _short(second))
    return short if short[0] != short[1] else (first, second)


def _short(text: str) -> str:
    try:
        number = float(text)
    except ValueError:
        return keep_start(text, _LONGEST)
    # Long whole numbers are seeds.
    return f"{number:.6g}" if "." in text else brief_seed(int(text)) if text.isdigit() else text


def _flat(path: str, value: Any) -> Iterator[tuple[str, str]]:
    if isinstance(value, Mapping) and value:
        for key, part in value.items():
            yield from _flat(f"{path}.{key}" if path else str(key), part)
    # A list of numbers, such as a pose, is one value. Items of other lists are matched by name: by
    # index a new item would make all later ones different.
    elif isinstance(value, list) and any(isinstance(part, Mapping | list) for part in value):
        for index, part in enumerate(value):
            name = str(index + 1)
            if isinstance(part, Mapping):
                name = str(part.get("joint") or part.get("name") or part.get("id") or name)
            yield from _flat(f"{path}[{name}]", part)
    else:
        yield path, str(value)


def comparison_text(
    first: tuple[Verdict, ...],
    second: tuple[Verdict, ...],
    one: RunSpec,
    other: RunSpec,
    marks: tuple[Mapping[str, Mark], Mapping[str, Mark]] = (NO_MARKS, NO_MARKS),
) -> Text:
    """Return verdicts, margins and specifications of two runs, those that differ first.

    ``marks`` are those of the verdicts of each run, by oracle.
    """
    text = Text()
    text.append("oracle               first              second             change\n", style=QUIET)
    for pair in pair_verdicts(first, second):
        alike, change = _is_alike(pair), margin_change(pair)
        text.append(f"{pair.oracle:<20.20} ", style="" if alike else "bold")
        for verdict, marked in zip((pair.before, pair.now), marks, strict=True):
            text.append_text(_cell(verdict, marked.get(pair.oracle, NO_MARK)))
        unit = next(v.unit for v in (pair.before, pair.now) if v is not None)
        text.append(f"{'' if change is None else margin(change, unit)}{'' if alike else '  ≠'}\n")
    text.append("\nspecification\n", style="bold")
    differences = spec_differences(one, other)
    if not differences:
        text.append("the same, except for the repeat\n", style=QUIET)
    for path, ours, theirs in differences:
        text.append(f"{path}\n  ").append(f"{ours}  →  {theirs}\n", style=QUIET)
    return text


_CELL: Final = 18
"""Cells for a verdict with its margin; without room for the word, the sign stands alone."""


def _cell(verdict: Verdict | None, mark: Mark) -> Text:
    """Return a verdict in 19 columns."""
    if verdict is None:
        return Text(f"{NOTHING:<19}", style=QUIET)
    amount = margin(verdict.margin, verdict.unit)
    if verdict.margin is None:
        amount = format_quantity(verdict.evidence.value, verdict.unit)
    style, word = marked_style(verdict.outcome, mark), glyph_word(verdict.outcome)
    if len(f"{word} {mark.letter} {amount}") > _CELL:
        word = GLYPHS[verdict.outcome]
    text = append_mark(Text(word, style), mark).append(f" {amount}", style)
    text.truncate(_CELL, pad=True)
    return text.append(" ")


_LISTED: Final = 20
"""Most changed verdicts to list."""


def rejudge_parts(results: Sequence[RejudgedTrace]) -> list[Text | Table]:
    """Return the parts of a new judgement: a summary, changed verdicts, a table of oracles."""
    judged = [one for one in results if not one.problem]
    labels = _labels(judged)
    lines = [
        _change_line(labels[one.trace], change)
        for one in judged
        for change in one.changes
        if change.kind == "verdict"
    ]
    parts: list[Text | Table] = [Text(_summary(judged, len(results) - len(judged)))]
    if lines:
        parts += [Text(f"\n{count_noun(len(lines), 'verdict')} changed", "bold"), *_first(lines)]
    if judged:
        parts += [Text(), _oracle_table(judged, labels)]
    problems = [Text(f"{one.trace}: error: {one.problem}") for one in results if one.problem]
    for one in judged:
        errors = (v.evidence.note_text for v in one.verdicts if v.outcome is Outcome.ERROR)
        problems += [Text(f"{labels[one.trace]}: error: {why}") for why in dict.fromkeys(errors)]
    return [*parts, *_first(problems)]


def _first(lines: list[Text]) -> list[Text]:
    """Return the first lines, and the number of the others."""
    more = [Text(f"and {len(lines) - _LISTED} more")] if len(lines) > _LISTED else []
    return [*lines[:_LISTED], *more]


def _summary(judged: Sequence[RejudgedTrace], unreadable: int) -> str:
    """Return the number of judged runs, and the origins of their earlier verdicts."""
    same = sum(one.outcome is one.outcome_before for one in judged)
    in_ledger = sum(one.origin == "ledger" for one in judged)
    parts = [f"{count_noun(len(judged), 'trace')} judged, {same} as before"]
    if in_ledger:
        parts.append(f"{in_ledger} compared with the ledger")
    if in_ledger < len(judged):
        parts.append(f"{len(judged) - in_ledger} compared with the oracles in the trace")
    if unreadable:
        parts.append(f"{unreadable} not readable")
    return ", ".join(parts)


def _oracle_table(judged: Sequence[RejudgedTrace], labels: Mapping[str, str]) -> Table:
    """Return a table with a row per oracle: earlier and present outcomes, worst margin."""
    rows = plain_table("oracle", "before", "now", "worst margin", "in run")
    names = dict.fromkeys(v.oracle for one in judged for v in (*one.verdicts, *one.before))
    for name in names:
        now = [(labels[one.trace], v) for one in judged for v in one.verdicts if v.oracle == name]
        before = [v.outcome for one in judged for v in one.before if v.oracle == name]
        rows.add_row(
            name,
            _counts(before),
            _counts((v.outcome for _, v in now)),
            *_worst(now),
        )
    whole = [one.outcome_before for one in judged if one.outcome_before is not None]
    rows.add_section()
    rows.add_row("the run", _counts(whole), _counts(one.outcome for one in judged), "", "")
    return rows


def _labels(judged: Sequence[RejudgedTrace]) -> dict[str, str]:
    """Return the label of each trace: its run, or its file if several runs have that name."""
    # Copies of a campaign have runs with the same names.
    runs = Counter(one.run for one in judged)
    return {one.trace: one.run if runs[one.run] == 1 else one.trace for one in judged}


def _counts(outcomes: Iterable[Outcome]) -> Text:
    counts = Counter(map(str, outcomes))
    text = Text()
    for word in (w for w in SEVERITY if counts[w]):
        text.append("  " if text else "")
        text.append(f"{GLYPHS[word]} {counts[word]} {word}", style=word)
    return text if counts else Text(NOTHING, style="dim")


def _worst(verdicts: Sequence[tuple[str, Verdict]]) -> tuple[str, str]:
    """Return the smallest decisive margin, and its run and moment; the range of a measure."""
    measures = [v for _, v in verdicts if v.outcome is Outcome.MEASURE]
    values = [v.evidence.value for v in measures if v.evidence.value is not None]
    if values:
        unit = measures[0].unit
        return f"{format_quantity(min(values), unit)} to {format_quantity(max(values), unit)}", ""
    decided = [(label, v) for label, v in verdicts if v.outcome in (Outcome.PASS, Outcome.FAIL)]
    margins = [(v.margin, label, v) for label, v in decided if v.margin is not None]
    if not margins:
        return NOTHING, ""
    least, label, verdict = min(margins, key=lambda entry: entry[0])
    run = " ".join(filter(None, (label, moment_text(verdict.evidence.time))))
    return margin(least, verdict.unit), run


def _change_line(label: str, change: OracleChange) -> Text:
    if change.before is None or change.now is None:
        raise ValueError("a changed verdict needs an outcome before and now")
    then, now = str(change.before.outcome), str(change.now.outcome)
    return Text.assemble(
        (glyph_word(then), then),
        " → ",
        (glyph_word(now), now),
        "  ",
        (label, "bold"),
        f"  {verdict_line(change.now)}",
    )
