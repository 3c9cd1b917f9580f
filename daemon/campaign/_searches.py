"""Searches of a campaign file, checked before the first run: parameters and their bounds.

Each finding has its place in the file. :mod:`daemon.search.preparation` checks composed points,
such as a door that does not fit any more.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

from daemon.campaign._layers import CampaignCell, Draft
from daemon.campaign._search_file import SearchText, read_budget, read_confirm, read_stop
from daemon.campaign._search_values import (
    LayerValue,
    SearchLayer,
    find_value,
    search_layers,
    step_of,
)
from daemon.model.search import ANY, OracleScale, PointValue, SearchParameter, SearchTask
from daemon.model.spec import SutReference
from grammars.model.robot import Robot
from grammars.oracle import Oracle
from grammars.text.diagnostics import Finding, InputError, Severity, Where, did_you_mean
from grammars.text.documents import KeyPath
from grammars.text.expression_check import read_predicate

_LONGEST_NAMES: Final = 88
"""Most characters of the names of a campaign and its search together: both are part of an id."""
LEAST_CONFIRMED: Final = 3
"""Least repeats of a failure of a system that is not repeatable: one run of it shows little."""


def read_searches(draft: Draft) -> tuple[tuple[SearchTask, ...], tuple[Finding, ...]]:
    """Return the usable searches of a campaign, and all findings about them."""
    tasks: list[SearchTask] = []
    findings: list[Finding] = []
    warnings = len(draft.library.warnings)
    for name, text in draft.text.search.items():
        reader = _SearchReader(name, text, draft)
        task = reader.read()
        findings += reader.findings
        if task is not None:
            tasks.append(task)
    # These layers were loaded with values that no scenario has.
    del draft.library.warnings[warnings:]
    return tuple(tasks), tuple(findings)


@dataclass(slots=True)
class _SearchReader:
    """Reader of one search, which collects all findings about it."""

    name: str
    text: SearchText
    draft: Draft
    findings: list[Finding] = field(default_factory=list)

    def read(self) -> SearchTask | None:
        """Return the search, ``None`` without a usable scenario or system."""
        self._check_names()
        cell = self._cell()
        if cell is None:
            return None
        sut = self._sut(cell)
        minimised = self._minimised(cell)
        if sut is None:
            return None
        layers = search_layers(self.draft.library, cell.scenario, cell.suts.index(sut))
        parameters = self._parameters(layers, cell)
        constraints = self._constraints(parameters)
        runs, seconds = read_budget(self.text.budget)
        stop, failures = read_stop(self.text.stop)
        return SearchTask(
            name=self.name,
            scenario=self.text.scenario,
            sut=sut.name,
            minimise=self.text.minimise,
            scales=_scales(minimised, cell.robot),
            parameters=parameters,
            constraints=constraints,
            runs=runs,
            seconds=seconds,
            stop=stop,
            failures=failures,
            method=self.text.method,
            confirm=self._confirm(sut),
            then=tuple(step for step in ("nearest", "shrink") if step in self.text.then),
            window=self.text.window,
            seed=self.draft.text.seed if self.text.seed is None else self.text.seed,
            repeatable=sut.repeatable,
            about=self.text.about,
        )

    def _at(self, *key: str | int) -> Where:
        path: KeyPath = ("search", self.name, *key)
        return self.draft.document.where(path)

    def _error(self, where: Where, message: str, hint: str = "") -> None:
        self.findings.append(Finding(where, message, hint))

    def _warn(self, where: Where, message: str, hint: str = "") -> None:
        self.findings.append(Finding(where, message, hint, Severity.WARNING))

    def _check_names(self) -> None:
        campaign = self.draft.text.campaign
        if len(campaign) + len(self.name) > _LONGEST_NAMES:
            message = f'the names "{campaign}" and "{self.name}" are too long together'
            self._error(self._at(), message, f"{_LONGEST_NAMES} characters at most")
        if self.name in self.draft.text.scenarios:
            message = f'there is a scenario "{self.name}": tables could not tell them apart'
            self._error(self._at(), message, "give the search another name")

    def _cell(self) -> CampaignCell | None:
        """Return the cell of the scenario, ``None`` after an error."""
        scenario, where = self.text.scenario, self._at("scenario")
        instead = "search a scenario that is like it"
        self.findings += self.draft.check_scenario(scenario, where, instead)
        cells = [cell for cell in self.draft.cells if cell.scenario.name == scenario]
        if len(cells) > 1:
            message = f"{scenario} is run in {len(cells)} buildings, a search takes one"
            hint = "search a scenario like it with: vary: {…, samples: 1}, or with a floorplan"
            self._error(where, message, hint)
            return None
        return cells[0] if cells else None

    def _sut(self, cell: CampaignCell) -> SutReference | None:
        name = self.text.sut
        if not name:
            return cell.suts[0]
        for reference, sut in zip(cell.scenario.suts, cell.suts, strict=True):
            if name in (sut.name, reference.name):
                return sut
        message = f'{cell.name} is not run with a system under test "{name}"'
        hint = did_you_mean(name, [sut.name for sut in cell.suts])
        self._error(self._at("sut"), message, hint)
        return None

    def _confirm(self, sut: SutReference) -> int:
        confirm = read_confirm(self.text.confirm)
        if sut.repeatable or confirm >= LEAST_CONFIRMED:
            return confirm
        message = f"{sut.name} is not repeatable: its failures are run {LEAST_CONFIRMED} times"
        self._warn(self._at("confirm"), message, f"write confirm: {LEAST_CONFIRMED} repeats")
        return LEAST_CONFIRMED

    def _minimised(self, cell: CampaignCell) -> tuple[Oracle, ...]:
        """Return the oracles to minimise, empty after an error."""
        names = set(cell.scenario.oracle_names)
        oracles = {oracle.name: oracle for oracle in cell.oracles if oracle.name in names}
        limited = [oracle for oracle in oracles.values() if not oracle.is_measure]
        name, where = self.text.minimise, self._at("minimise")
        if name in oracles:
            return tuple(o for o in (oracles[name],) if self._leads(o, Severity.ERROR))
        if name == ANY:
            usable = tuple(oracle for oracle in limited if self._leads(oracle, Severity.WARNING))
            if not usable:
                message = f"{cell.name} has no oracle with a limit that a search can follow"
                self._error(where, message, "such as always(clearance >= 0.05 m)")
            return usable
        if name in self.draft.oracles:
            hint = f"add {name} to the oracles: of the scenario"
        else:
            hint = did_you_mean(name, (*(oracle.name for oracle in limited), ANY))
        self._error(where, f'{cell.name} is not judged by an oracle "{name}"', hint)
        return ()

    def _leads(self, oracle: Oracle, severity: Severity) -> bool:
        """Return whether a search can follow an oracle; report the reason and a remedy if not."""
        # Only campaigns with a search load the code of judging.
        from daemon.judging.leading_kind import why_flat

        where = self._at("minimise")
        try:
            flat = why_flat(oracle)
        except ValueError as error:
            self.findings.append(Finding(where, f"{oracle.name}: {error}", "", severity))
            return False
        if flat is not None:
            reason, better = flat
            ignored = ", it is ignored" if severity is Severity.WARNING else ""
            message = f"a search cannot follow {oracle.name}{ignored}: {reason}"
            hint = f"write an oracle that leads to the failure, such as {better}"
            self.findings.append(Finding(where, message, hint, severity))
        return flat is None

    def _parameters(
        self, layers: Sequence[SearchLayer], cell: CampaignCell
    ) -> tuple[SearchParameter, ...]:
        parameters: list[SearchParameter] = []
        names: dict[tuple[str, int, str], str] = {}
        for name, over in self.text.over.items():
            where = self._at("over", name)
            try:
                layer, value = find_value(name, layers, where, cell)
                place = (layer.slot, layer.index, value.key)
                if place in names:
                    raise InputError.at(where, f"{name} and {names[place]} are the same value")
                names[place] = name
                parameters.append(self._parameter(name, layer, value, over))
            except InputError as error:
                self.findings += error.findings
        return tuple(parameters)

    def _parameter(
        self, name: str, layer: SearchLayer, value: LayerValue, over: SearchParameter
    ) -> SearchParameter:
        """Return a parameter after the layer has accepted both ends, or every choice.

        Raises :class:`InputError` with the errors of the layer.
        """
        where = self._at("over", name)
        # Without the folder, the identity of a search does not depend on the place of its files.
        place = f"{Path(where.file).name}:{where.line}"
        over = replace(
            over, name=name, slot=layer.slot, index=layer.index, key=value.key, where=place
        )
        if over.choices:
            return self._choices(over, layer, value, where)
        if isinstance(value.value, str):
            message = f"{name} is not a number: {value.text or 'a word'} cannot be in a range"
            raise InputError.at(where, message, "write a list of choices: [a, b]")
        for end in (over.low, over.high):
            layer.changed(value.key, over.override(end), where)
        # Plain numbers have the unit of the layer.
        unit, whole = over.unit or value.unit, over.whole and value.whole
        number = value.in_unit(unit)
        step = step_of(over.low, over.high, unit, log=over.log, whole=whole)
        parameter = replace(over, unit=unit, whole=whole, step=step, written=number)
        if number is not None and not over.low <= number <= over.high:
            message = f"{name} is {parameter.text(number)} as written"
            self._warn_of_start(where, f"{message}, outside of the range", value)
        return parameter

    def _choices(
        self, over: SearchParameter, layer: SearchLayer, value: LayerValue, where: Where
    ) -> SearchParameter:
        choices: dict[float | str | None, PointValue] = {}
        for choice in over.choices:
            changed = layer.changed(value.key, over.override(choice), where)
            other = choices.setdefault(changed.identity if changed else None, choice)
            if other != choice:
                message = f"{over.name}: {other} and {choice} are the same value"
                raise InputError.at(where, message, "leave one of them out")
        number = None if isinstance(over.choices[0], str) else value.in_unit("")
        original = choices.get(value.identity, value.text or None if number is None else number)
        if original is not None and original not in over.choices:
            message = f"{over.name} is {original} as written, which is not among the choices"
            self._warn_of_start(where, message, value)
        return replace(over, written=original)

    def _warn_of_start(self, where: Where, message: str, value: LayerValue) -> None:
        hint = f"at {value.where}; the first run is still the scenario as written"
        self._warn(where, message, hint)

    def _constraints(self, parameters: Sequence[SearchParameter]) -> tuple[str, ...]:
        """Return the readable conditions on every run, as written."""
        constraints: list[str] = []
        if len(parameters) < len(self.text.over):
            return ()  # they may name an unreadable parameter
        words = [p.name for p in parameters if any(isinstance(one, str) for one in p.choices)]
        units = {p.name: p.unit for p in parameters if p.name not in words}
        pattern = "|".join(map(re.escape, words))
        for index, text in enumerate(self.text.such_that):
            where = self._at("such that", index)
            listed = re.search(rf"(?<![\w./])(?<!\w-)(?:{pattern})(?![\w./-])", text)
            if words and listed:
                message = f'"{text}": {listed[0]} is a list of words, which cannot be compared'
                self._error(where, message, "write a range, or plain numbers in the list")
                continue
            try:
                read_predicate(text, units, where)
            except InputError as error:
                self.findings += error.findings
            else:
                constraints.append(text)
        return tuple(constraints)


def _scales(oracles: Sequence[Oracle], robot: Robot) -> tuple[OracleScale, ...]:
    from daemon.judging.leading_kind import oracle_scale

    return tuple(oracle_scale(oracle, robot) for oracle in oracles)
