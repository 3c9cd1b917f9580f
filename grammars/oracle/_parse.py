"""Reader of oracles: single lines, and layers (YAML files with ``name: oracle`` lines)."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Final

from grammars.oracle._checks import check_types
from grammars.oracle._model import (
    OPERATORS,
    RESPONSE_FORM,
    Amount,
    CustomCall,
    Judgement,
    Leg,
    Limit,
    Oracle,
    Reached,
    Response,
    Statistic,
    Temporal,
    Until,
)
from grammars.oracle._signals import custom_oracle_names
from grammars.text.diagnostics import (
    Findings,
    InputError,
    SourceText,
    SyntaxNode,
    Where,
    did_you_mean,
    rule_of,
)
from grammars.text.documents import YamlDocument, load_yaml
from grammars.text.expressions import (
    Expression,
    ExpressionLanguage,
    Number,
    read_expression,
    read_name,
    read_number,
)
from grammars.text.parsing import SyntaxFault

_MAX_LENGTH: Final = 1000
"""Characters of an oracle at most."""
_EXAMPLE: Final = "an oracle looks like: always(loc.error <= 0.35 m)"


def parse_oracle(name: str, text: str, where: Where) -> Oracle:
    """Read one oracle; ``where`` is the place of the first character of ``text``.

    Raises :class:`InputError` for syntax errors, unknown signals or units, and comparisons of
    different dimensions. :func:`check_references` checks the names of scenery objects.
    """
    # Otherwise a misspelt operator would be reported as a missing plug-in.
    _refuse_unknown_operator(text, where)
    if len(text) > _MAX_LENGTH:
        raise InputError.at(where, f"is longer than {_MAX_LENGTH} characters")
    source = SourceText(text, where.file, within=where)
    tree = _LANGUAGE.parse(source)
    guard = read_expression(tree.guard, source) if tree.guard else None
    oracle = Oracle(name, text, where, _judgement(tree.judgement, source), guard, _leg(tree.leg))
    check_types(oracle)
    return oracle


_RESPONSE: Final = f"write {RESPONSE_FORM}"
_MEANT: Final = tuple(
    (re.compile(done), re.compile(rest), hint)
    for done, rest, hint in (
        (r"^$", r"(?:if|after|every)\b", _RESPONSE),
        (r"^$", r"(?:avg|average)\b", "write mean(…)"),
        (r"^$", r"not\b", "write never(…)"),
        (r"^$", r"([\w-]+)\s+(?:is|opens?)\b", "write eventually(abs({0}.angle) >= 80 deg)"),
        (r"^$", r"([^(]+[<>=≤≥].*)", "say when it must hold: always({0})"),
        (r"^reached\s*\(.*\)$", r"within\s+(.+)", "write a second oracle: final(elapsed) <= {0}"),
        (r"^reached\b", r".*?(\d[\d.]* ?[a-z]+)", "write reached(mission, {0}), for all waypoints"),
        (r"^reached\b", r"", "write reached(mission, 0.25 m), for all waypoints"),
        (r"^whenever\b|-$|\bif$", r"", _RESPONSE),
        (r"", r"=>\s*-?[\d.]", "write >="),
        (r"", r"=>|implies\b|then\b", _RESPONSE),
        (r".\b(?:always|never|eventually)\b", r"", f"operators stand first: {RESPONSE_FORM}"),
        (r"^(always|never|eventually)$", r"([^(].*)", "write {0}({1})"),
        (rf"^({'|'.join(OPERATORS)})$", r"([^<>=(]+?)\s*([<>]=?.+)", "write {0}({1}) {2}"),
        (r"\)$", r"(?:during|in|at|for)\s+(leg\b.*)", "write on {0}"),
        (r"^(\w+)\s*(\(.*\))$", r"(?:within|before|in|by)\b\s*(.+)", "write {0} within {2} {1}"),
        (r"\)$", r"(?:if|while|unless)\b\s*(.+)", "write when {0}"),
        (r"^[^(]+\([^()]*\)[^()]*$", r"and\b|or\b|;|&|\|", "write two oracles, one line each"),
        (r"", r"=<", "write <="),
        (r"", r"=", "write <=, >=, or == for counts"),
        (r"", r"&", "write and"),
        (r"", r"\|", "write or"),
        (r"", r"!", "write not"),
        (r"(\d)$", r",(\d+)", "write decimals with a point: {0}.{1}"),
        (r"\brobot$", r"(?:is\s+)?in\s+([\w-]+)", "write in(robot, {0})"),
        (r"([\w-]+)(?:\.angle)?$", r"(?:is|opens?)\b", "write abs({0}.angle) >= 80 deg"),
        (r"([\w.]+)$", r"between\s+(.+?)\s+and\s+([^)]+)", "write {0} >= {1} and {0} <= {2}"),
    )
)
"""Patterns of the text read so far and of the rest, and the sentence that was meant there."""


def _meant(done: str, rest: str) -> str:
    """Return the sentence that was meant by the rest of a text, empty if unknown."""
    for before, after, hint in _MEANT:
        if (found := before.search(done)) and (following := after.match(rest)):
            return hint.format(*found.groups(), *following.groups())
    return ""


class _OracleLanguage(ExpressionLanguage):
    def hint(self, fault: SyntaxFault) -> str:
        return _meant(fault.done, fault.rest) or _EXAMPLE


_LANGUAGE: Final = _OracleLanguage(Path(__file__).with_name("oracle.tx"), autokwd=True)


def _refuse_unknown_operator(text: str, where: Where) -> None:
    word = re.match(r"\s*([A-Za-z_][\w.-]*)", text)
    if word is not None and word[1] in OPERATORS:
        return
    operators = (*OPERATORS, *custom_oracle_names())
    if word is None or word[1] not in operators:
        subject = f'"{word[1]}"' if word else "this"
        hint = did_you_mean(word[1], operators) if word else _EXAMPLE
        if not hint.startswith("did"):
            hint = _meant("", text.strip()) or hint
        raise InputError.at(where, f"{subject} does not begin an oracle", hint)


def _judgement(node: SyntaxNode, source: SourceText) -> Judgement:
    match rule_of(node):
        case "Temporal":
            predicate = read_expression(node.predicate, source)
            if node.until:
                return _until(node, predicate, source)
            return Temporal(node.operator, predicate, _quantity(node.within, source))
        case "Response":
            occasion, predicate = (
                read_expression(part, source) for part in (node.occasion, node.predicate)
            )
            return Response(occasion, predicate, read_number(node.within, source))
        case "Amount":
            predicate = read_expression(node.predicate, source)
            return Amount(node.operator, predicate, _limit(node.limit, source))
        case "Statistic":
            signal = read_expression(node.signal, source)
            return Statistic(node.operator, signal, _limit(node.limit, source))
        case "Reached":
            return Reached(read_number(node.tolerance, source))
    arguments = tuple(read_number(argument, source) for argument in node.arguments)
    name = read_name(node.name)
    if name in OPERATORS:
        message = f'"{name}" judges something else than this'
        raise InputError.at(source.at(node), message, _meant(name, "") or _EXAMPLE)
    return CustomCall(name, arguments)


def _until(node: SyntaxNode, predicate: Expression, source: SourceText) -> Until:
    until = node.until
    if node.operator == "eventually" or node.within:
        hint = "such as: never(contact) until within 60 s (mission.reached >= 1)"
        first = "eventually" if node.operator == "eventually" else f"{node.operator} within"
        raise InputError.at(source.at(until), f'"{first}" takes no "until"', hint)
    release = read_expression(until.release, source)
    return Until(node.operator, predicate, release, _quantity(until.within, source))


def _quantity(node: SyntaxNode, source: SourceText) -> Number | None:
    return read_number(node, source) if node else None


def _limit(node: SyntaxNode, source: SourceText) -> Limit | None:
    if not node:
        return None
    number = read_number(node.quantity, source)
    if node.negative:
        number = replace(number, value=-number.value, text=f"-{number.text}")
    return Limit(node.operator, number)


def _leg(node: SyntaxNode) -> Leg | None:
    if not node:
        return None
    waypoint = read_name(node.waypoint) if node.waypoint else ""
    return Leg(int(node.number or 0), waypoint, node._tx_position)


_NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,99}")


def load_oracles(path: str | Path) -> dict[str, Oracle]:
    """Return the oracles of a layer by name, in file order.

    Raises :class:`InputError` with all problems of the file.
    """
    document = load_yaml(path)
    if not isinstance(document.data, dict) or not document.data:
        raise InputError.at(
            Where(document.file, 1),
            "expected lines of name: oracle",
            "such as: localised: always(loc.error <= 0.35 m)",
        )
    oracles: dict[str, Oracle] = {}
    findings = Findings()
    for name, text in document.data.items():
        with findings.collecting():
            oracles[name] = _read(document, name, text)
    findings.raise_errors()
    return oracles


def _read(document: YamlDocument, name: str, text: object) -> Oracle:
    key = document.where((name,))
    if not _NAME.fullmatch(name):
        raise InputError.at(
            key, f'"{name}" cannot name an oracle', "use letters, digits, - _ and ."
        )
    if not isinstance(text, str):
        raise InputError.at(key, f'oracle "{name}" is not a line of text')
    return parse_oracle(name, text, document.where_text(name))
