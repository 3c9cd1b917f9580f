"""Declarations of a campaign about its results, read and checked against its scenarios."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any, Final

from daemon.campaign._file import ExpectText, ValueText, repeat_policy
from daemon.campaign._layers import CampaignCell, Draft
from daemon.model.assessments import (
    DELAY,
    DURATION,
    AssessmentRules,
    Expectation,
    ReferenceValue,
    RegressionGate,
    ScenarioComparison,
)
from grammars.oracle import Leg, Oracle, leg_number, parse_oracle, unit_of
from grammars.text.diagnostics import (
    Finding,
    InputError,
    SourceText,
    Where,
    did_you_mean,
    raise_all,
)
from grammars.text.documents import KeyPath, YamlDocument
from grammars.text.quantity import parse_in

# A sentence instead of YAML keys, where a value that begins with ">" or "<" means something else.
_NAME: Final = r"[A-Za-z0-9][A-Za-z0-9._-]*"
_SENTENCE: Final = re.compile(
    rf"\s*(?P<quantity>{_NAME})\s*\(\s*(?P<left>{_NAME})\s+vs\s+(?P<right>{_NAME})"
    rf"(?:\s+on\s+leg\s+(?P<leg>{_NAME}|\"[^\"]*\"))?\s*\)\s*(?P<op><=|>=|<|>)\s*(?P<limit>.+?)\s*"
)
_EXAMPLE: Final = "write it as delay(S3.2 vs S3.5) <= 30 s, or delay(A vs B on leg door) <= 1 min"


def read_declarations(draft: Draft) -> tuple[AssessmentRules, list[Finding]]:
    """Return the declarations of a campaign, and all errors in them."""
    problems: list[Finding] = []
    comparisons: list[ScenarioComparison] = []
    for name, sentence in draft.text.compare.items():
        try:
            comparisons.append(_comparison(name, sentence, draft))
        except InputError as error:
            problems.extend(error.findings)
    names = tuple(draft.text.compare)
    expectations = []
    for index, text in enumerate(draft.text.expect):
        path = ("expect", index)
        problems.extend(_unmatched_expectation(text, path, names, draft))
        where = draft.document.where(path)
        expectations.append(
            Expectation(
                text.scenario,
                text.oracle,
                tuple(text.sut),
                text.verdict,
                text.why,
                f"{Path(where.file).name}:{where.line}",
            )
        )
    references, errors = _references(comparisons, draft)
    gate = draft.text.gate
    declared = AssessmentRules(
        repeat_policy(draft.text.repeats),
        tuple(comparisons),
        tuple(expectations),
        RegressionGate(gate.baseline, gate.worse_by) if gate else None,
        references,
    )
    return declared, problems + errors


def time_legs(
    cell: CampaignCell, declared: AssessmentRules, document: YamlDocument
) -> tuple[CampaignCell, list[Finding]]:
    """Return a cell with a measure for each compared leg, and the errors in these legs."""
    measures: dict[str, Oracle] = {}
    problems = []
    for comparison in declared.comparisons:
        leg = comparison.leg
        if leg is None or cell.scenario.name not in (comparison.left, comparison.right):
            continue
        where = document.where_text("compare", comparison.name)
        number = int(leg) if leg.isdigit() else 0
        try:
            leg_number(Leg(number, "" if number else leg), cell.mission)
        except ValueError as error:
            problems.append(Finding(where, str(error)))
        measures[comparison.measure] = _leg_measure(comparison.measure, leg, where)
    return replace(cell, oracles=(*cell.oracles, *measures.values())), problems


def _leg_measure(name: str, leg: str, where: Where) -> Oracle:
    plain = leg.isdigit() or re.fullmatch(r"[A-Za-z_][A-Za-z0-9_-]*", leg)
    quoted = leg if plain else f'"{leg}"'
    return parse_oracle(name, f"max(mission.leg.elapsed) on leg {quoted}", where)


def _comparison(name: str, sentence: str, draft: Draft) -> ScenarioComparison:
    where = draft.document.where_text("compare", name)
    source = SourceText(sentence, where.file, within=where)
    parts = _SENTENCE.fullmatch(sentence)
    if parts is None:
        raise InputError(Finding(where, f'"{sentence}" is not a comparison', _EXAMPLE))

    def at(part: str) -> Where:
        return source.where(parts.start(part))

    left, right, quantity = parts["left"], parts["right"], parts["quantity"]
    raise_all(
        problem
        for part in ("left", "right")
        for problem in draft.check_scenario(
            parts[part], at(part), "compare scenarios that are like it"
        )
    )
    if left == right:
        raise InputError(Finding(at("right"), f'"{left}" is compared with itself'))
    # Runs are paired by repeat and system under test, so without a common one there is no pair.
    if not set(draft.scenarios[left].sut_names) & set(draft.scenarios[right].sut_names):
        message = f'"{left}" and "{right}" have no system under test in common'
        raise InputError(Finding(at("left"), message))
    leg = parts["leg"].strip('"') if parts["leg"] else None
    if leg is not None and quantity != DELAY:
        message = f'"on leg" goes with delay; let the measure "{quantity}" say "on leg {leg}"'
        raise InputError(Finding(at("leg"), message))
    unit = "s" if quantity == DELAY else _unit(quantity, at("quantity"), (left, right), draft)
    limit = parse_in(parts["limit"], unit, quantity, at("limit"))
    return ScenarioComparison(
        name=name,
        quantity=quantity,
        left=left,
        right=right,
        leg=leg,
        op=parts["op"],  # type: ignore[arg-type]
        limit=limit,
        unit=unit,
        text=" ".join(sentence.split()),
        measure="" if leg is None else f"elapsed-on-leg-{leg}",
    )


def _unit(quantity: str, where: Where, scenarios: tuple[str, str], draft: Draft) -> str:
    """Return the unit of a measure that both scenarios have; raises :class:`InputError`."""
    measures = [name for name, oracle in draft.oracles.items() if oracle.is_measure]
    oracle = draft.oracles.get(quantity)
    if oracle is None:
        hint = did_you_mean(quantity, [DELAY, *measures])
        raise InputError(Finding(where, f'no measure "{quantity}"', hint))
    if not oracle.is_measure:
        hint = f"compare one of: {', '.join([DELAY, *measures])}"
        raise InputError(Finding(where, f'"{quantity}" has a limit, it is not a measure', hint))
    for scenario in scenarios:
        if quantity not in draft.scenarios[scenario].oracle_names:
            hint = f"add it to the oracles of {scenario}"
            raise InputError(Finding(where, f'"{scenario}" does not measure {quantity}', hint))
    return unit_of(oracle)


def _unmatched_expectation(
    text: ExpectText,
    path: KeyPath,
    comparisons: Sequence[str],
    draft: Draft,
) -> Iterator[Finding]:
    """Yield an error for each name of an expectation that does not exist."""
    scenarios = _matching(text.scenario, draft.scenarios)
    if not scenarios:
        where = draft.document.where((*path, "scenario"))
        hint = did_you_mean(text.scenario, draft.scenarios)
        yield Finding(where, f'no scenario "{text.scenario}" to expect anything of', hint)
        return
    # After a name is changed, an expectation without a match would hide a failure for ever.
    names = dict.fromkeys(n for s in scenarios for n in draft.scenarios[s].oracle_names)
    oracles = _matching(text.oracle, (*names, *comparisons))
    where = draft.document.where((*path, "oracle"))
    if not oracles:
        hint = did_you_mean(text.oracle, (*names, *comparisons))
        yield Finding(where, f'no oracle "{text.oracle}" judges {text.scenario}', hint)
    elif all(n in draft.oracles and draft.oracles[n].is_measure for n in oracles):
        yield Finding(where, f'"{text.oracle}" is a measure, it has no verdict')
    yield from _unmatched_suts(text.sut, path, scenarios, draft)


def _unmatched_suts(
    patterns: Iterable[str], path: KeyPath, scenarios: Iterable[str], draft: Draft
) -> Iterator[Finding]:
    """Yield the patterns that match no system under test of the scenarios."""
    suts = dict.fromkeys(name for s in scenarios for name in draft.scenarios[s].sut_names)
    for index, pattern in enumerate(patterns):
        if not _matching(pattern, suts):
            where = draft.document.where((*path, "sut", index))
            hint = did_you_mean(pattern, suts)
            yield Finding(where, f'no system under test "{pattern}" there', hint)


def _matching(pattern: str, names: Iterable[str]) -> list[str]:
    return [name for name in names if fnmatchcase(name, pattern)]


def _references(
    comparisons: Sequence[ScenarioComparison], draft: Draft
) -> tuple[tuple[ReferenceValue, ...], list[Finding]]:
    """Return the reference values of a campaign, and the errors in them.

    Reports show them beside the results. They change no verdict.
    """
    units = {comparison.name: comparison.unit for comparison in comparisons}
    values: list[ReferenceValue] = []
    problems: list[Finding] = []
    for name, group in draft.text.reference.items():
        for index, text in enumerate(group.values):
            if text.oracle in draft.text.compare and text.oracle not in units:
                continue  # the error is in the comparison
            reader = _ReferenceReader(text, ("reference", name, "values", index), units, draft)
            try:
                values.append(reader.read(name, group.source))
            except InputError as error:
                problems.extend(error.findings)
    return tuple(values), problems


_COUNT: Final = re.compile(r"\s*(?P<passed>\d{1,6})\s+of\s+(?P<runs>\d{1,6})\s*")


@dataclass(frozen=True, slots=True)
class _ReferenceReader:
    """One reference value at ``path``; ``comparisons`` are the units of all comparisons."""

    text: ValueText
    path: KeyPath
    comparisons: Mapping[str, str]
    draft: Draft

    def read(self, name: str, source: str) -> ReferenceValue:
        """Return the value; raises :class:`InputError`."""
        text, unit, where = self.text, self._unit(), self._at()
        common: dict[str, Any] = {
            "name": name, "source": source, "scenario": text.scenario, "suts": tuple(text.sut),
            "oracle": text.oracle, "note": text.note,
            "where": f"{Path(where.file).name}:{where.line}",
        }  # fmt: skip
        if unit is None:
            return ReferenceValue(**common, **self._rate())
        value = parse_in(text.value, unit, text.oracle, self._at("value"))
        words, deviation, low, high = text.value.strip(), None, None, None
        if text.deviation is not None:
            deviation = parse_in(text.deviation, unit, text.oracle, self._at("deviation"))
            if deviation < 0.0:
                raise InputError.at(self._at("deviation"), "a deviation is never negative")
            words += f" ± {text.deviation.strip()}"
        if text.range is not None:
            bounds = enumerate(text.range)
            low, high = (parse_in(b, unit, text.oracle, self._at("range", i)) for i, b in bounds)
            if low > high:
                raise InputError.at(self._at("range"), "write the smaller value first")
            words += f" ({text.range[0].strip()} to {text.range[1].strip()})"
        return ReferenceValue(
            **common, statistic=text.statistic, value=value, unit=unit, text=words,
            deviation=deviation, low=low, high=high, runs=text.runs,
        )  # fmt: skip

    def _at(self, *key: str | int) -> Where:
        return self.draft.document.where((*self.path, *key))

    def _unit(self) -> str | None:
        """Return the unit of the measure, ``None`` for a rate; raises :class:`InputError`."""
        text, draft = self.text, self.draft
        if text.oracle in self.comparisons:
            if text.scenario:
                message = f'"{text.oracle}" is a comparison and names its scenarios itself'
                raise InputError.at(self._at("scenario"), message, 'leave "scenario" out')
            raise_all(_unmatched_suts(text.sut, self.path, draft.scenarios, draft))
            return self.comparisons[text.oracle]
        # Every run has a duration, even if no oracle of that name measures it.
        units: dict[str, str | None] = {DURATION: "s"}
        units |= {name: unit_of(o) if o.is_measure else None for name, o in draft.oracles.items()}
        if not text.scenario:
            hint = 'name its "scenario"'
            if text.oracle not in units:
                hint = did_you_mean(text.oracle, self.comparisons)
            raise InputError.at(self._at("oracle"), f'no comparison "{text.oracle}"', hint)
        scenarios = _matching(text.scenario, draft.scenarios)
        if not scenarios:
            message = f'no scenario "{text.scenario}" to compare'
            hint = did_you_mean(text.scenario, draft.scenarios)
            raise InputError.at(self._at("scenario"), message, hint)
        names = {DURATION, *(n for s in scenarios for n in draft.scenarios[s].oracle_names)}
        # A value without any result to stand beside would go unnoticed.
        if text.oracle not in names:
            message = f'{text.scenario} has neither measure nor oracle "{text.oracle}"'
            hint = did_you_mean(text.oracle, (*names, *self.comparisons))
            raise InputError.at(self._at("oracle"), message, hint)
        raise_all(_unmatched_suts(text.sut, self.path, scenarios, draft))
        return units[text.oracle]

    def _rate(self) -> dict[str, Any]:
        text = self.text
        count = _COUNT.fullmatch(text.value)
        passed, runs = (int(count["passed"]), int(count["runs"])) if count else (0, 0)
        if not 0 <= passed <= runs or runs == 0:
            message = (
                f'"{text.oracle}" has a limit: "{text.value}" does not say how many runs passed'
            )
            raise InputError.at(self._at("value"), message, "write it as 3 of 5")
        for key in ("statistic", "deviation", "range", "runs"):
            if key in text.model_fields_set:
                message = f'"{key}" goes with a measure, "{text.oracle}" has a limit'
                raise InputError.at(self._at(key), message)
        words = f"{passed} of {runs}"
        return {
            "statistic": "rate", "value": passed / runs, "unit": "1", "text": words, "runs": runs,
        }  # fmt: skip
