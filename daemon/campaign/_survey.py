"""A campaign file understood as far as it goes: one bad key does not hide what else is wrong."""

from __future__ import annotations

import copy
import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, Final

from daemon.campaign._file import CampaignFile, SlotsText
from daemon.campaign._scenarios import (
    ResolvedScenario,
    bases_of,
    missing_slots,
    resolve_scenario,
)
from grammars.text.diagnostics import Diagnostic, InputError, closest
from grammars.text.documents import KeyPath, YamlDocument, read_model


@dataclass(frozen=True, slots=True)
class CampaignSurvey:
    """What there is to understand in a campaign file, whether or not all of it is.

    ``scenarios`` are the concrete ones. Those in ``incomplete`` lost keys that could not be read:
    what they name can be loaded, what is missing in them is nobody's fault. ``lost`` says whether
    anything at all was left out of ``text``.
    """

    text: CampaignFile
    scenarios: tuple[ResolvedScenario, ...]
    incomplete: frozenset[str]
    lost: bool
    problems: tuple[Diagnostic, ...]
    unread_searches: frozenset[str] = frozenset()
    """The searches of which something was left out."""


def read_campaign(document: YamlDocument) -> tuple[CampaignFile, tuple[ResolvedScenario, ...]]:
    """Return the file's keys and its concrete scenarios; raises :class:`InputError`."""
    survey = survey_campaign(document)
    if survey.problems:
        raise InputError(survey.problems)
    return survey.text, survey.scenarios


def survey_campaign(document: YamlDocument) -> CampaignSurvey:
    """Read what can be read of a campaign file, so that one bad key does not hide the rest.

    Raises :class:`InputError` when no scenario is left.
    """
    problems: list[Diagnostic] = []
    lost: set[KeyPath] = set()
    try:
        text = read_model(document, CampaignFile)
    except InputError as error:
        problems.extend(error.diagnostics)
        text, lost = _readable_part(document, error)
    incomplete = {str(path[1]) for path in lost if path[0] == "scenarios"}
    if any(_may_hold_for_all(path[0]) for path in lost):
        incomplete |= text.scenarios.keys()
    scenarios: list[ResolvedScenario] = []
    for name, scenario in text.scenarios.items():
        try:
            resolved = resolve_scenario(name, text, document)
        except InputError as error:
            # What is like a scenario that could not be read does nothing wrong itself.
            if not any(("scenarios", base) in lost for base in _named_bases(name, text)):
                problems.extend(error.diagnostics)
            incomplete.add(name)
            resolved = _without_base(name, text, document)
        if not incomplete.isdisjoint(bases_of(name, text)):
            incomplete.add(name)
        if not scenario.abstract:
            scenarios.append(resolved)
    if not scenarios:
        where = document.where(("scenarios",))
        problems.append(Diagnostic(where, "every scenario is abstract, nothing to run"))
        raise InputError(dict.fromkeys(problems))
    # A key that could not be read is not missing.
    if not lost:
        problems.extend(missing_slots(scenarios, text, document, incomplete))
    return CampaignSurvey(
        text,
        tuple(scenarios),
        frozenset(incomplete),
        bool(lost),
        tuple(dict.fromkeys(problems)),
        frozenset(
            name
            for name in text.search
            if any(p[:2] in (("search", name), ("search",)) for p in lost)
        ),
    )


_ROUNDS: Final = 3
"""So often is what cannot be read left out: what is left may be wrong as a whole."""
_STAND_INS: Final = {"campaign": "unnamed", "limit": "1 h"}
"""What a campaign without these keys is examined with."""


def _readable_part(
    document: YamlDocument, refusal: InputError
) -> tuple[CampaignFile, set[KeyPath]]:
    """Return the campaign without what was refused, and the paths of that.

    Raises ``refusal`` when the rest is no campaign either.
    """
    if not isinstance(document.data, dict):
        raise refusal
    # Of keys at one place the innermost is meant: "scenarios: {a: {…}}" may stand on one line.
    paths = {
        where: path for path, where in sorted(document.places.items(), key=lambda p: len(p[0]))
    }
    data = copy.deepcopy(document.data)
    lost: set[KeyPath] = set()
    found = refusal
    for _ in range(_ROUNDS):
        for diagnostic in found.diagnostics:
            # A list without one of its items would shift the places of all that follow.
            path = tuple(itertools.takewhile(_is_key, paths.get(diagnostic.where, ())))
            if path:
                lost.add(path)
                _leave_out(data, path)
        data = {key: data.get(key, value) for key, value in _STAND_INS.items()} | data
        try:
            return read_model(replace(document, data=data), CampaignFile), lost
        except InputError as error:
            found = error
    raise refusal


def _is_key(part: str | int) -> bool:
    return isinstance(part, str)


def _leave_out(data: Any, path: KeyPath) -> None:
    for key in path[:-1]:
        data = data.get(key) if isinstance(data, dict) else None
    if isinstance(data, dict):
        data.pop(path[-1], None)


def _may_hold_for_all(key: str | int) -> bool:
    """Return whether a key at the top may be meant to say what scenarios are made of."""
    known = CampaignFile.model_fields.keys()
    slots = SlotsText.model_fields.keys() - known
    return key == "defaults" or (key not in known and bool(closest(str(key), {*slots, "defaults"})))


def _named_bases(name: str, text: CampaignFile) -> Iterator[str | None]:
    """Yield the scenarios that one and those that it is like name, there or not."""
    for one in (name, *bases_of(name, text)):
        yield text.scenarios[one].like


def _without_base(name: str, text: CampaignFile, document: YamlDocument) -> ResolvedScenario:
    """Return what a scenario says itself, where that which it is like is not to be had."""
    alone = text.scenarios[name].model_copy(update={"like": None})
    rest = text.model_copy(update={"scenarios": {name: alone}})
    try:
        return resolve_scenario(name, rest, document)
    except InputError:
        return ResolvedScenario(name, document.where(("scenarios", name)))
