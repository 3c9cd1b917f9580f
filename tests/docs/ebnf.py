"""textX grammars in EBNF, as readers of the documentation know it.

What a textX grammar says beyond what may be written (names of attributes, classes) is left out.
``'x'`` is to be written so, ``/x/`` is a regular expression, ``?`` at most once, ``*`` any number
of times, ``+`` at least once, ``|`` either or.
"""

from functools import cache
from types import MappingProxyType

from grammars.text.diagnostics import SourceText
from grammars.text.loops import repeated
from grammars.text.parsing import load_metamodel
from tests.docs.markdown import ROOT

GRAMMARS = {
    name: ROOT / "grammars" / name / f"{name}.tx"
    for name in ("floorplan", "scenery", "variation", "oracle")
} | {"expressions": ROOT / "grammars" / "text" / "expressions.tx"}
_WHOLE_WORDS = ("scenery", "oracle", "variation")
"""Languages whose keywords end where words end."""
_WIDTH = 96
_IN_WORDS = {
    ("scenery", "Name"): "? letters, digits and _, not a digit first, none of Reserved ?",
    ("floorplan", "UNIT"): "? a unit such as m, cm, deg ?",
    ("variation", "UNIT"): "? a unit such as m, cm, deg ?",
    ("scenery", "QuantityText"): "? a number, and a unit such as m, deg, s, kg, N m, m/s^2 or % ?",
    ("floorplan", "Name"): "? the name of a variable ?",
    ("floorplan", "UNSIGNED"): "? a number without a sign ?",
    ("floorplan", "Operator"): "? one of + - * / ( ?",
    ("variation", "Name"): "? letters, digits and _, in parts with a dot between ?",
    (
        "expressions",
        "Name",
    ): "? letters, digits, _ and -, in parts with a dot between; or in quotes ?",
    ("expressions", "UNSIGNED"): "? a number ?",
    ("expressions", "UNIT"): "? a unit such as m/s^2, N m or % ?",
}
"""Tokens whose expression would tell nobody anything."""
_EVERYWHERE = ("Comment",)
_NOTED = "\0"
"""Behind what textX notes as there or not there, until it is known whether it has to be there."""


@cache
def rules(language):
    """Return the rules of a language by name, each as EBNF."""
    from arpeggio import ParserPython
    from textx import lang

    parser = ParserPython(lang.textx_model, lang.comment, ignore_case=False, reduce_tree=False)
    # What languages share is a grammar of its own.
    text = GRAMMARS[language].read_text("utf-8").replace("{expressions}", "")
    tree = parser.parse(text)
    found = {}
    for node in tree:
        if node.rule_name == "textx_rule":
            name = _child(node, "rule_name").flat_str()
            said = _IN_WORDS.get((language, name))
            body = [said] if said else _choice(_child(node, "textx_rule_body"))
            if name not in _EVERYWHERE:
                found[name] = _wrapped(name, body)
    return MappingProxyType(found)


def _child(node, name):
    return next(child for child in node if child.rule_name == name)


def _choice(node):
    return [_sequence(child) for child in node if child.rule_name == "sequence"]


def _sequence(node):
    return " ".join(filter(None, map(_repeatable, node)))


def _repeatable(node):
    inner = node[0][0]
    text = _assignment(inner) if inner.rule_name == "assignment" else _plain(node[0])
    operators = [child for child in node[1:] if child.rule_name == "repeat_operator"]
    return text + operators[0][0].flat_str() if operators and text else text


def _plain(node):
    """Return an expression that assigns nothing; what only looks ahead is no part of a text."""
    if any(child.rule_name == "syntactic_predicate" for child in node):
        return ""
    inner = node[-1]
    if inner.rule_name == "bracketed_choice":
        # What is noted as true or false ("?=") decides between these, so it has to be there.
        choices = " | ".join(_choice(_child(inner, "choice")))
        return f"({choices.replace(_NOTED, '')})"
    return _match(inner)


def _match(node):
    while node.rule_name in ("simple_match", "reference", "str_match", "string_value"):
        node = node[0]
    text = node.flat_str()
    return f"'{text[1:-1]}'" if text[0] in "'\"" else text


def _assignment(node):
    operator, right = node[1].flat_str(), node[2]
    what = _match(right[0])
    separators = [child for child in right if child.rule_name == "repeat_modifiers"]
    if separators:
        again = f"{what} ({_match(separators[0][1])} {what})*"
        return f"({again})?" if operator == "*=" else again
    return what + {"=": "", "?=": _NOTED, "*=": "*", "+=": "+"}[operator]


def _wrapped(name, choices):
    """Break a long rule between its parts, never inside a quoted word or an expression."""
    lines, line = [], f"{name} ="
    for word in " | ".join(choices).replace(_NOTED, "?").split(" "):
        if len(line) + len(word) >= _WIDTH and line.count("'") % 2 == 0:
            lines.append(line)
            line = f"    {word}"
        else:
            line = f"{line} {word}"
    return "\n".join((*lines, line))


@cache
def _parser(language):
    path = GRAMMARS[language]
    return load_metamodel(path, autokwd=language in _WHOLE_WORDS)._parser_blueprint


def used(language, text):
    """Return the rules and quoted words of a grammar that a text makes use of.

    Words are in quotes and preceded by the rule they stand in. Raises textX's error when the text
    does not follow the grammar.
    """
    parser = _parser(language).clone()
    found = set()
    if language in ("floorplan", "scenery"):
        text = repeated(SourceText(text, "")).text
    parser.parse(text)
    pending = [parser.parse_tree]
    while pending:
        node = pending.pop()
        found.add(node.rule_name)
        if isinstance(node, list):
            pending.extend(node)
        else:
            found.add(f"'{node.value}'")
    return frozenset(found)


def words(language):
    """Return every quoted word of a grammar that consists of letters."""
    from grammars.editor.oracles import literals

    found = literals(f"grammars.{GRAMMARS[language].parent.name}", f"{language}.tx")
    return frozenset(f"'{word}'" for rule in found.values() for word in rule if word.isalpha())
