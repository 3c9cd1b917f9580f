"""From a search in a campaign file to what its client begins: checked, under an id of its own."""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from daemon.campaign import Campaign, campaign_origin, examine
from daemon.model.search import SearchSubmission, SearchTask
from daemon.model.search_answer import SearchRow
from daemon.search.preparation.checks import check_search
from daemon.search.preparation.composition import SearchCase, search_case
from grammars.text import codec
from grammars.text.diagnostics import Diagnostic, InputError, Severity, Where, did_you_mean
from grammars.text.sources import recording_reads

_EXAMPLE: Final = "write one: search: {NAME: {scenario: …, minimise: ORACLE, over: {…}}}"


class PreparedSearch(NamedTuple):
    """A search to begin, the case that its program is about, and warnings."""

    submission: SearchSubmission
    case: SearchCase
    warnings: tuple[Diagnostic, ...]


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

    ``change`` changes what the file asks. The search's id is made of its content, so that the same
    search again is the same one; ``fresh`` asks for a new id. Where ``name`` is none of the file,
    ``find`` is asked for a known search of that id, which goes on as it was asked for. Raises
    :class:`InputError` with everything found when there is an error, and when several searches may
    be meant.
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


def _raise_errors(findings: Sequence[Diagnostic]) -> None:
    if any(one.severity is Severity.ERROR for one in findings):
        raise InputError(findings)


def _find_task(campaign: Campaign, path: Path, name: str) -> SearchTask:
    tasks = {task.name: task for task in campaign.searches}
    if not name and len(tasks) == 1:
        return next(iter(tasks.values()))
    if name in tasks:
        return tasks[name]
    if not tasks:
        raise InputError(Diagnostic(Where(str(path)), "has no searches", _EXAMPLE))
    names = ", ".join(tasks)
    if not name:
        raise InputError(Diagnostic(Where(str(path)), "has several searches", f"name one: {names}"))
    hint = did_you_mean(name, tasks)
    raise InputError(Diagnostic(Where(str(path)), f'has no search "{name}"', hint))
