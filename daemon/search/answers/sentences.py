"""A search in sentences: how it stands, and its answer in the order in which people ask."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from daemon.judging.statistics import (
    at_most,
    chance_correlation,
    cut_percentage,
    proportion_interval,
)
from daemon.model.proposals import Phase
from daemon.model.search import SearchTask
from daemon.model.search_answer import Influence, SearchAnswer, SearchRow
from daemon.search.answers.wording import (
    AS_WRITTEN,
    confirmation_words,
    failure_words,
    finding_words,
    margin_words,
    percentage,
    point_words,
    rounded,
)
from grammars.text.words import count_noun, enumerate_words

PHASES: Final[dict[Phase, str]] = {
    "explore": "looking for failures",
    "confirm": "repeating a failure with other noise",
    "nearest": "looking for the nearest failure",
    "shrink": "taking away what the failure does not need",
}
_MOST_TOLD: Final = 3
"""Findings and parameters that are named in a sentence."""


def search_word(row: SearchRow) -> str:
    """Return the one word for how a search stands: ``fail`` when there is a failure."""
    answer = row.answer
    if row.state == "failed":
        return "error"
    if answer is not None and answer.failed:
        return "fail"
    if row.state == "waiting":
        return "queued"
    if row.state != "finished":
        return row.state
    if answer is None or answer.ended == "errors":
        return "error"
    return "pass" if answer.best is not None else "inconclusive"


def verdict_words(row: SearchRow) -> str:
    """Return whether the scenario can fail, as far as it is known."""
    # Of one oracle that does not fail: others, which it was not about, may.
    about = "nothing fails" if len(row.task.scales) > 1 else f"{row.task.minimise} does not fail"
    words = {"fail": "it can fail", "pass": about}
    words |= dict.fromkeys(("running", "queued"), "nothing fails so far")
    return words.get(search_word(row), "not known")


def phase_words(row: SearchRow) -> str:
    """Return what a search is doing, or why it does nothing any more."""
    if row.state == "running":
        return PHASES[row.phase]
    if row.state == "waiting":
        return "waiting for somebody to go on with it"
    if row.state == "failed":
        return "it could not go on"
    if row.state == "cancelled":
        return "it was cancelled"
    return ending_words(row.task, row.answer.ended if row.answer else "") or "ended"


def headline_sentence(row: SearchRow) -> str:
    """Return what stands beside the verdict: the nearest failure, or how much was tried."""
    answer = row.answer
    if row.state == "failed":
        return (row.note.strip().splitlines() or ["It could not go on."])[-1]
    if answer is None:
        return "No run has a margin."
    if answer.nearest is not None:
        return f"Nearest failure: {answer.nearest.sentence}."
    runs = count_noun(answer.explored - answer.refused, "run")
    if answer.failed:
        return f"{answer.failed} of {runs} {'fails' if answer.failed == 1 else 'fail'}."
    return f"{runs}, {_nothing_below(answer)}."


def answer_sentences(task: SearchTask, answer: SearchAnswer) -> tuple[str, ...]:
    """Return what was found, or was not, sentence by sentence."""
    return tuple(_sentences(task, answer))


def _sentences(task: SearchTask, answer: SearchAnswer) -> Iterator[str]:
    yield from _first(task, answer)
    yield from _best(task, answer)
    if answer.confirmed is not None and answer.first is not None:
        yield f"run {answer.first.number} {confirmation_words(answer.confirmed)}"
    yield from _holding(answer)
    yield from _nearest(task, answer)
    if answer.shrunk is not None:
        runs = count_noun(answer.shrunk.runs, "run")
        yield f"shrunk in {runs}: {answer.shrunk.left or answer.shrunk.story[0].strip()}"
    yield from _distinct(answer)
    yield from _unsought(answer)
    yield from _frequency(task, answer)
    yield from _influence(task, answer)
    yield from _ending(task, answer)


def _first(task: SearchTask, answer: SearchAnswer) -> Iterator[str]:
    if answer.first is None:
        return
    where = point_words(task, answer.first.point)
    runs = count_noun(answer.explored - answer.refused, "run")
    failed = f"{answer.failed} of {runs} {'fails' if answer.failed == 1 else 'fail'}"
    yield f"{failed}, the first is run {answer.first.number}: {failure_words(answer.first)}"
    if where == AS_WRITTEN:
        yield f"run {answer.first.number} is the scenario as written"
    else:
        yield f"run {answer.first.number} has {where}"


def _best(task: SearchTask, answer: SearchAnswer) -> Iterator[str]:
    best = answer.best
    if best is None or best.value is None:
        return
    value = best.value
    near = f" near {value.object}" if value.object else ""
    yield (
        f"the smallest margin is {margin_words(best)} ({value.oracle}{near}), "
        f"in run {best.number}: {point_words(task, best.point)}"
    )


def _holding(answer: SearchAnswer) -> Iterator[str]:
    """Say how many of the failures are more than luck, as far as that is known."""
    if answer.repeated > 1:
        hold = "holds" if answer.holding == 1 else "hold"
        told = answer.holding or "none"
        yield f"of {answer.repeated} failures that were repeated {told} {hold} with most noises"


def _nearest(task: SearchTask, answer: SearchAnswer) -> Iterator[str]:
    nearest = answer.nearest
    if nearest is None:
        return
    first = answer.first
    # The first failure may be the nearest one: its repeats have been told then.
    same = first is not None and first.point == nearest.result.point
    which = f", run {first.number}" if same and first is not None else ""
    yield f"nearest failure{which}: {nearest.sentence}"
    if nearest.confirmed is not None and not (same and nearest.confirmed == answer.confirmed):
        yield f"the nearest failure {confirmation_words(nearest.confirmed)}"
    if not nearest.complete:
        runs = count_noun(nearest.runs, "run")
        yield f"there may be a nearer one: {runs} were spent before nothing could be taken back"


def _distinct(answer: SearchAnswer) -> Iterator[str]:
    if not answer.findings:
        return
    told = [finding_words(one) for one in answer.findings[:_MOST_TOLD]]
    more = len(answer.findings) - len(told)
    words = enumerate_words([*told, f"{more} more"] if more else told)
    yield f"{count_noun(len(answer.findings), 'distinct failure')}: {words}"


def _unsought(answer: SearchAnswer) -> Iterator[str]:
    if not answer.unsought:
        return
    runs = count_noun(answer.explored - answer.refused, "run")
    told = [
        f"{one.oracle} in {one.runs:,} of {runs}{', as written too' if one.as_written else ''}"
        for one in answer.unsought
    ]
    yield f"fails as well, which this search is not about: {'; '.join(told)}"


def _frequency(task: SearchTask, answer: SearchAnswer) -> Iterator[str]:
    """Say how much of the space fails: runs that were guided prove nothing about that."""
    drawn, failed = answer.space_filling, answer.space_filling_failed
    if answer.failed == 0 and answer.explored:
        yield f"{count_noun(answer.explored - answer.refused, 'run')}, {_nothing_below(answer)}"
    if drawn == 0:
        if answer.explored:
            yield "no run was drawn without looking at results: how much fails is not known"
    elif failed == 0:
        yield (
            f"{drawn} of the runs {'is' if drawn == 1 else 'are'} {task.drawn_word}: with 95 % "
            f"certainty less than {percentage(at_most(failed, drawn))} of the space fails"
        )
    else:
        low, high = proportion_interval(failed, drawn)
        yield (
            f"{failed} of {drawn} {task.drawn_word} runs {'fails' if failed == 1 else 'fail'}: "
            f"with 95 % certainty {cut_percentage(low)} to {percentage(high)} of the space"
        )


def _nothing_below(answer: SearchAnswer) -> str:
    return f"nothing below {margin_words(answer.best)}" if answer.best else "none with a margin"


def _influence(task: SearchTask, answer: SearchAnswer) -> Iterator[str]:
    if not answer.influence:
        return
    strong = sorted(
        (one for one in answer.influence if not is_by_chance(task, one)),
        key=lambda one: -abs(one.correlation),
    )
    count = answer.influence[0].runs
    runs = count_noun(count, f"{task.drawn_word} run")
    if strong:
        told = [
            f"{task.short_name(one.parameter)} ({rounded(one.correlation)})"
            for one in strong[:_MOST_TOLD]
        ]
        yield f"what decides most, by rank correlation in {runs}: {enumerate_words(told)}"
    else:
        bound = rounded(chance_correlation(count))
        yield f"nothing decides clearly: in {runs} chance gives rank correlations up to {bound}"


def is_by_chance(task: SearchTask, influence: Influence) -> bool:
    """Return whether a parameter that decides nothing gives such a correlation as well."""
    choices = next(p.choices for p in task.parameters if p.name == influence.parameter)
    bound = chance_correlation(influence.runs, max(len(choices), 2))
    return not abs(influence.correlation) > bound


def _ending(task: SearchTask, answer: SearchAnswer) -> Iterator[str]:
    if answer.refused:
        them = "it" if answer.refused == 1 else "them"
        points = count_noun(answer.refused, "point")
        yield f"{points} could not be composed: no run was made of {them}"
    if answer.errors:
        verb = "is an error" if answer.errors == 1 else "are errors"
        yield f"{count_noun(answer.errors, 'run')} {verb} and without a margin"
    if answer.inconclusive:
        verb = "is" if answer.inconclusive == 1 else "are"
        yield f"{count_noun(answer.inconclusive, 'run')} {verb} inconclusive"
    if words := ending_words(task, answer.ended):
        yield words + _late_failures(task, answer)


def _late_failures(task: SearchTask, answer: SearchAnswer) -> str:
    """Say why there are more failures than were asked for: their runs were out already."""
    more = answer.failed - task.failures
    if answer.ended != "failures" or more <= 0:
        return ""
    return f"; {count_noun(more, 'other')} came of runs that were out by then"


def ending_words(task: SearchTask, ended: str) -> str:
    """Return why a search ended."""
    failures = count_noun(task.failures, "failure")
    return {
        "budget": f"the budget of {count_noun(task.runs, 'run')} is spent",
        "time": f"the time of {rounded(task.seconds)} s is over",
        "failures": f"it ends after {failures}, as asked",
        "settled": "it ends because nothing better and nothing new was found for a while",
        "errors": "it ends because of errors in a row",
        "exhausted": "it ends because every point of the space was run",
    }.get(ended, "")
