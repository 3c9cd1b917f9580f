"""From sentences about results to what the campaign declares, checked against what it runs."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Final

from daemon.campaign._cells import CampaignCell, Draft
from daemon.campaign._file import ExpectText, repeat_policy
from daemon.campaign._references import KnownQuantities, read_references
from daemon.model.assessments import (
    DELAY,
    DURATION,
    AssessmentRules,
    Expectation,
    RegressionGate,
    ScenarioComparison,
)
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


def read_declarations(draft: Draft) -> tuple[AssessmentRules, list[Diagnostic]]:
    """Return what the campaign declares, and everything that is wrong with how it says it."""
    problems: list[Diagnostic] = []
    comparisons: list[ScenarioComparison] = []
    for name, sentence in draft.text.compare.items():
        try:
            comparisons.append(_comparison(name, sentence, draft))
        except InputError as error:
            problems.extend(error.diagnostics)
    names = tuple(draft.text.compare)
    expectations = []
    for index, written in enumerate(draft.text.expect):
        path = ("expect", index)
        problems.extend(_unmatched_expectation(written, path, names, draft))
        where = draft.document.where(path)
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
    known = _known_quantities(comparisons, draft)
    references, wrong = read_references(draft.text.reference, draft.document, known)
    gate = draft.text.gate
    declared = AssessmentRules(
        repeat_policy(draft.text.repeats),
        tuple(comparisons),
        tuple(expectations),
        RegressionGate(gate.baseline, gate.worse_by) if gate else None,
        references,
    )
    return declared, problems + wrong


def _known_quantities(comparisons: Sequence[ScenarioComparison], draft: Draft) -> KnownQuantities:
    units = {name: unit_of(o) if o.is_measure else None for name, o in draft.oracles.items()}
    scenarios = draft.scenarios.items()
    # Every run has a duration, whether an oracle of that name measures it or not.
    return KnownQuantities(
        {name: (*scenario.oracle_names, DURATION) for name, scenario in scenarios},
        {name: scenario.sut_names for name, scenario in scenarios},
        {DURATION: "s"} | units,
        {comparison.name: comparison.unit for comparison in comparisons},
    )


def time_legs(
    cell: CampaignCell, declared: AssessmentRules, document: YamlDocument
) -> tuple[CampaignCell, list[Diagnostic]]:
    """Return a cell with a measure for each of its legs that is compared.

    Also everything that is wrong with these legs in its mission.
    """
    measures: dict[str, Oracle] = {}
    problems = []
    for comparison in declared.comparisons:
        leg = comparison.leg
        if leg is None or cell.scenario.name not in (comparison.left, comparison.right):
            continue
        where = _sentence_place(comparison.name, document)
        number = int(leg) if leg.isdigit() else 0
        try:
            leg_number(Leg(number, "" if number else leg), cell.mission)
        except ValueError as error:
            problems.append(Diagnostic(where, str(error)))
        measures[comparison.measure] = _leg_measure(comparison.measure, leg, where)
    return replace(cell, oracles=(*cell.oracles, *measures.values())), problems


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


def _comparison(name: str, sentence: str, draft: Draft) -> ScenarioComparison:
    where = _sentence_place(name, draft.document)
    found = _SENTENCE.fullmatch(sentence)
    if found is None:
        raise InputError(Diagnostic(where, f'"{sentence}" is not a comparison', _EXAMPLE))

    def at(part: str) -> Where:
        return Where(where.file, where.line, where.column + found.start(part))

    left, right, quantity = found["left"], found["right"], found["quantity"]
    problems = [d for part in ("left", "right") for d in _unknown(found[part], at(part), draft)]
    if problems:
        raise InputError(problems)
    if left == right:
        raise InputError(Diagnostic(at("right"), f'"{left}" is compared with itself'))
    # Paired by repeat and system under test, so without one in common there is no pair at all.
    if not set(draft.scenarios[left].sut_names) & set(draft.scenarios[right].sut_names):
        message = f'"{left}" and "{right}" have no system under test in common'
        raise InputError(Diagnostic(at("left"), message))
    leg = found["leg"].strip('"') if found["leg"] else None
    if leg is not None and quantity != DELAY:
        message = f'"on leg" goes with delay; let the measure "{quantity}" say "on leg {leg}"'
        raise InputError(Diagnostic(at("leg"), message))
    unit = "s" if quantity == DELAY else _unit(quantity, at("quantity"), (left, right), draft)
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


def _unknown(name: str, where: Where, draft: Draft) -> Iterator[Diagnostic]:
    if name in draft.scenarios:
        return
    if name in draft.text.scenarios:
        hint = "compare scenarios that are like it"
        yield Diagnostic(where, f'scenario "{name}" is abstract, it is never run', hint)
        return
    yield Diagnostic(where, f'no scenario "{name}" here', did_you_mean(name, draft.scenarios))


def _unit(quantity: str, where: Where, scenarios: tuple[str, str], draft: Draft) -> str:
    """Return the unit of a measure that both scenarios have; raises :class:`InputError`."""
    measures = [name for name, oracle in draft.oracles.items() if oracle.is_measure]
    oracle = draft.oracles.get(quantity)
    if oracle is None:
        hint = did_you_mean(quantity, [DELAY, *measures])
        raise InputError(Diagnostic(where, f'no measure "{quantity}"', hint))
    if not oracle.is_measure:
        hint = f"compare one of: {', '.join([DELAY, *measures])}"
        raise InputError(Diagnostic(where, f'"{quantity}" has a limit, it is no measure', hint))
    for scenario in scenarios:
        if quantity not in draft.scenarios[scenario].oracle_names:
            hint = f"add it to the oracles of {scenario}"
            raise InputError(Diagnostic(where, f'"{scenario}" does not measure {quantity}', hint))
    return unit_of(oracle)


def _unmatched_expectation(
    written: ExpectText,
    path: tuple[str, int],
    comparisons: Sequence[str],
    draft: Draft,
) -> Iterator[Diagnostic]:
    """Yield what an expectation speaks of that is not there."""
    scenarios = _matching(written.scenario, draft.scenarios)
    if not scenarios:
        where = draft.document.where((*path, "scenario"))
        hint = did_you_mean(written.scenario, draft.scenarios)
        yield Diagnostic(where, f'no scenario "{written.scenario}" to expect anything of', hint)
        return
    # An expectation that matches nothing would hide a failure for ever once a name is changed.
    names = dict.fromkeys(n for s in scenarios for n in draft.scenarios[s].oracle_names)
    oracles = _matching(written.oracle, (*names, *comparisons))
    where = draft.document.where((*path, "oracle"))
    if not oracles:
        hint = did_you_mean(written.oracle, (*names, *comparisons))
        yield Diagnostic(where, f'no oracle "{written.oracle}" judges {written.scenario}', hint)
    elif all(n in draft.oracles and draft.oracles[n].is_measure for n in oracles):
        yield Diagnostic(where, f'"{written.oracle}" is a measure, it has no verdict')
    suts = dict.fromkeys(n for s in scenarios for n in draft.scenarios[s].sut_names)
    for index, pattern in enumerate(written.sut):
        if not _matching(pattern, suts):
            where = draft.document.where((*path, "sut", index))
            hint = did_you_mean(pattern, suts)
            yield Diagnostic(where, f'no system under test "{pattern}" there', hint)


def _matching(pattern: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if fnmatchcase(name, pattern)]
