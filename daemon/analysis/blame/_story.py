"""The story of a failure in lines for people."""

from __future__ import annotations

from collections.abc import Iterator

from daemon.analysis.blame._elements import Blame, Without
from grammars.text.words import enumerate_words


def story_lines(story: Blame, like: str, *, several: bool) -> tuple[str, ...]:
    """Return what makes a run fail and what is left of it, line by line.

    ``like`` names the system under test that the run's own is like, if any; ``several`` says
    whether the campaign adds more than one layer or parameter.
    """
    return (*_layer_lines(story, like, several=several), *_part_lines(story))


def _layer_lines(story: Blame, like: str, *, several: bool) -> Iterator[str]:
    if not story.layers:
        if story.stopped:
            yield "which of its layers makes it fail is not known yet"
        else:
            bare = f" with {like}" if like else ""
            yield f"fails in the bare building{bare} as well: no layer is to blame"
        return
    on_top = like if story.parameters else ""
    names = enumerate_words([one.element.name for one in story.layers])
    yield f"fails with {names}{f' on top of {on_top}' if on_top else ''}"
    for one in story.layers:
        yield f"without {one.element.short_name}: {_outcome_without(one)}"
    # With a single layer added there is nothing that an order could say.
    if story.flips is not None and several:
        yield f"in the order of the campaign, it is {story.flips.short_name} that flips it"


def _outcome_without(one: Without) -> str:
    if one.word == "fail":
        return "fails as well, but for another reason"
    return "passes" if one.word == "pass" else one.note or "cannot be judged"


def _part_lines(story: Blame) -> Iterator[str]:
    before = dict(story.before)
    doors = ", ".join(story.objects) or "no objects"
    waypoints = ", ".join(story.waypoints)
    yield f"{'minimal' if story.minimal else 'so far'}: {doors} (of {before['object']})"
    yield f"  waypoints {waypoints} (of {before['waypoint']})"
    behaviours = ", ".join(story.behaviours) or "none"
    yield f"  behaviours {behaviours} (of {before['behaviour']})"
    if before["parameter"]:
        parameters = ", ".join(story.settings) or "none"
        yield f"  parameters {parameters} (of {before['parameter']})"
