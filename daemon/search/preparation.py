"""A search of a campaign file, checked before its first run and handed to a client.

Loading finds the errors of the file (:mod:`daemon.campaign`). The check here tries the points of
the search and its method.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from daemon.campaign import Campaign, CampaignCell, campaign_origin, examine
from daemon.model.search import Point, PointValue, SearchParameter, SearchSubmission, SearchTask
from daemon.model.search_answer import SearchRow
from daemon.search.composition import SearchCase, search_case
from daemon.search.methods import method_problem
from daemon.search.points import with_value
from daemon.search.space import SearchSpace
from grammars.model.scene import Scene
from grammars.preflight import check_run, check_scene
from grammars.text import codec
from grammars.text.diagnostics import Finding, InputError, Severity, Where, did_you_mean
from grammars.text.documents import YamlDocument, parse_yaml
from grammars.text.sources import recording_reads

_EXAMPLE: Final = "write one: search: {NAME: {scenario: …, minimise: ORACLE, over: {…}}}"

_ENDS: Final = 10
"""Choices to try at each end of a long list."""
_HINT: Final = "narrow the range, or write what must hold under such that: [a < b]"
_DRAWN: Final = 1_000
"""Number of random points checked against the constraints."""
_RARE: Final = 10
"""Fewer of these points are a warning."""


class PreparedSearch(NamedTuple):
    """A search to begin, the case for its program, and warnings."""

    submission: SearchSubmission
    case: SearchCase
    warnings: tuple[Finding, ...]


def prepare_search(
    path: Path,
    name: str = "",
    *,
    client: str = "",
    change: Callable[[SearchTask], SearchTask] = lambda task: task,
    find: Callable[[str], SearchRow | None] = lambda _: None,
    fresh: bool = False,
) -> PreparedSearch:
    """Load and check a campaign and one of its searches, for a ``client`` to run.

    ``change`` changes the task of the file. The search's id depends on its content, so an equal
    search has the same id; ``fresh`` asks for a new one. If the file has no search ``name``,
    ``find`` returns an earlier search of that id, which continues with its own task. Raises
    :class:`InputError` with all findings if there is an error, and if ``name`` is ambiguous.
    """
    with recording_reads() as read:
        campaign, findings = examine(path)
    _raise_errors(findings)
    own = any(task.name == name for task in campaign.searches)
    earlier = find(name) if name and not own else None
    task = change(_find_task(campaign, path, name) if earlier is None else earlier.task)
    case = search_case(campaign, task)
    findings = (*findings, *check_search(case))
    _raise_errors(findings)
    label = f"{campaign.name}-{task.name}"
    texts = sorted(hashlib.sha256(file.read_bytes()).hexdigest() for file in read)
    identity = secrets.token_hex(4) if fresh else codec.digest((task, texts))[:8]
    submission = SearchSubmission(
        campaign=f"{label}-{identity}" if earlier is None else earlier.campaign,
        name=label,
        about=task.about,
        source=campaign.source,
        task=task,
        file=str(path),
        origin=campaign_origin(campaign, path),
        fresh=fresh,
        client=client,
    )
    return PreparedSearch(submission, case, findings)


def _raise_errors(findings: Sequence[Finding]) -> None:
    if any(one.severity is Severity.ERROR for one in findings):
        raise InputError(findings)


def _find_task(campaign: Campaign, path: Path, name: str) -> SearchTask:
    tasks = {task.name: task for task in campaign.searches}
    if not name and len(tasks) == 1:
        return next(iter(tasks.values()))
    if name in tasks:
        return tasks[name]
    place = Where(str(path))
    if not tasks:
        raise InputError.at(place, "has no searches", _EXAMPLE)
    if not name:
        raise InputError.at(place, "has several searches", f"name one: {', '.join(tasks)}")
    raise InputError.at(place, f'has no search "{name}"', did_you_mean(name, tasks))


def check_searches(campaign: Campaign) -> tuple[Finding, ...]:
    """Return the findings of :func:`check_search` about every search of a campaign, each once."""
    cases = (search_case(campaign, task) for task in campaign.searches)
    return tuple(dict.fromkeys(one for case in cases for one in check_search(case)))


def check_search(case: SearchCase) -> tuple[Finding, ...]:
    """Return the errors that prevent a search, and warnings about its points.

    Compose the scenario as written, every parameter at both ends and the centre of the space, and
    check them by the pre-flight.
    """
    document = parse_yaml(case.campaign.source, case.campaign.file)
    return tuple(_SearchCheck(case, document).findings())


@dataclass(frozen=True, slots=True)
class _SearchCheck:
    """Check of a search; ``document`` has the places of its parts."""

    case: SearchCase
    document: YamlDocument

    def findings(self) -> Iterator[Finding]:
        """Yield all findings."""
        task = self.case.task
        problem = method_problem(task)
        if problem is not None:
            message, hint = problem
            yield self._finding(f"{task.name}: {message}", hint, "method")
        try:
            space = SearchSpace(task)
        except ValueError as error:
            yield self._finding(f"{task.name}: {error}", "")
            return
        if space.constraints:
            yield from self._constraint_findings(space)
        yield from self._point_findings(space)

    def _finding(
        self, message: str, hint: str, *path: str, severity: Severity = Severity.ERROR
    ) -> Finding:
        place = self.document.where(("search", self.case.task.name, *path))
        return Finding(place, message, hint, severity)

    def _constraint_findings(self, space: SearchSpace) -> Iterator[Finding]:
        name, texts = self.case.task.name, ", ".join(self.case.task.constraints)
        doubt = partial(self._finding, severity=Severity.WARNING)
        # The seed is fixed, so that findings do not depend on that of the search.
        draws = np.random.default_rng(0).random((_DRAWN, space.dimensions))
        count = sum(space.allowed(space.at(draw)) for draw in draws)
        if not count:
            message = f"{name}: no point of the ranges meets all of such that: {texts}"
            yield self._finding(message, "widen the ranges, or leave out a constraint", "such that")
            return
        if count < _RARE:
            message = f"{name}: of {_DRAWN} points only {count} meet such that"
            yield doubt(message, "narrow the ranges", "such that")
        if space.written is not None and not space.allowed(space.written):
            message = f"{name}: the scenario as written does not meet such that: {texts}"
            yield doubt(message, "it is still the first run", "such that")

    def _point_findings(self, space: SearchSpace) -> Iterator[Finding]:
        """Yield an error for each value that gives no run."""
        task, centre = self.case.task, space.at([0.5] * space.dimensions)
        pairs = zip(task.parameters, centre, strict=True)
        base = tuple(middle if p.written is None else p.written for p, middle in pairs)
        try:
            base_cell = self.case.cell_at(base, 0, 0)
        except InputError as error:
            words = _first(error.findings)
            message = f"{task.name}: the scenario as written makes no run: {words}"
            yield self._finding(message, "")
            return
        # Problems of the scenario as written are reported once, not for every value.
        reported = frozenset(_errors(base_cell))

        def refusal(point: Point) -> str:
            """Return why an allowed point gives no run; empty if it does."""
            if not space.allowed(point):
                return ""
            try:
                cell = self.case.cell_at(point, 0, 0)
            except InputError as error:
                return _first(error.findings)
            new = (words for words in _errors(cell, base_cell.scene) if words not in reported)
            return next(new, "")

        for index, parameter in enumerate(task.parameters):
            for value in _ends_of(parameter):
                if words := refusal(with_value(base, index, value)):
                    message = f"{parameter.name} at {parameter.text(value)} makes no run: {words}"
                    yield self._finding(message, _HINT, "over", parameter.name)
        if words := refusal(centre):
            message = f"{task.name}: the middle of all ranges makes no run: {words}"
            yield self._finding(message, _HINT)


def _errors(cell: CampaignCell, checked: Scene | None = None) -> list[str]:
    """Return the errors of the pre-flight, without those of the scene ``checked``."""
    # Cells with equal plan and objects share a scene.
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


def _first(diagnostics: Sequence[Finding]) -> str:
    one = diagnostics[0]
    return f"{one.message} ({one.where})"


def _ends_of(parameter: SearchParameter) -> tuple[PointValue, ...]:
    choices = parameter.choices
    ends = (*choices[:_ENDS], *choices[_ENDS:][-_ENDS:])
    return ends or (parameter.low, parameter.high)
