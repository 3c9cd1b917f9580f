"""The answer of a search in sentences, in the order in which people ask."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from daemon.judging.statistics import chance_correlation, cut_percentage, proportion_interval
from daemon.model.search import SearchTask
from daemon.model.search_answer import Finding, SearchAnswer
from daemon.search.answers.findings import is_by_chance
from daemon.search.answers.wording import (
    AS_WRITTEN,
    confirmation_words,
    failure_words,
    margin_words,
    percentage,
    point_words,
    quantity,
    rounded,
)
from grammars.text.words import count_noun, enumerate_words

_MOST_TOLD: Final = 3
"""Findings and parameters that are named in a sentence."""


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
    where = point_words(task, answer.first)
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
        f"in run {best.number}: {point_words(task, best)}"
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
    same = first is not None and first.values == nearest.result.values
    which = f", run {first.number}" if same and first is not None else ""
    yield f"nearest failure{which}: {nearest.sentence}"
    if nearest.confirmed is not None and not (same and nearest.confirmed == answer.confirmed):
        yield f"the nearest failure {confirmation_words(nearest.confirmed)}"
    if nearest.unconfirmed is not None:
        smaller = point_words(task, nearest.unconfirmed)
        yield f"with some noises a smaller change is enough: {smaller}"
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


def finding_words(finding: Finding) -> str:
    """Return ``keeps-clear near kitchen_door on the way to w3 (4 runs)``."""
    # A mission's failure is about a waypoint, the one that it is on its way to.
    named = finding.object and finding.object != finding.waypoint
    near = f" near {finding.object}" if named else ""
    way = f" on the way to {finding.waypoint}" if finding.waypoint else ""
    return f"{finding.oracle}{near}{way} ({count_noun(finding.count, 'run')})"


def _frequency(task: SearchTask, answer: SearchAnswer) -> Iterator[str]:
    """Say how much of the space fails: runs that were guided prove nothing about that."""
    drawn, failed = answer.space_filling, answer.space_filling_failed
    if answer.failed == 0 and answer.explored:
        yield f"{count_noun(answer.explored - answer.refused, 'run')}, {_nothing_below(answer)}"
    if drawn == 0:
        if answer.explored:
            yield "no run was drawn without looking at results: how much fails is not known"
    elif failed == 0 and answer.failing_share is not None:
        yield (
            f"{drawn} of the runs {'is' if drawn == 1 else 'are'} {task.drawn_word}: with 95 % "
            f"certainty less than {percentage(answer.failing_share)} of the space fails"
        )
    else:
        low, high = proportion_interval(failed, drawn)
        yield (
            f"{failed} of {drawn} {task.drawn_word} runs {'fails' if failed == 1 else 'fail'}: "
            f"with 95 % certainty {cut_percentage(low)} to {percentage(high)} of the space"
        )


def _nothing_below(answer: SearchAnswer) -> str:
    best = answer.best
    if best is None or best.value is None:
        return "none with a margin"
    return f"nothing below {quantity(best.value.margin, best.value.unit)}"


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
        "cancelled": "it was cancelled",
    }.get(ended, "")
