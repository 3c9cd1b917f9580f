"""From sentences about results to what the campaign declares, checked against what it runs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Final

from daemon.campaign._file import CampaignFile, ExpectText, repeat_policy
from daemon.campaign._references import KnownQuantities, read_references
from daemon.campaign._scenarios import ResolvedScenario
from daemon.model.assessments import (
    DELAY,
    DURATION,
    AssessmentRules,
    Expectation,
    RegressionGate,
    ScenarioComparison,
)
from grammars.model.mission import Mission
from grammars.oracle import Leg, Oracle, leg_number, parse_oracle, unit_of
from grammars.text.diagnostics import Diagnostic, InputError, Where, did_you_mean
from grammars.text.documents import YamlDocument
from grammars.text.quantity import parse_in

# A sentence and not keys of YAML: a value that begins with ">" or "<" means something else there.
_NAME: Final = r"[A-Za-z0-9][A-Za-z0-9._-]*"
_SENTENCE: Final = re.compile(
    rf"\s*(?P<quantity>{_NAME})\s*\(\s*(?P<left>{_NAME})\s+vs\s+(?P<right>{_NAME})"
    rf"(?:\s+on\s+leg\s+(?P<leg>{_NAME}|\"[^\"]*\"))?\s*\)\s*(?P<op><=|>=|<|>)\s*(?P<limit>.+?)\s*"
)
_EXAMPLE: Final = "write it as delay(S3.2 vs S3.5) <= 30 s, or delay(A vs B on leg door) <= 1 min"


@dataclass(frozen=True, slots=True)
class DeclarationScope:
    """What sentences may speak of: concrete scenarios, the oracles that judge each, the file."""

    text: CampaignFile
    document: YamlDocument
    scenarios: Mapping[str, ResolvedScenario]
    oracles: Mapping[str, Oracle]

    def judged_by(self, scenario: str) -> tuple[str, ...]:
        """Return the names of a scenario's oracles."""
        return tuple(reference.name for reference in self.scenarios[scenario].oracles)

    def suts_of(self, scenario: str) -> tuple[str, ...]:
        """Return the names of a scenario's systems under test."""
        return tuple(reference.name for reference in self.scenarios[scenario].suts)


def read_declarations(scope: DeclarationScope) -> tuple[AssessmentRules, list[Diagnostic]]:
    """Return what the campaign declares, and everything that is wrong with how it says it."""
    problems: list[Diagnostic] = []
    comparisons: list[ScenarioComparison] = []
    for name, sentence in scope.text.compare.items():
        try:
            comparisons.append(_comparison(name, sentence, scope))
        except InputError as error:
            problems.extend(error.diagnostics)
    names = tuple(scope.text.compare)
    expectations = []
    for index, written in enumerate(scope.text.expect):
        path = ("expect", index)
        problems.extend(_unmatched_expectation(written, path, names, scope))
        where = scope.document.where(path)
        expectations.append(
            Expectation(
                written.scenario,
                written.oracle,
                tuple(written.sut),
                written.verdict,
                written.why,
                f"{Path(where.file).name}:{where.line}",
            )
        )
    known = _known_quantities(comparisons, scope)
    references, wrong = read_references(scope.text.reference, scope.document, known)
    gate = scope.text.gate
    declared = AssessmentRules(
        repeat_policy(scope.text.repeats),
        tuple(comparisons),
        tuple(expectations),
        RegressionGate(gate.baseline, gate.worse_by) if gate else None,
        references,
    )
    return declared, problems + wrong


def _known_quantities(
    comparisons: Sequence[ScenarioComparison], scope: DeclarationScope
) -> KnownQuantities:
    units = {name: unit_of(o) if o.is_measure else None for name, o in scope.oracles.items()}
    # Every run has a duration, whether an oracle of that name measures it or not.
    return KnownQuantities(
        {name: (*scope.judged_by(name), DURATION) for name in scope.scenarios},
        {name: scope.suts_of(name) for name in scope.scenarios},
        {DURATION: "s"} | units,
        {comparison.name: comparison.unit for comparison in comparisons},
    )


@dataclass(frozen=True, slots=True)
class LegTimings:
    """The comparisons of a scenario, some of which need one of its legs timed."""

    comparisons: tuple[ScenarioComparison, ...]
    document: YamlDocument

    def _legs(self) -> Iterator[tuple[str, str, Where]]:
        """Yield name of the measure, leg, and place of each comparison that is about one."""
        for comparison in self.comparisons:
            if comparison.leg is not None:
                where = _sentence_place(comparison.name, self.document)
                yield comparison.measure, comparison.leg, where

    def measures(self) -> tuple[Oracle, ...]:
        """Return the measures that time legs, each once."""
        found = {name: _leg_measure(name, leg, where) for name, leg, where in self._legs()}
        return tuple(found.values())

    def problems(self, mission: Mission) -> list[Diagnostic]:
        """Return what is wrong with the legs in the scenario's mission."""
        found = []
        for _, leg, where in self._legs():
            number = int(leg) if leg.isdigit() else 0
            try:
                leg_number(Leg(number, "" if number else leg), mission)
            except ValueError as error:
                found.append(Diagnostic(where, str(error)))
        return found


def _leg_measure(name: str, leg: str, where: Where) -> Oracle:
    plain = leg.isdigit() or re.fullmatch(r"[A-Za-z_][A-Za-z0-9_-]*", leg)
    written = leg if plain else f'"{leg}"'
    return parse_oracle(name, f"max(mission.leg.elapsed) on leg {written}", where)


