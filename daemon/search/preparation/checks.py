"""What only shows when a search is tried: points that make no run, methods that cannot be used.

What can be said of the file alone is said when it is loaded (:mod:`daemon.campaign`).
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from daemon.campaign import CampaignCell
from daemon.model.search import Point, PointValue, SearchParameter
from daemon.search.methods import method_misfit, missing_library
from daemon.search.points import with_value
from daemon.search.preparation.composition import SearchCase
from daemon.search.space import SearchSpace
from grammars.model.scene import Scene
from grammars.preflight import check_run, check_scene
from grammars.text.diagnostics import Diagnostic, InputError, Severity, Where
from grammars.text.documents import YamlDocument, parse_yaml

_CORNERS: Final = 64
"""All corners of up to six parameters; of more, the lowest, the highest and some that are fixed."""
_MOST_CHOICES: Final = 20
"""Of a longer list the first and the last choices are tried."""
_MOST_TOLD: Final = 5
_DRAWN: Final = 1_000
"""So many points are held against the inequalities."""
_RARE: Final = 0.01


def check_search(case: SearchCase) -> tuple[Diagnostic, ...]:
    """Return what keeps a search from being run, and warnings about its points.

    The scenario as written, every parameter at both of its ends, the centre and the corners of the
    space are composed, and all but the corners held against what the pre-flight finds.
    """
    task = case.task
    places = _Places(parse_yaml(case.campaign.source, case.campaign.file), task.name)
    found = list(_check_method(case, places))
    try:
        space = SearchSpace(task)
    except ValueError as error:
        return (*found, Diagnostic(places.at(), f"{task.name}: {error}"))
    found += _check_inequalities(case, space, places)
    return (*found, *_PointTrial(case, space, places).findings())


@dataclass(frozen=True, slots=True)
class _Places:
    """Where the parts of a search are written; of one that is in no file, the file."""

    document: YamlDocument
    name: str

    def at(self, *path: str) -> Where:
        return self.document.where(("search", self.name, *path))

    def of(self, parameter: SearchParameter) -> Where:
        return self.at("over", parameter.name)


def _check_method(case: SearchCase, places: _Places) -> Iterator[Diagnostic]:
    misfit, missing = method_misfit(case.task), missing_library(case.task)
    for problem, severity in ((misfit, Severity.ERROR), (missing, Severity.WARNING)):
        if problem:
            message = f"{case.task.name}: {problem.message}"
            yield Diagnostic(places.at("method"), message, problem.hint, severity)


def _check_inequalities(
    case: SearchCase, space: SearchSpace, places: _Places
) -> Iterator[Diagnostic]:
    where = places.at("such that")
    if not space.constraints:
        return
    # Of a seed of its own: what is told does not depend on that of the search.
    draws = np.random.default_rng(np.random.SeedSequence(0)).random((_DRAWN, space.dimensions))
    kept = sum(space.allowed(space.at(draw)) for draw in draws) / _DRAWN
    texts = ", ".join(case.task.constraints)
    if kept == 0.0:
        message = f"{case.task.name}: no point of the ranges keeps to all of such that: {texts}"
        yield Diagnostic(where, message, "widen the ranges, or leave an inequality out")
    elif kept < _RARE:
        message = f"{case.task.name}: of {_DRAWN} points {kept * _DRAWN:.0f} keep to such that"
        yield Diagnostic(where, message, "narrow the ranges", Severity.WARNING)
    if space.written is not None and not space.allowed(space.written):
        message = f"{case.task.name}: the scenario as written does not keep to such that: {texts}"
        hint = "it is the first run all the same"
        yield Diagnostic(where, message, hint, Severity.WARNING)


class _PointTrial:
    """Points of a search that are composed, to see which of them make no run."""

    def __init__(self, case: SearchCase, space: SearchSpace, places: _Places) -> None:
        self._case, self._space, self._places = case, space, places
        self._parameters = case.task.parameters
        self._centre = space.at([0.5] * space.dimensions)
        pairs = zip(self._parameters, self._centre, strict=True)
        self._base: Point = tuple(middle if p.written is None else p.written for p, middle in pairs)
        self._known: frozenset[str] = frozenset()
        self._scene: Scene | None = None

    def findings(self) -> Iterator[Diagnostic]:
        """Yield what refuses which values."""
        try:
            base = self._case.cell_at(self._base, 0, 0)
        except InputError as error:
            refusal = _first(error.diagnostics)
            message = f"{self._case.task.name}: the scenario as written makes no run: {refusal}"
            yield Diagnostic(self._places.at(), message)
            return
        # What is wrong with the scenario as it stands is told of it, not of every value.
        self._known, self._scene = frozenset(_errors(base)), base.scene
        alone = list(self._ends())
        yield from alone
        refusal = self._tried(self._centre) if self._space.allowed(self._centre) else ""
        if refusal and not alone:
            message = f"{self._case.task.name}: the middle of all ranges makes no run: {refusal}"
            yield Diagnostic(self._places.at(), message, self._hint())
        if not alone and not refusal:
            yield from self._corners()

    def _ends(self) -> Iterator[Diagnostic]:
        """Yield what refuses a parameter at an end, with the others as written."""
        for index, parameter in enumerate(self._parameters):
            for value in _ends_of(parameter):
                point = with_value(self._base, index, value)
                refusal = self._tried(point) if self._space.allowed(point) else ""
                if refusal:
                    message = f"{parameter.name} at {parameter.text(value)} makes no run: {refusal}"
                    yield Diagnostic(self._places.of(parameter), message, self._hint())

    def _corners(self) -> Iterator[Diagnostic]:
        """Yield what refuses values that are far out together."""
        told: set[tuple[int, ...]] = set()
        for corner in _corners(self._parameters):
            if len(told) == _MOST_TOLD:
                return
            if not self._space.allowed(corner):
                continue
            refusal = self._refusal(corner)
            if not refusal:
                continue
            point, moved = self._fewest(corner)
            if moved in told:
                continue
            told.add(moved)
            values = " and ".join(
                f"{self._parameters[i].name} at {self._text(i, point)}" for i in moved
            )
            message = f"{values} make no run: {self._refusal(point) or refusal}"
            where = self._places.of(self._parameters[moved[0]])
            yield Diagnostic(where, message, self._hint(), Severity.WARNING)

    def _text(self, index: int, point: Point) -> str:
        return self._parameters[index].text(point[index])

    def _fewest(self, corner: Point) -> tuple[Point, tuple[int, ...]]:
        """Return a point that is refused with as little as possible at the values of ``corner``."""
        point, moved = corner, list(range(len(corner)))
        for index in range(len(corner)):
            nearer = with_value(point, index, self._base[index])
            if self._refusal(nearer):
                point = nearer
                moved.remove(index)
        return point, tuple(moved)

    def _hint(self) -> str:
        return "narrow the range, or write what must hold under such that: [a < b]"

    def _tried(self, point: Point) -> str:
        """Return why a point makes no run, or none that means anything."""
        try:
            cell = self._case.cell_at(point, 0, 0)
        except InputError as error:
            return _first(error.diagnostics)
        return next((said for said in _errors(cell, self._scene) if said not in self._known), "")

    def _refusal(self, point: Point) -> str:
        try:
            self._case.cell_at(point, 0, 0)
        except InputError as error:
            return _first(error.diagnostics)
        return ""


def _errors(cell: CampaignCell, checked: Scene | None = None) -> list[str]:
    """Return what the pre-flight refuses of a cell, less what it says of a scene ``checked``."""
    # Cells whose plan and objects are the same share a scene, of which all has been said.
    of_scene = () if cell.scene is checked else check_scene(cell.scene, places=cell.places)
    of_run = check_run(
        cell.scene,
        cell.robot,
        cell.mission,
        cell.behaviours[0],
        where=cell.mission_where,
        places=cell.places,
    )
    return [d.message for d in (*of_scene, *of_run) if d.severity is Severity.ERROR]


def _first(diagnostics: Sequence[Diagnostic]) -> str:
    one = diagnostics[0]
    return f"{one.message} ({one.where})"


def _ends_of(parameter: SearchParameter) -> tuple[PointValue, ...]:
    choices = parameter.choices
    if len(choices) > _MOST_CHOICES:
        return (*choices[: _MOST_CHOICES // 2], *choices[-_MOST_CHOICES // 2 :])
    return choices or (parameter.low, parameter.high)


def _corners(parameters: Sequence[SearchParameter]) -> Iterator[Point]:
    """Yield points of which every value is at an end of its range, at most :data:`_CORNERS`."""
    ends = [(_ends_of(p)[0], _ends_of(p)[-1]) for p in parameters]
    if 2 ** len(ends) <= _CORNERS:
        yield from itertools.product(*ends)
        return
    yield tuple(low for low, _ in ends)
    yield tuple(high for _, high in ends)
    draws = np.random.default_rng(np.random.SeedSequence(0))
    for _ in range(_CORNERS - 2):
        sides = draws.integers(0, 2, len(ends))
        yield tuple(end[int(side)] for end, side in zip(ends, sides, strict=True))
