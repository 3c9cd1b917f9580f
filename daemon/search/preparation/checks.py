"""Findings about a search that show when it is tried: points without a run, unusable methods.

Loading finds what the file alone shows (:mod:`daemon.campaign`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from daemon.campaign import CampaignCell
from daemon.model.search import Point, PointValue, SearchParameter
from daemon.search.methods import method_problem
from daemon.search.points import with_value
from daemon.search.preparation.composition import SearchCase
from daemon.search.space import SearchSpace
from grammars.model.scene import Scene
from grammars.preflight import check_run, check_scene
from grammars.text.diagnostics import Diagnostic, InputError, Severity, Where
from grammars.text.documents import YamlDocument, parse_yaml

_MOST_CHOICES: Final = 20
"""Choices to try of a list, the first and the last ones of a longer one."""
_HINT: Final = "narrow the range, or write what must hold under such that: [a < b]"
_DRAWN: Final = 1_000
"""Number of points that are held against the constraints."""
_RARE: Final = 0.01


def check_search(case: SearchCase) -> tuple[Diagnostic, ...]:
    """Return what keeps a search from being run, and warnings about its points.

    The scenario as written, every parameter at both of its ends and the centre of the space are
    composed and held against what the pre-flight finds.
    """
    task = case.task
    places = _Places(parse_yaml(case.campaign.source, case.campaign.file), task.name)
    problem, findings = method_problem(task), list[Diagnostic]()
    if problem is not None:
        message = f"{task.name}: {problem.message}"
        findings.append(Diagnostic(places.at("method"), message, problem.hint))
    try:
        space = SearchSpace(task)
    except ValueError as error:
        return (*findings, Diagnostic(places.at(), f"{task.name}: {error}"))
    findings += _check_constraints(case, space, places)
    return (*findings, *_check_points(case, space, places))


@dataclass(frozen=True, slots=True)
class _Places:
    """Places of the parts of a search; the file for one that no file has."""

    document: YamlDocument
    name: str

    def at(self, *path: str) -> Where:
        return self.document.where(("search", self.name, *path))

    def of(self, parameter: SearchParameter) -> Where:
        return self.at("over", parameter.name)


def _check_constraints(
    case: SearchCase, space: SearchSpace, places: _Places
) -> Iterator[Diagnostic]:
    where = places.at("such that")
    if not space.constraints:
        return
    # With a seed of its own: findings do not depend on that of the search.
    draws = np.random.default_rng(np.random.SeedSequence(0)).random((_DRAWN, space.dimensions))
    kept = sum(space.allowed(space.at(draw)) for draw in draws) / _DRAWN
    texts = ", ".join(case.task.constraints)
    if kept == 0.0:
        message = f"{case.task.name}: no point of the ranges keeps to all of such that: {texts}"
        yield Diagnostic(where, message, "widen the ranges, or leave one of them out")
        return
    if kept < _RARE:
        message = f"{case.task.name}: of {_DRAWN} points {kept * _DRAWN:.0f} keep to such that"
        yield Diagnostic(where, message, "narrow the ranges", Severity.WARNING)
    if space.written is not None and not space.allowed(space.written):
        message = f"{case.task.name}: the scenario as written does not keep to such that: {texts}"
        hint = "it is the first run all the same"
        yield Diagnostic(where, message, hint, Severity.WARNING)


def _check_points(case: SearchCase, space: SearchSpace, places: _Places) -> Iterator[Diagnostic]:
    """Yield an error for each value that makes no run."""
    task, centre = case.task, space.at([0.5] * space.dimensions)
    pairs = zip(task.parameters, centre, strict=True)
    base = tuple(middle if p.written is None else p.written for p, middle in pairs)
    try:
        written = case.cell_at(base, 0, 0)
    except InputError as error:
        message = f"{task.name}: the scenario as written makes no run: {_first(error.diagnostics)}"
        yield Diagnostic(places.at(), message)
        return
    # Problems of the scenario as it stands are reported once, not of every value.
    known = frozenset(_errors(written))

    def refusal(point: Point) -> str:
        """Return why an allowed point makes no run; empty for one that does."""
        if not space.allowed(point):
            return ""
        try:
            cell = case.cell_at(point, 0, 0)
        except InputError as error:
            return _first(error.diagnostics)
        return next((words for words in _errors(cell, written.scene) if words not in known), "")

    alone = False
    for index, parameter in enumerate(task.parameters):
        for value in _ends_of(parameter):
            if words := refusal(with_value(base, index, value)):
                alone = True
                message = f"{parameter.name} at {parameter.text(value)} makes no run: {words}"
                yield Diagnostic(places.of(parameter), message, _HINT)
    if not alone and (words := refusal(centre)):
        message = f"{task.name}: the middle of all ranges makes no run: {words}"
        yield Diagnostic(places.at(), message, _HINT)


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
