"""A campaign in a row of a table and in a few lines: outcomes, margins, failures, history."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final

from rich.text import Text

from grammars.text.words import NOTHING, count_noun, duration_text
from scenario_tui.text.formatting import (
    age_text,
    brief_duration,
    margin,
    run_counts,
    run_word,
    verdict_line,
)
from scenario_tui.text.heat_text import Heat, heat_lines
from scenario_tui.text.results import NONE_JUDGED
from scenario_tui.text.run_text import append_mark, marked_style
from scenario_tui.text.styles import GLYPHS, KNOWN, QUIET

if TYPE_CHECKING:
    from daemon.analysis.results import CampaignResults
    from daemon.model.search_answer import SearchRow
    from daemon.model.status import CampaignRow, RunRow
    from scenario_tui.text.results import Conclusion

_BAR: Final = {
    "pass": "━", "fail": "█", "error": "▓", "lost": "▒", "inconclusive": "░", "cancelled": "-",
    "running": "╌", "queued": "·",
}  # fmt: skip
"""Signs in a bar of outcomes from left to right; a pass is thin, also without colours."""
_SEARCHED: Final = {"fail": "found", "pass": "none", "cancelled": "ended", "queued": "waiting"}
"""The end of a search in one word."""
_MARKED_FIRST: Final = ("news", "", "known")
_FAILURES: Final = 6
"""Number of failures to list with their sentence."""
_MATRIX: Final = 14
"""Most lines of a matrix."""
_HISTORY: Final = 24
"""Number of earlier campaigns of the same name to draw."""


def judged_text(row: CampaignRow, conclusion: Conclusion | None) -> Text:
    """Return the agreement of a campaign with its expectations, quiet if it is acknowledged."""
    # The agreement of an unfinished campaign is preliminary; the pause is more important.
    if row.paused and not row.finished:
        return Text("‖ paused", style="inconclusive")
    if conclusion is None:
        return Text(NOTHING, style=QUIET)
    if conclusion.text == NONE_JUDGED and row.done:
        return Text("… judging", style=QUIET)
    text = f"{GLYPHS[conclusion.word]} {conclusion.brief}"
    return Text(text, style=QUIET if row.acknowledged else conclusion.word)


def searched_text(row: CampaignRow, search: SearchRow) -> Text:
    """Return the phase of a search, or its end, with the smallest margin that it has found."""
    # Imported here, because only a search needs it and the first screen must be fast.
    from daemon.search.answers.sentences import search_word

    if row.paused and not search.ended:
        return Text("‖ paused", style="inconclusive")
    word = search_word(search)
    text: str = search.phase
    if search.state != "running":
        text = f"{GLYPHS[word]} {_SEARCHED.get(word, word)}"
    best = search.answer.best if search.answer is not None else None
    least = f" {margin(best.value.margin, best.value.unit)}" if best and best.value else ""
    return Text(f"{text}{least}", style=QUIET if row.acknowledged else word)


def fail_style(row: CampaignRow, conclusion: Conclusion | None) -> str:
    """Return the style of failed runs: red as long as they may be news."""
    are_known = conclusion is not None and conclusion.known == row.failed
    return KNOWN if are_known or _is_fine(conclusion) or row.acknowledged else "fail"


def _is_fine(conclusion: Conclusion | None) -> bool:
    """Return True if all verdicts are as expected, so that failures are known."""
    return conclusion is not None and conclusion.word in ("pass", "running")


def progress_text(row: CampaignRow, total: int, width: int) -> Text:
    """Return how many runs have ended, behind a bar until all have."""
    count = f"{row.ended:,}/{total:,}"
    cells = width - len(count) - 1
    if row.finished or cells < 3:
        return Text(count)
    done = round(cells * row.ended / max(total, 1))
    return Text.assemble(("━" * done, "running"), ("─" * (cells - done), QUIET), f" {count}")


def outcome_bar(row: CampaignRow, width: int, fail: str) -> Text:
    """Return the share of each outcome among the runs as one bar; ``fail`` is the style of fails.

    Every outcome has at least one cell.
    """
    counts = run_counts(row)
    total = sum(counts.values())
    cells = {word: max(counts[word] * width // total, 1) for word in _BAR if word in counts}
    if cells:
        cells[max(cells, key=cells.__getitem__)] += width - sum(cells.values())
    parts = ((_BAR[word] * n, fail if word == "fail" else word) for word, n in cells.items())
    return Text.assemble(*parts)


def margin_marks(conclusion: Conclusion | None, width: int) -> Text:
    """Return the worst margin of each cell as a bar, in the order of the matrix.

    If there are more cells than ``width``, neighbours share a bar, that of the worst.
    """
    margins = conclusion.margins if conclusion is not None else ()
    size = max(-(-len(margins) // width), 1)
    text = Text()
    for first in range(0, len(margins), size):
        shares = [share for share in margins[first : first + size] if share is not None]
        if shares:
            least = min(shares)
            text.append(*Heat("fail" if least < 0 else "pass", least, _is_fine(conclusion)).mark())
        else:
            text.append("·", style=QUIET)
    return text


def when_text(row: CampaignRow, now: float) -> Text:
    """Return the time that a campaign still takes, otherwise the time since it was submitted."""
    if row.seconds_left is not None and not row.paused:
        return Text(f"{brief_duration(row.seconds_left)} left")
    return Text(_submission_age(row, now), style=QUIET)


def _submission_age(row: CampaignRow, now: float) -> str:
    """Return how long ago a campaign was submitted, to the minute."""
    age = now - row.submitted_at
    return "just now" if age < 60.0 else age_text(row.submitted_at, now)


def history_text(row: CampaignRow, campaigns: Iterable[CampaignRow]) -> Text:
    """Return the pass rates of campaigns of this name up to this one; empty for the first one."""
    same = sorted(
        (one for one in campaigns if one.name == row.name and one.done),
        key=lambda one: one.submitted_at,
    )
    rates = [one.passed / one.done for one in same if one.submitted_at <= row.submitted_at]
    if len(rates) < 2:
        return Text()
    text = Text.assemble(*(Heat("pass", rate).mark() for rate in rates[-_HISTORY:]))
    first, last = (f"{100 * rate:.0f} %" for rate in (rates[0], rates[-1]))
    return text.append(f"  {first} → {last} passed, {count_noun(len(rates), 'campaign')}")


def failure_lines(results: CampaignResults, width: int) -> list[Text]:
    """Return the last failures, news first: the run with its mark, and its sentence."""
    marks = results.expectations
    failures = [
        (run, marks.mark(run))
        for run in reversed(results.rows)
        if run_word(run) in ("fail", "error", "lost")
    ]
    failures.sort(key=lambda pair: _MARKED_FIRST.index(pair[1].kind))
    lines = []
    for run, mark in failures[:_FAILURES]:
        word = run_word(run)
        text = Text.assemble((GLYPHS[word], marked_style(word, mark)), f" {run.label} ")
        append_mark(text, mark)
        text.append(f" known: {mark.reason}" if mark.kind == "known" else "", style=QUIET)
        lines += [text, Text(f"  {_sentence(run)}", style=QUIET)]
    if len(failures) > _FAILURES:
        lines.append(Text(f"  and {len(failures) - _FAILURES:,} more", style=QUIET))
    for line in lines:
        line.truncate(width, overflow="ellipsis")
    return lines


def _sentence(run: RunRow) -> str:
    verdict = run.verdict(run.oracle)
    return verdict_line(verdict) if verdict is not None else run.note.partition("\n")[0]


def judged_lines(results: CampaignResults, width: int) -> Text:
    """Return the matrix of a campaign and its last failures.

    This looks at every verdict of the campaign: call it only after the results have changed.
    """
    lines = heat_lines(results, width, _MATRIX)
    if failures := failure_lines(results, width):
        lines += [Text(), Text("last failures", style="bold"), *failures]
    return Text("\n").join(lines)


def campaign_text(
    row: CampaignRow,
    conclusion: Conclusion | None,
    campaigns: Sequence[CampaignRow],
    now: float,
    judged: Text,
    *,
    search: SearchRow | None = None,
    marks: Sequence[str] = (),
) -> Text:
    """Return a campaign in words: its state, ``judged`` lines, history, the next command.

    ``marks`` are unusual facts about the start of its runs.
    """
    text = Text.assemble((row.name, "bold"), "  ")
    text.append_text(judged_text(row, conclusion) if search is None else searched_text(row, search))
    if conclusion is not None and conclusion.known:
        text.append(f"  {conclusion.known:,} known", style=KNOWN)
    text.append("  acknowledged" if row.acknowledged else "", style=QUIET)
    for mark in marks:
        text.append(f"  {mark}", style="inconclusive")
    for word, count in run_counts(row).items():
        text.append("\n" if text.plain.count("\n") == 0 else "  ")
        style = fail_style(row, conclusion) if word == "fail" else word
        text.append(f"{GLYPHS[word]} {count:,} {word}", style=style)
    if judged:
        text.append("\n\n").append_text(judged)
    if search is not None:
        text.append_text(_search_sentences(search))
    if history := history_text(row, campaigns):
        text.append("\n\nhistory  ", style="bold").append_text(history)
    text.append(f"\n\n{row.about}" if row.about else "\n")
    text.append(f"\n{count_noun(row.total, 'run')}, submitted {_submission_age(row, now)}")
    if row.seconds_left is not None:
        text.append(f", {duration_text(row.seconds_left)} left")
    if row.finished_at is not None:
        text.append(f", finished in {duration_text(row.finished_at - row.submitted_at)}")
    return text.append(f"\nscenario {'search' if row.search else 'results'} {row.id}", style=QUIET)


def _search_sentences(search: SearchRow) -> Text:
    from daemon.search.answers.sentences import search_word
    from scenario_tui.text.search_text import search_line

    text = Text(f"\n\nsearch: {search_line(search)}", style=search_word(search))
    sentences = search.answer.sentences if search.answer is not None else ()
    return text.append("".join(f"\n{sentence}" for sentence in sentences))
