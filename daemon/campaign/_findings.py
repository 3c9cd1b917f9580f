"""Findings about a campaign, each once: of the pre-flight, and about unused parts."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final

from daemon.campaign._file import CampaignFile
from daemon.campaign._layers import CampaignCell, Draft
from daemon.campaign._parameter_files import ParameterValues
from daemon.campaign._scenarios import LayerReference
from daemon.judging.statistics import CONFIDENCE, at_least
from daemon.model.assessments import RepeatPolicy
from daemon.model.spec import SutReference
from daemon.stacks.findings import ParameterFinding, ParameterLocation, format_path
from daemon.stacks.registry import stack_kind
from grammars.oracle import Reached, RunOutline, check_bounds, check_spots, signal_declaration
from grammars.preflight import check_limit, check_map, check_robot, check_run, check_scene
from grammars.scenery import unused_groups, unused_parameters
from grammars.scenery.composition import Catalogue
from grammars.text.diagnostics import Finding, InputError, Severity, Where
from grammars.text.documents import YamlDocument
from grammars.text.sources import not_recording, read_text

_SIZE: Final = re.compile(r"-?\d+\.\d+")
"""A length or an angle in a message; numbers in names of objects have no decimal point."""


@dataclass(frozen=True, slots=True)
class AllowedWarning:
    """Warnings that a campaign file allows: a ``pattern`` of their messages, and ``why``."""

    pattern: str
    why: str
    where: Where

    def covers(self, finding: Finding) -> bool:
        """Return whether a finding is such a warning; errors are never allowed."""
        return finding.severity is Severity.WARNING and fnmatchcase(finding.message, self.pattern)


def allowed_warnings(text: CampaignFile, document: YamlDocument) -> tuple[AllowedWarning, ...]:
    """Return the warnings that a campaign file allows."""
    # Only the star is a wildcard: messages are full of brackets.
    return tuple(
        AllowedWarning(
            one.warning.replace("[", "[[]").replace("?", "[?]"),
            one.why,
            document.where(("allow", index, "warning")),
        )
        for index, one in enumerate(text.allow)
    )


def without_allowed(
    findings: Iterable[Finding], allowed: Sequence[AllowedWarning]
) -> tuple[list[Finding], list[Finding]]:
    """Return the findings to report, and the allowed warnings.

    Of warnings that differ only in sizes the first is reported, and allowing it allows all.
    """
    remaining: list[Finding] = []
    covered: list[Finding] = []
    for first, *others in _alike(findings):
        if any(each.covers(first) for each in allowed):
            covered += [first, *others]
            continue
        remaining.append(first)
        for one in others:
            (covered if any(each.covers(one) for each in allowed) else remaining).append(one)
    return remaining, covered


def find_unmet(
    allowed: Sequence[AllowedWarning], covered: Sequence[Finding]
) -> tuple[Finding, ...]:
    """Return a warning for each line of ``allow`` that matches no warning any more, or all."""
    doubts = []
    for one in allowed:
        if not any(map(one.covers, covered)):
            hint = "leave it out, or write the warning as `scenario check` says it"
            doubts.append(_warning(one.where, "no warning is like this one", hint))
        elif not one.pattern.strip("* "):
            doubts.append(_warning(one.where, "this allows every warning", "write the text of one"))
    return tuple(doubts)


def find_problems(cells: Sequence[CampaignCell]) -> list[Finding]:
    """Return the findings of the pre-flight about the scenes of ``cells`` and their runs."""
    problems: list[Finding] = []
    # Scenarios that differ only in behaviours or mission share a scene, which is checked once.
    for cell in {id(cell.scene): cell for cell in cells}.values():
        problems.extend(check_scene(cell.scene, places=cell.places))
    systems = {id(sut): sut for cell in cells for sut in cell.suts}
    settings = {
        key: stack_kind(sut.kind).read(sut.local_parameters) for key, sut in systems.items()
    }
    problems.extend(_advise(cells, settings))
    for cell in cells:
        problems.extend(_problems_of(cell, settings))
    return problems


def _advise(cells: Iterable[CampaignCell], settings: Mapping[int, Any]) -> Iterator[Finding]:
    """Yield the warnings of kinds of systems about robots and missions, each once.

    ``settings`` go by the identity of the system.
    """
    once: dict[tuple[int, ...], tuple[SutReference, CampaignCell]] = {}
    for cell in cells:
        for sut in cell.suts:
            # The library hands out each layer once. One name may have other values in a scenario.
            once.setdefault((id(sut), id(cell.robot), id(cell.mission)), (sut, cell))
    found: set[tuple[str, ParameterFinding]] = set()
    for sut, cell in once.values():
        kind = stack_kind(sut.kind)
        for finding in kind.advise(settings[id(sut)], cell.robot, cell.mission):
            if (sut.name, finding) in found:
                continue
            found.add((sut.name, finding))
            place = "" if kind.keys else f" {format_path(finding.path)}:"
            message = f"{sut.name}:{place} {finding.message}"
            home = cell.places[f"sut {sut.name}"]
            where = _value_place(cell.sut_values[sut.name], finding.path, home)
            yield Finding(where, message, finding.hint, Severity.WARNING)


def _value_place(values: ParameterValues, path: ParameterLocation, home: Where) -> Where:
    """Return the place of the value at ``path``, ``home`` if no file has it.

    Flat files of costmaps have the values of layers, and move_base those of costmaps.
    """
    names = tuple(map(str, path))
    for each in (names, (*names[:2], *names[3:]), (names[0], names[-1])):
        if each in values:
            return values[each].where
    return home


def _unrecorded(cell: CampaignCell) -> Iterator[Finding]:
    """Yield the signals of oracles that a system's runs do not record."""
    read = ((oracle, signal) for oracle in cell.oracles for signal in oracle.signals())
    for (oracle, signal), sut in itertools.product(read, cell.suts):
        declared = signal_declaration(signal.name)
        if declared is None or not declared.report or declared.report in sut.recorded:
            continue
        where = oracle.place(signal.column)
        if "record" in stack_kind(sut.kind).keys:
            message = f"{signal.name} is unknown for {sut.name}, which does not record it"
            yield Finding(where, message, f"write record: [{declared.report}] in its file")
        else:
            message = f"{signal.name} is unknown for {sut.name}: the oracle is inconclusive there"
            hint = f"no system of kind {sut.kind} has a {declared.report}"
            yield Finding(where, message, hint, Severity.WARNING)


