"""The TextMate grammars know every word of the languages and colour what is written as meant."""

import json
import re
from pathlib import Path
from typing import NamedTuple

import pytest

import grammars.editor
from grammars.editor.oracles import literals
from grammars.text.units import UNIT_WORDS
from tests.languages.plans import HERE

SYNTAXES = Path(grammars.editor.__file__).parent / "vscode" / "syntaxes"
COLOURED = ("keyword", "support", "constant.language", "variable.language")
EXPRESSIONS = ("grammars.text", "expressions.tx")
LANGUAGES = {
    "fpm": [("grammars.floorplan", "floorplan.tx")],
    "scenery": [("grammars.scenery", "scenery.tx")],
    "variation": [("grammars.variation", "variation.tx"), EXPRESSIONS],
    "oracle": [("grammars.oracle", "oracle.tx"), EXPRESSIONS],
}


class Token(NamedTuple):
    """A piece of a line, and its scopes, outermost first."""

    line: int
    text: str
    scopes: tuple

    def has(self, *scopes):
        return any(re.match(rf"{re.escape(s)}(\.|$)", name) for s in scopes for name in self.scopes)


def grammar(language):
    return json.loads((SYNTAXES / f"{language}.tmLanguage.json").read_text())


def tokens(text, language):
    """Tokenize ``text``; every character but line breaks is in exactly one token.

    A small tokenizer of TextMate grammars: enough for ours, with Python's ``re``.
    """
    rules = grammar(language)
    stack = [(rules, (rules["scopeName"],))]
    for number, line in enumerate(text.splitlines(), start=1):
        for piece, scopes in _pieces(line, rules, stack):
            if piece:
                yield Token(number, piece, scopes)


def _pieces(line, rules, stack):
    at = 0
    while at <= len(line):
        frame, scopes = stack[-1]
        match, rule = _next(line, at, rules, frame)
        if match is None:
            break
        yield line[at : match.start()], scopes
        if rule is None:
            stack.pop()
        elif "begin" in rule:
            stack.append((rule, scopes + _name(rule)))
        else:
            assert match[0], f"{rule['match']} matches nothing at all"
        yield from _captured(match, rule or {}, scopes)
        at = match.end()
        if rule is None and at == len(line):
            break
    yield line[at:], stack[-1][1]


def _name(rule):
    return (rule["name"],) if "name" in rule else ()


def _next(line, at, rules, frame):
    """Return the leftmost match, the first rule winning; rule ``None`` is the end of the frame."""
    candidates = [(re.compile(frame["end"]).search(line, at), None)] if "end" in frame else []
    candidates += [
        (re.compile(rule.get("match") or rule["begin"]).search(line, at), rule)
        for rule in _flat(frame.get("patterns", ()), rules)
    ]
    candidates = [(match, rule) for match, rule in candidates if match]
    return min(candidates, key=lambda each: each[0].start(), default=(None, None))


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


def _captured(match, rule, outer):
    scopes = outer + _name(rule)
    captures = rule.get("captures", {})
    at = match.start()
    for index in range(1, match.re.groups + 1):
        start, end = match.span(index)
        if str(index) in captures and start >= at:
            yield match.string[at:start], scopes
            yield match.string[start:end], (*scopes, captures[str(index)]["name"])
            at = end
    yield match.string[at : match.end()], scopes


CONTEXT = {
    # Words that are keywords only in their place: an example of it.
    "fpm": "var a = 1 m|Space hall:|Column pillar:|Divider board:|Entryway door:|Window view:"
    "|Rectangle width=1 m|length = 2 m|Circle radius=2 m",
    "scenery": "object door|mover person|link leaf|joint hinge|state open: hinge 95 deg"
    "|group doors: a, b|parameter swing = 60 deg/s|hall.walls[1]|waypoint kitchen is reached",
    "variation": 'import "flat.fpm"|let a = uniform(1 .. 2)',
    "oracle": "reached(mission, 0.3 m)|mission: reached(mission, 0.3 m)",
}
ORACLE_WORDS = ("and", "or", "not", "when", "within", "until", "on", "leg")


def example(language, word):
    """Return the word where the language has it."""
    for text in CONTEXT[language].split("|"):
        if re.match(rf"(Rectangle |Circle |hall\.)?{word}\b", text):
            return text.removeprefix("mission: ")
    return {
        "fpm": f"{word}: ",
        "oracle": f"{word} " if word in ORACLE_WORDS else f"{word}(a)",
        "variation": f"{word}(1)",
    }.get(language, f"a {word} b")


def words_of(language):
    """Return every word the textX grammar spells out, once."""
    rules = [words for grammar in LANGUAGES[language] for words in literals(*grammar).values()]
    return sorted({word for words in rules for word in words if word[0].isalpha()})


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_keyword_of_a_language_is_coloured(language):
    words = words_of(language)
    assert len(words) > 8
    for word in words:
        (token, *_) = [t for t in tokens(example(language, word), language) if t.text == word]
        assert token.has(*COLOURED), token


PLACES = {
    "fpm": "var a = 3 {}",
    "scenery": "parameter a = 3 {}",
    "variation": "require 3 {} > a",
    "oracle": "always(a > 3 {})",
}


@pytest.mark.parametrize("language", PLACES)
def test_every_unit_is_coloured_in_every_language(language):
    for unit in [*UNIT_WORDS, "N m", "m/s^2", "N*m*s/rad", "m²", "°/s"]:
        (token, *_) = [t for t in tokens(PLACES[language].format(unit), language) if t.text == unit]
        assert token.has("keyword.other.unit")


def test_shipped_files_are_coloured_throughout(campaigns):
    files = [p for end in ("fpm", "scenery", "variation") for p in campaigns.glob(f"*/*.{end}")]
    assert {path.suffix for path in files} >= {".fpm", ".scenery"}
    for path in files:
        lines = path.read_text().splitlines()
        rebuilt = [""] * len(lines)
        for token in tokens(path.read_text(), path.suffix[1:]):
            rebuilt[token.line - 1] += token.text
            assert len(token.scopes) > 1 or not token.text.strip(), (path, token)
            if re.fullmatch(r"[-+]?\d[\d.]*", token.text):
                assert token.has("constant.numeric"), (path, token)
        assert rebuilt == lines


@pytest.mark.parametrize("language", [*LANGUAGES, "oracles.injection"])
def test_texts_have_their_colours(language, golden):
    """The golden file begins with the text."""
    name = f"highlighting/{language}.txt"
    text = (HERE / name).read_text("utf-8").partition("\n\n")[0]
    lines = [
        f"{token.text:24} {' '.join(token.scopes[1:])}".rstrip()
        for token in tokens(text, language)
        if token.text.strip()
    ]
    golden(name, "\n".join([text, "", *lines]) + "\n")


def test_oracle_lines_are_coloured_inside_yaml(campaigns):
    for path in sorted(campaigns.glob("*/*.oracles.yaml")):
        lines = [x for x in path.read_text().splitlines() if x and not x.startswith("#")]
        for line in lines:
            embedded = [t for t in tokens(line, "oracles.injection") if t.has("meta.embedded")]
            assert "".join(t.text for t in embedded) == line.partition(": ")[2]
            assert embedded[0].has("keyword.control.temporal", "support")
