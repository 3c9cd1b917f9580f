"""From a search in a campaign file to what is handed to the daemon: checked, with all its files."""

from __future__ import annotations

import secrets
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

from daemon.campaign import Campaign, bundle_campaign, examine
from daemon.model.search import SearchSubmission, SearchTask
from daemon.search.preparation.checks import check_search
from daemon.search.preparation.composition import search_case
from grammars.text import codec
from grammars.text.diagnostics import Diagnostic, InputError, Severity, Where, did_you_mean

_EXAMPLE: Final = "write one: search: {NAME: {scenario: …, minimise: ORACLE, over: {…}}}"


def prepare_search(
    path: Path,
    name: str = "",
    *,
    change: Callable[[SearchTask], SearchTask] = lambda task: task,
    fresh: bool = False,
) -> tuple[SearchSubmission, tuple[Diagnostic, ...]]:
    """Load and check a campaign and one of its searches; returns the warnings too.

    ``change`` says what is to be otherwise than the file asks. The search's id is made of its
    content, so that the same search again is the same one; ``fresh`` asks for a new id. Raises
    :class:`InputError` with everything found when there is an error, and when several searches may
    be meant.
    """
    campaign, found = examine(path)
    if any(d.severity is Severity.ERROR for d in found):
        raise InputError(found)
    task = change(_find_task(campaign, path, name))
    found = (*found, *check_search(search_case(campaign, task)))
    if any(d.severity is Severity.ERROR for d in found):
        raise InputError(found)
    file, files = bundle_campaign(path)
    submission = SearchSubmission(
        campaign="",
        name=f"{campaign.name}-{task.name}",
        about=task.about,
        source=campaign.source,
        task=task,
        file=file,
        files=tuple(files),
    )
    identity = secrets.token_hex(4) if fresh else codec.digest(submission)[:8]
    return replace(submission, campaign=f"{submission.name}-{identity}", fresh=fresh), found


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