def _finer_than_systems(cell: CampaignCell, settings: Mapping[int, Any]) -> Iterator[Finding]:
    """Yield the oracles that ask for waypoints nearer than a system drives to them."""
    for oracle, sut in itertools.product(cell.oracles, cell.suts):
        kind = stack_kind(sut.kind)
        if isinstance(oracle.judgement, Reached):
            asked = oracle.judgement.tolerance.value
            stops = kind.tolerance(settings[id(sut)])
            if asked < stops:
                message = (
                    f"{oracle.name} asks for waypoints within {asked:g} m, {sut.name} stops "
                    f"within {stops:g} m"
                )
                hint = "use a larger tolerance, or a finer one of the system"
                yield Finding(oracle.where, message, hint, Severity.WARNING)


def find_doubts(draft: Draft, policy: RepeatPolicy) -> Iterator[Finding]:
    """Yield warnings about values of a campaign file that make it say nothing."""
    text, where, n = draft.text, draft.document.where, policy.at_most
    if policy.rule == "rate" and (shown := at_least(n, n)) < policy.rate:
        message = f"{n} repeats show a rate of {shown:.0%} at best, {policy.rate:.0%} are asked"
        enough = math.ceil(math.log(1.0 - CONFIDENCE) / math.log(policy.rate))
        yield _warning(where(("repeats",)), message, f"write n: {enough} or more")
    if text.gate is not None and text.gate.worse_by > 1.0:
        message = f"worse-by: {text.gate.worse_by:g} allows results {text.gate.worse_by:.0%} worse"
        yield _warning(where(("gate", "worse-by")), message, f"write {text.gate.worse_by:g} %")
    first: dict[Any, CampaignCell] = {}
    for cell in draft.cells:
        if cell.oracles and all(oracle.is_measure for oracle in cell.oracles):
            message = f"nothing in {cell.name} can fail: its oracles are measures"
            yield _warning(cell.scenario.where, message, "name an oracle with a limit")
        content = (
            cell.scene.digest, cell.mission, cell.robot, cell.suts, cell.behaviours, cell.map,
            cell.limit, tuple(oracle.name for oracle in cell.oracles),
        )  # fmt: skip
        other = first.setdefault(repr(content), cell)
        if other is not cell:
            message = f"scenario {cell.name} is the same as {other.name}"
            yield _warning(cell.scenario.where, message, "change something in it, or leave it out")


def _warning(where: Where, message: str, hint: str) -> Finding:
    return Finding(where, message, hint, Severity.WARNING)


def _problems_of(cell: CampaignCell, settings: Mapping[int, Any]) -> Iterable[Finding]:
    if cell.given_map is not None and cell.scenario.map_file is not None:
        yield from check_map(
            cell.given_map,
            cell.scene,
            cell.mission,
            laser_height=cell.robot.laser.z,
            where=cell.scenario.map_file.where,
            places=cell.places,
        )
    yield from check_robot(cell.robot, cell.scene, cell.robot_file.where)
    yield from _unrecorded(cell)
    yield from _finer_than_systems(cell, settings)
    speeds = {
        sut.name: stack_kind(sut.kind).top_speed(settings[id(sut)], cell.robot) for sut in cell.suts
    }
    stays = [waypoint.id for waypoint in cell.mission.waypoints if waypoint.wait]
    for sut in cell.suts if stays else ():
        mode = getattr(settings[id(sut)], "mission", "waypoints")
        if mode != "waypoints":
            message = f"{sut.name} gets all waypoints at once (mission: {mode}) and does not wait"
            yield Finding(cell.places[stays[0]], message, "write mission: waypoints in its file")
    run = RunOutline(
        cell.scene,
        cell.robot,
        cell.mission,
        cell.limit,
        max(speeds.values(), default=math.inf),
        cell.behaviours[0],
    )
    for oracle in cell.oracles:
        yield from check_bounds(oracle, run)
        yield from check_spots(oracle, run)
    yield from check_limit(cell.mission, speeds, limit=cell.limit, where=cell.limit_where)
    for behaviours in dict.fromkeys(cell.behaviours):
        yield from check_run(
            cell.scene,
            cell.robot,
            cell.mission,
            behaviours,
            limit=cell.limit,
            where=cell.mission_where,
            places=cell.places,
        )