def _sentence_place(name: str, document: YamlDocument) -> Where:
    """Return where the sentence of a comparison begins: after its key, when on the same line."""
    # YAML knows where keys and list items stand, not where a value in the middle of a line does;
    # a complaint about "S3.5" is to point at it.
    key, text = document.where(("compare", name)), document.data["compare"][name]
    lines = document.text.splitlines()
    line = lines[key.line - 1] if 0 < key.line <= len(lines) else ""
    column = line.find(str(text), key.column)
    return Where(key.file, key.line, column + 1) if column >= 0 else key


def _comparison(name: str, sentence: str, scope: DeclarationScope) -> ScenarioComparison:
    where = _sentence_place(name, scope.document)
    found = _SENTENCE.fullmatch(sentence)
    if found is None:
        raise InputError(Diagnostic(where, f'"{sentence}" is not a comparison', _EXAMPLE))

    def at(part: str) -> Where:
        return Where(where.file, where.line, where.column + found.start(part))

    left, right, quantity = found["left"], found["right"], found["quantity"]
    problems = [d for part in ("left", "right") for d in _unknown(found[part], at(part), scope)]
    if problems:
        raise InputError(problems)
    if left == right:
        raise InputError(Diagnostic(at("right"), f'"{left}" is compared with itself'))
    # Paired by repeat and system under test, so without one in common there is no pair at all.
    if not set(scope.suts_of(left)) & set(scope.suts_of(right)):
        message = f'"{left}" and "{right}" have no system under test in common'
        raise InputError(Diagnostic(at("left"), message))
    leg = found["leg"].strip('"') if found["leg"] else None
    if leg is not None and quantity != DELAY:
        message = f'"on leg" goes with delay; let the measure "{quantity}" say "on leg {leg}"'
        raise InputError(Diagnostic(at("leg"), message))
    unit = "s" if quantity == DELAY else _unit(quantity, at("quantity"), (left, right), scope)
    limit = parse_in(found["limit"], unit, quantity, at("limit"))
    return ScenarioComparison(
        name=name,
        quantity=quantity,
        left=left,
        right=right,
        leg=leg,
        op=found["op"],  # type: ignore[arg-type]
        limit=limit,
        unit=unit,
        text=" ".join(sentence.split()),
        measure="" if leg is None else f"elapsed-on-leg-{leg}",
    )


def _unknown(name: str, where: Where, scope: DeclarationScope) -> Iterator[Diagnostic]:
    if name in scope.scenarios:
        return
    if name in scope.text.scenarios:
        hint = "compare scenarios that are like it"
        yield Diagnostic(where, f'scenario "{name}" is abstract, it is never run', hint)
        return
    yield Diagnostic(where, f'no scenario "{name}" here', did_you_mean(name, scope.scenarios))


def _unit(quantity: str, where: Where, scenarios: tuple[str, str], scope: DeclarationScope) -> str:
    """Return the unit of a measure that both scenarios have; raises :class:`InputError`."""
    measures = [name for name, oracle in scope.oracles.items() if oracle.is_measure]
    oracle = scope.oracles.get(quantity)
    if oracle is None:
        hint = did_you_mean(quantity, [DELAY, *measures])
        raise InputError(Diagnostic(where, f'no measure "{quantity}"', hint))
    if not oracle.is_measure:
        hint = f"compare one of: {', '.join([DELAY, *measures])}"
        raise InputError(Diagnostic(where, f'"{quantity}" has a limit, it is no measure', hint))
    for scenario in scenarios:
        if quantity not in scope.judged_by(scenario):
            hint = f"add it to the oracles of {scenario}"
            raise InputError(Diagnostic(where, f'"{scenario}" does not measure {quantity}', hint))
    return unit_of(oracle)


def _unmatched_expectation(
    written: ExpectText,
    path: tuple[str, int],
    comparisons: Sequence[str],
    scope: DeclarationScope,
) -> Iterator[Diagnostic]:
    """Yield what an expectation speaks of that is not there."""
    scenarios = _matching(written.scenario, scope.scenarios)
    if not scenarios:
        where = scope.document.where((*path, "scenario"))
        hint = did_you_mean(written.scenario, scope.scenarios)
        yield Diagnostic(where, f'no scenario "{written.scenario}" to expect anything of', hint)
        return
    # An expectation that matches nothing would hide a failure for ever once a name is changed.
    names = dict.fromkeys(n for s in scenarios for n in scope.judged_by(s))
    oracles = _matching(written.oracle, (*names, *comparisons))
    where = scope.document.where((*path, "oracle"))
    if not oracles:
        hint = did_you_mean(written.oracle, (*names, *comparisons))
        yield Diagnostic(where, f'no oracle "{written.oracle}" judges {written.scenario}', hint)
    elif all(n in scope.oracles and scope.oracles[n].is_measure for n in oracles):
        yield Diagnostic(where, f'"{written.oracle}" is a measure, it has no verdict')
    suts = dict.fromkeys(n for s in scenarios for n in scope.suts_of(s))
    for index, pattern in enumerate(written.sut):
        if not _matching(pattern, suts):
            where = scope.document.where((*path, "sut", index))
            hint = did_you_mean(pattern, suts)
            yield Diagnostic(where, f'no system under test "{pattern}" there', hint)


def _matching(pattern: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if fnmatchcase(name, pattern)]
