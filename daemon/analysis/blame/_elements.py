"""Elements of a failing run, and the answer about them, as values and in words."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from daemon.model.verdicts import Verdict
from grammars.text.words import enumerate_words

ElementKind: TypeAlias = Literal[
    "objects", "behaviours", "override", "parameter", "object", "waypoint", "behaviour"
]
TestOutcome: TypeAlias = Literal["pass", "fail", "unresolved"]


@dataclass(frozen=True, slots=True)
class Element:
    """A part of a failing run that may be removed.

    ``objects`` and ``behaviours``: a scenery layer; ``override``: the campaign's value for a
    parameter of one; ``parameter``: a value in which the system under test differs from its base.
    ``object``, ``waypoint`` and ``behaviour``: single things of the composed run. ``index``
    distinguishes equal names. The name of a ``parameter`` contains its value; ``setting`` is the
    name alone, empty for all other kinds.
    """

    kind: ElementKind
    name: str
    index: int = 0
    setting: str = ""

    @property
    def short_name(self) -> str:
        """The name of an element that was reported in full before."""
        return self.setting or self.name

    def __str__(self) -> str:
        return self.name


Elements: TypeAlias = frozenset[Element]


@dataclass(frozen=True, slots=True)
class Without:
    """Outcome of the run without one of the elements that it needs to fail."""

    element: Element
    word: TestOutcome
    note: str = ""


@dataclass(frozen=True, slots=True)
class Blame:
    """The story of a failure.

    ``verdict`` is the oracle's verdict on the run. ``layers`` are the layers and parameters that
    the failure needs, with the outcome without each. ``objects``, ``waypoints``, ``behaviours`` and
    ``parameters`` are those of the smallest run, ``last`` is its verdict; ``before`` counts each
    kind in the whole run. ``minimal`` means that no other thing can be removed; otherwise
    ``stopped`` says why this is unknown. ``settings`` are the names of the ``parameters`` without
    their values.
    """

    run: str
    verdict: Verdict
    layers: tuple[Without, ...]
    objects: tuple[str, ...]
    behaviours: tuple[str, ...]
    waypoints: tuple[str, ...]
    parameters: tuple[str, ...]
    before: tuple[tuple[ElementKind, int], ...]
    last: Verdict
    minimal: bool
    stopped: str
    settings: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Explanation:
    """Story of a failure, the effort to find it, and the campaign file of the smallest failing run.

    ``runs`` were executed in ``seconds`` of wall clock; the outcome of ``cached`` more was known.
    """

    blame: Blame
    runs: int
    cached: int
    seconds: float
    saved: Path


class NoFailureError(ValueError):
    """There is no failure to explain: the run passes, or does not fail again."""


def story_lines(story: Blame, like: str) -> tuple[str, ...]:
    """Return the reasons of a failure and the parts of the smallest run, line by line.

    ``like`` names the base of the system under test, if any.
    """
    return (*_layer_lines(story, like), *_part_lines(story))


def _layer_lines(story: Blame, like: str) -> Iterator[str]:
    if not story.layers:
        if story.stopped:
            yield "the layer that makes it fail is not known yet"
        else:
            bare = f" with {like}" if like else ""
            yield f"fails in the bare building{bare} as well: no layer is to blame"
        return
    on_top = like if story.parameters else ""
    names = enumerate_words([one.element.name for one in story.layers])
    yield f"fails with {names}{f' on top of {on_top}' if on_top else ''}"
    for one in story.layers:
        yield f"without {one.element.short_name}: {_outcome_without(one)}"


def _outcome_without(one: Without) -> str:
    if one.word == "fail":
        return "fails as well, but for another reason"
    return "passes" if one.word == "pass" else one.note or "cannot be judged"


def _part_lines(story: Blame) -> Iterator[str]:
    before = dict(story.before)
    doors = ", ".join(story.objects) or "no objects needed"
    waypoints = ", ".join(story.waypoints)
    yield f"{'minimal' if story.minimal else 'so far'}: {doors} (of {before['object']})"
    yield f"  waypoints {waypoints} (of {before['waypoint']})"
    behaviours = ", ".join(story.behaviours) or "needed: none"
    yield f"  behaviours {behaviours} (of {before['behaviour']})"
    if before["parameter"]:
        parameters = ", ".join(story.settings) or "needed: none"
        yield f"  parameters {parameters} (of {before['parameter']})"