def find_unused(draft: Draft) -> list[Finding]:
    """Return warnings about oracles, parameters, groups and their members that no run uses."""
    layers = dict.fromkeys(layer for cell in draft.cells for layer in cell.layers)
    warnings = (
        *(finding for layer in layers for finding in unused_parameters(layer)),
        *_missing_members(draft.cells),
        *_unused_oracles(draft),
        *_unused_groups(draft.cells),
    )
    return list(dict.fromkeys(warnings))


def _unused_oracles(draft: Draft) -> Iterator[Finding]:
    used = {reference.name for s in draft.scenarios.values() for reference in s.oracles}
    for index, name in enumerate(draft.text.oracles or []):
        where = draft.document.where(("oracles", index))
        oracles = draft.library.oracles((LayerReference(name, {}, where),))
        if used.isdisjoint(oracles):
            message = f"no scenario uses an oracle of {name}"
            hint = f"its oracles: {', '.join(oracles)}; each scenario picks some: oracles: […]"
            yield Finding(where, message, hint, Severity.WARNING)
            continue
        # An unused measure is harmless; an unused limit was probably forgotten.
        idle = [o for o in oracles.values() if not o.is_measure and o.name not in used]
        if idle and not _is_shared(name, Path(draft.document.file)):
            for oracle in idle:
                hint = f"name it in a scenario (oracles: [{oracle.name}]), or leave it out"
                message = f"no scenario uses the oracle {oracle.name}"
                yield Finding(oracle.where, message, hint, Severity.WARNING)


def _is_shared(layer: str, campaign: Path) -> bool:
    """Return whether other campaigns may use a layer too.

    This is so if it lies elsewhere, or if another campaign beside this one names it.
    """
    if "/" in layer or not any(campaign.parent.glob(f"{layer}*")):
        return True
    word = re.compile(rf"(?<![\w.-]){re.escape(layer)}(?![\w-])")
    others = (p for p in campaign.parent.glob("*.y*ml") if p.name != campaign.name)
    return any(
        re.search(r"^campaign\s*:", text, re.MULTILINE) and word.search(text)
        for text in map(_text_of, others)
    )


def _text_of(path: Path) -> str:
    try:
        # The names in other campaigns decide only about a warning; no run depends on them.
        with not_recording():
            return read_text(path)
    except InputError:
        # A folder or a pipe with such a name is not a campaign.
        return ""


def _unused_groups(cells: Sequence[CampaignCell]) -> Iterator[Finding]:
    """Yield groups that no cell with their layer uses."""
    for layer in {layer.file: layer for cell in cells for layer in cell.layers}.values():
        beside = [c.layers for c in cells if any(other.file == layer.file for other in c.layers)]
        yield from unused_groups(layer, [other for layers in beside for other in layers])


def _missing_members(cells: Iterable[CampaignCell]) -> Iterator[Finding]:
    """Yield members of groups that are missing in every cell with their layer."""
    stacks = dict.fromkeys(cell.layers for cell in cells)
    missing = {layers: Catalogue(layers).unknown_members() for layers in stacks}
    for problem in dict.fromkeys(p for problems in missing.values() for p in problems):
        file = problem.where.file
        with_it = [layers for layers in stacks if any(layer.file == file for layer in layers)]
        # Another scenario may have the members that this one lacks.
        if all(problem in missing[layers] for layers in with_it):
            yield problem


def say_once(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the first of each group of findings that differ only in sizes."""
    return tuple(_with_count(first, len(others)) for first, *others in _alike(findings))


def _alike(findings: Iterable[Finding]) -> Iterable[list[Finding]]:
    """Return the findings in groups that differ only in sizes, each finding once."""
    # The same door may be too narrow by another centimetre in another variant of a plan.
    groups: dict[tuple[object, ...], list[Finding]] = {}
    for one in dict.fromkeys(findings):
        key = (one.where, one.severity, _SIZE.sub("#", one.message))
        groups.setdefault(key, []).append(one)
    return groups.values()


def _with_count(first: Finding, others: int) -> Finding:
    """Add the number of others to the hint, because people copy the message into ``allow``."""
    if not others:
        return first
    count = f"{others} more like it, with other sizes"
    return replace(first, hint=f"{first.hint}; {count}" if first.hint else count)
