"""Sentences about a search: its headline, its state and its answer.

The page, the command line and the dashboard print these sentences and add none of their own.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Final

from daemon.judging.statistics import (
    at_most,
    chance_correlation,
    cut_percentage,
    proportion_interval,
)
from daemon.model.search import Phase, Point, PointValue, SearchParameter, SearchTask
from daemon.model.search_answer import (
    Confirmation,
    DistinctFailure,
    Influence,
    NearestFailure,
    SearchAnswer,
    SearchRow,
)
from daemon.model.trials import Trial
from daemon.search.points import change_size, is_as_written
from grammars.text.words import count_noun, enumerate_words, first_words, format_quantity

AS_WRITTEN: Final = "as written"
"""Words for a point with every value as in the scenario."""
PHASES: Final[dict[Phase, str]] = {
    "explore": "looking for failures",
    "confirm": "repeating a failure with other noise",
    "nearest": "looking for the nearest failure",
    "shrink": "removing parts that the failure does not need",
}
_MOST_NAMED: Final = 3
"""Most values or parameters that a sentence names."""


def search_word(row: SearchRow) -> str:
    """Return the state of a search in one word: ``fail`` if there is a failure."""
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


def phase_words(row: SearchRow) -> str:
    """Return the current activity of a search, or why it stopped."""
    words = {
        "running": PHASES[row.phase],
        "waiting": "waiting for a client to continue it",
        "failed": "it could not go on",
        "cancelled": "it was cancelled",
    }
    ended = row.answer.ended if row.answer else ""
    return words.get(row.state) or ending_words(row.task, ended) or "ended"


def headline(row: SearchRow) -> str:
    """Return one sentence about a search: how often its failure holds, or the smallest margin."""
    if row.state == "failed":
        return (row.note.strip().splitlines() or ["it could not go on"])[-1]
    return "no run has a result yet" if row.answer is None else headline_of(row.task, row.answer)


def headline_of(task: SearchTask, answer: SearchAnswer) -> str:
    """Return the first sentence of an answer, which sums it up."""
    failure = answer.reported_failure
    if failure is not None:
        return failure_sentence(task, failure, answer.reported_confirmation)
    if answer.best is None:
        return "no run has a margin"
    about = "nothing fails" if len(task.scales) > 1 else f"{task.minimise} does not fail"
    of = f" of {answer.best.value.oracle}" if len(task.scales) > 1 and answer.best.value else ""
    margin = _margin_and_place(answer.best)
    return f"{about} in {_runs(answer)}, the smallest margin{of} is {margin}"


def failure_sentence(task: SearchTask, failure: Trial, confirmed: Confirmation | None) -> str:
    """Return how often a failure holds, with which changes, and by how much it fails.

    ``keeps-clear fails in 5 of 5 repeats with opens 8.54 s instead of 8 s (margin −0.018 m)``.
    """
    oracle = failure.verdict.oracle if failure.verdict is not None else task.minimise
    often, end = "", ""
    if confirmed is None:
        end = ", not repeated"
    elif confirmed.failed:
        often = f" in {confirmed.failed} of {count_noun(confirmed.runs, 'repeat')}"
    else:
        often = f" once and in none of {count_noun(confirmed.runs, 'repeat')}"
        end = ": not reproduced"
    changes = changes_text(task, failure.point)
    return f"{oracle} fails{often} {changes}{_in_brackets(failure)}{end}"


def changes_text(task: SearchTask, point: Point) -> str:
    """Return the changed values, the largest change first; of many only some.

    ``with kitchen_opens 8.54 s instead of 8 s``, or ``as written``.
    """
    changes = []
    for parameter, value in zip(task.parameters, point, strict=True):
        if not is_as_written(parameter, value):
            text = _value_words(task, parameter, value)
            if parameter.written is not None:
                text += f" instead of {parameter.shown(parameter.written)}"
            changes.append((change_size(parameter, value), text))
    words = [text for _, text in sorted(changes, key=lambda one: -one[0])]
    if len(words) > _MOST_NAMED + 1:
        words = [*words[:_MOST_NAMED], f"{len(words) - _MOST_NAMED} more"]
    return f"with {enumerate_words(words)}" if words else AS_WRITTEN


def point_words(task: SearchTask, point: Point, most: int = 4) -> str:
    """Return the changed values of a point, ``most`` of them at most."""
    words = [
        _value_words(task, parameter, value)
        for parameter, value in zip(task.parameters, point, strict=True)
        if not is_as_written(parameter, value)
    ]
    return first_words(words, most) or AS_WRITTEN


def _value_words(task: SearchTask, parameter: SearchParameter, value: PointValue) -> str:
    return f"{task.short_name(parameter.name)} {parameter.shown(value)}"


def answer_sentences(task: SearchTask, answer: SearchAnswer) -> tuple[str, ...]:
    """Return the sentences of an answer, the headline first; empty before the first result."""
    return tuple(_sentences(task, answer)) if answer.explored else ()


def _sentences(task: SearchTask, answer: SearchAnswer) -> Iterator[str]:
    yield headline_of(task, answer)
    yield from _repeats(answer)
    if answer.nearest is not None:
        yield from _nearest(task, answer.nearest)
    if answer.shrunk is not None:
        runs = count_noun(answer.shrunk.runs, "run")
        yield f"shrunk in {runs}: {answer.shrunk.left or answer.shrunk.story[0].strip()}"
    yield from _examples(task, answer)
    yield from _unsought(answer)
    yield from _frequency(task, answer)
    yield from _influence(task, answer)
    yield from _ending(task, answer)


def _repeats(answer: SearchAnswer) -> Iterator[str]:
    """Yield the evidence of the repeats: bounds of the rate, number of failures that hold."""
    rate = answer.reported_confirmation
    if rate is not None:
        bounds = f"{cut_percentage(rate.low)} to {percentage(rate.high)}"
        yield f"with other noise it fails in {bounds} of runs, with 95 % certainty"
    first, failure = answer.first, answer.reported_failure
    if answer.confirmed and first and failure and first.point != failure.point:
        often = f"in {answer.confirmed.failed} of {count_noun(answer.confirmed.runs, 'repeat')}"
        yield f"the first failure, run {first.number}, fails {often}"
    if answer.repeated > 1:
        verb = "holds" if answer.holding == 1 else "hold"
        holding = answer.holding or "none"
        yield f"of {answer.repeated} failures that were repeated {holding} {verb} with most noises"


def _nearest(task: SearchTask, nearest: NearestFailure) -> Iterator[str]:
    passes = nearest.passes
    if passes is not None:
        yield f"it passes {changes_text(task, passes.point)}{_in_brackets(passes)}"
    if not nearest.complete:
        runs = count_noun(nearest.runs, "run")
        yield f"there may be a nearer one: {runs} were spent while values could still be taken back"


def _examples(task: SearchTask, answer: SearchAnswer) -> Iterator[str]:
    """Yield the number of failing runs, the first one and the one with the smallest margin."""
    first, best = answer.first, answer.best
    if first is not None:
        verb = "fails" if answer.failed == 1 else "fail"
        point = point_words(task, first.point)
        count = f"{answer.failed} of {_runs(answer)} {verb}, the first is run {first.number}"
        yield f"{count}{_in_brackets(first)}: {point}"
    if best is not None and (first is None or best.number != first.number):
        margin, point = _margin_and_place(best), point_words(task, best.point)
        yield f"run {best.number} has the smallest margin, {margin}: {point}"


def _unsought(answer: SearchAnswer) -> Iterator[str]:
    if not answer.unsought:
        return
    others = [
        f"{one.oracle} in {one.runs:,} of {_runs(answer)}"
        f"{', as written too' if one.as_written else ''}"
        for one in answer.unsought
    ]
    yield f"other oracles fail too: {'; '.join(others)}"


def _frequency(task: SearchTask, answer: SearchAnswer) -> Iterator[str]:
    """Yield the share of the space that fails, by unguided runs alone."""
    runs, failed = answer.space_filling, answer.space_filling_failed
    if runs == 0:
        yield "no unguided run was judged: the share of the space that fails is unknown"
    elif failed == 0:
        yield (
            f"{runs} of the runs {'is' if runs == 1 else 'are'} {task.drawn_word}: with 95 % "
            f"certainty less than {percentage(at_most(failed, runs))} of the space fails"
        )
    else:
        low, high = proportion_interval(failed, runs)
        yield (
            f"{failed} of {runs} {task.drawn_word} runs {'fails' if failed == 1 else 'fail'}: "
            f"with 95 % certainty {cut_percentage(low)} to {percentage(high)} of the space"
        )


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
        names = [
            f"{task.short_name(one.parameter)} ({format_quantity(one.correlation)})"
            for one in strong[:_MOST_NAMED]
        ]
        yield f"most influence, by rank correlation in {runs}: {enumerate_words(names)}"
    else:
        bound = format_quantity(chance_correlation(count))
        yield f"no clear influence: in {runs} chance gives rank correlations up to {bound}"


def is_by_chance(task: SearchTask, influence: Influence) -> bool:
    """Return whether a parameter without influence may have this correlation by chance."""
    choices = next(p.choices for p in task.parameters if p.name == influence.parameter)
    bound = chance_correlation(influence.runs, max(len(choices), 2))
    return not abs(influence.correlation) > bound


def _ending(task: SearchTask, answer: SearchAnswer) -> Iterator[str]:
    if answer.refused:
        have = "has" if answer.refused == 1 else "have"
        points = count_noun(answer.refused, "point")
        yield f"{points} could not be composed and {have} no run"
    if answer.errors:
        verb = "is an error and has" if answer.errors == 1 else "are errors and have"
        yield f"{count_noun(answer.errors, 'run')} {verb} no margin"
    if answer.inconclusive:
        verb = "is" if answer.inconclusive == 1 else "are"
        yield f"{count_noun(answer.inconclusive, 'run')} {verb} inconclusive"
    if words := ending_words(task, answer.ended):
        more = answer.failed - task.failures
        if answer.ended == "failures" and more > 0:
            words += f"; {count_noun(more, 'other')} came from runs already running"
        yield words


def ending_words(task: SearchTask, ended: str) -> str:
    """Return the reason for the end of a search."""
    failures = count_noun(task.failures, "failure")
    return {
        "budget": f"the budget of {count_noun(task.runs, 'run')} is spent",
        "time": f"the time of {format_quantity(task.seconds)} s is over",
        "failures": f"it ends after {failures}, as asked",
        "settled": "it ends without a better margin or a new failure for a while",
        "errors": "it ends because of errors in a row",
        "exhausted": "it ends because every point of the space was run",
    }.get(ended, "")


def finding_words(finding: DistinctFailure) -> str:
    """Return ``keeps-clear near kitchen_door on the way to w3 (4 runs)``."""
    # The object of a failed mission is the waypoint that the robot drives to.
    has_place = finding.object and finding.object != finding.waypoint
    near = f" near {finding.object}" if has_place else ""
    way = f" on the way to {finding.waypoint}" if finding.waypoint else ""
    return f"{finding.oracle}{near}{way} ({count_noun(finding.count, 'run')})"


def _runs(answer: SearchAnswer) -> str:
    return count_noun(answer.explored - answer.refused, "run")


def _in_brackets(trial: Trial) -> str:
    """Return `` (margin −0.018 m near kitchen_door)``, empty for a trial without a margin."""
    margin = _margin_and_place(trial)
    return f" (margin {margin})" if margin else ""


def _margin_and_place(trial: Trial) -> str:
    margin = margin_words(trial)
    return f"{margin} near {trial.about}" if margin and trial.about else margin


def margin_words(trial: Trial, *, signed: bool = False) -> str:
    """Return the margin of a run: ``0.105 m``, ``+0.105 m`` if ``signed``; empty without one.

    For a failure it is that of the failing oracle, even if another margin is smaller.
    """
    margin, unit, verdict = None, "", trial.verdict
    if trial.value is not None:
        margin, unit = trial.value.margin, trial.value.unit
    if trial.fails and verdict and (not trial.value or trial.value.oracle != verdict.oracle):
        margin, unit = verdict.margin, verdict.unit
    return "" if margin is None else format_quantity(margin, unit, signed=signed)


def minus(number: str) -> str:
    """Return a number with a minus sign as wide as a plus: U+2212."""
    return number.replace("-", "−")


def percentage(share: float) -> str:
    """Return an upper bound such as ``18.2 %``, rounded up, so it never claims less."""
    return f"{math.ceil(share * 1000 - 1e-9) / 10:g} %"
