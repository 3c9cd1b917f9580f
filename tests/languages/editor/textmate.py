"""A small tokenizer of TextMate grammars: enough for ours, with Python's ``re``."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import grammars.editor

SYNTAXES = Path(grammars.editor.__file__).parent / "vscode" / "syntaxes"
Scopes = tuple[str, ...]


@dataclass(frozen=True)
class Token:
    """A piece of a line, from column ``start`` (from 0), and its scopes, outermost first."""

    line: int
    start: int
    text: str
    scopes: Scopes

    def __contains__(self, scope):
        return any(s == scope or s.startswith(f"{scope}.") for s in self.scopes)


@dataclass(frozen=True)
class _Frame:
    rule: dict[str, Any]
    scopes: Scopes


def grammar(language):
    """Return the grammar in ``<language>.tmLanguage.json``."""
    return json.loads((SYNTAXES / f"{language}.tmLanguage.json").read_text())


def tokens(text, language):
    """Tokenize ``text``; every character but line breaks is in exactly one token."""
    rules = grammar(language)
    stack = [_Frame(rules, (rules["scopeName"],))]
    found = []
    for number, line in enumerate(text.splitlines(), start=1):
        found += _line(number, line, rules, stack)
    return found


def _line(number, line, rules, stack):
    at, plain = 0, 0
    while at <= len(line):
        frame = stack[-1]
        match, rule = _next(line, at, rules, frame)
        if match is None:
            break
        if plain < match.start():
            yield Token(number, plain, line[plain : match.start()], frame.scopes)
        if rule is None:
            stack.pop()
        elif "begin" in rule:
            name = (rule["name"],) if "name" in rule else ()
            stack.append(_Frame(rule, frame.scopes + name))
        if match.end() > match.start():
            yield from _captured(number, match, rule or {}, frame.scopes)
        elif rule is not None and "begin" not in rule:
            raise AssertionError(f"{rule['match']} matches nothing at all")
        at = plain = match.end()
        if rule is None and match.end() == len(line):
            break
    if plain < len(line):
        yield Token(number, plain, line[plain:], stack[-1].scopes)


def _next(line, at, rules, frame):
    """Return the leftmost match, the first rule winning; rule ``None`` is the end of the frame."""
    best = None
    winner = None
    if "end" in frame.rule:
        best = re.compile(frame.rule["end"]).search(line, at)
    for rule in _flat(frame.rule.get("patterns", ()), rules):
        match = re.compile(rule.get("match") or rule["begin"]).search(line, at)
        if match is not None and (best is None or match.start() < best.start()):
            best, winner = match, rule
    return best, winner


def _flat(patterns, rules):
    for pattern in patterns:
        include = pattern.get("include")
        if include is None and "patterns" in pattern and "begin" not in pattern:
            yield from _flat(pattern["patterns"], rules)
        elif include is None:
            yield pattern
        elif include.startswith("#"):
            yield from _flat([rules["repository"][include[1:]]], rules)
        else:
            other = grammar(include.removeprefix("source."))
            yield from _flat(other["patterns"], other)


def _captured(number, match, rule, outer):
    scopes = outer + ((rule["name"],) if "name" in rule else ())
    captures = rule.get("captures", {})
    at = match.start()
    for index in range(1, (match.re.groups or 0) + 1):
        start, end = match.span(index)
        if str(index) not in captures or start < at:
            continue
        if at < start:
            yield Token(number, at, match.string[at:start], scopes)
        yield Token(number, start, match.string[start:end], (*scopes, captures[str(index)]["name"]))
        at = end
    if at < match.end():
        yield Token(number, at, match.string[at : match.end()], scopes)
