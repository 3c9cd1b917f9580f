"""Reader of ``.scenery`` files: from text to a :class:`SceneryLayer`."""

from __future__ import annotations

import difflib
import functools
import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Final, TypeAlias

from grammars.scenery._objects import read_object
from grammars.scenery._reader import SceneryReader
from grammars.scenery._sentences import read_sentence
from grammars.scenery.model import (
    Group,
    Instance,
    ObjectModel,
    Parameter,
    SceneryLayer,
    Sentence,
    Setting,
)
from grammars.text.diagnostics import SourceText, SyntaxNode, Where, rule_of
from grammars.text.loops import repeated
from grammars.text.parsing import Language, SyntaxFault, keywords_of, without_comments
from grammars.text.sources import read_text
from grammars.text.units import UNIT_WORDS
from grammars.text.words import enumerate_words

_Part: TypeAlias = ObjectModel | Instance | Group | Parameter | Setting | Sentence
_GRAMMAR: Final = Path(__file__).with_name("scenery.tx")
_SPACE: Final = re.compile(r'("[^"\n]*")|(?:\s|//[^\n]*)+')
"""White space and comments, or a quoted name, which keeps its blanks."""
_STARTERS: Final = (
    "object",
    "mover",
    "link",
    "joint",
    "state",
    "group",
    "parameter",
    "every",
    "all",
)
_STATEMENT_START: Final = re.compile(r"^(?!(?:link|joint|state)\b)[^\W\d]", re.MULTILINE)
"""A word that is not indented, where reading continues after an error."""
_UNITLESS: Final = re.compile(
    r"(?<!leg\s)(?<!waypoint\s)(?<!probability\s)(?<![\w.\[])\d+(?:\.\d*)?$"
)
_UNIT: Final = re.compile(r"(?<![\w.])(\d+(?:\.\d*)?)[ \t]*([^\W\d_]+)$")
_VERBS: Final = ("is", "starts", "stays", "moves", "toggles", "goes", "walks")
_READABLE: Final = {
    "Name": "a name",
    "QuantityText": "a number",
    r"an?\b": '"a"',
    "AxisName": "x or y",
    "INT": "a whole number",
    "EOF": "the end of the file",
    r"[^\d\W]\w*": "a name",
    r"robot's\s+footprint\b": '"robot\'s footprint"',
    r"back\s+and\s+forth\b": '"back and forth"',
    "WaypointName": "a waypoint",
    "verb": f"a verb ({enumerate_words(_VERBS, 'or')})",
}
"""Names of rules and patterns of the grammar in messages."""
_MOST_WORDS: Final = 8
_OTHER_FORMS: Final = frozenset(
    {"are", "all", "start", "stay", "move", "toggle", "go", "their", "walk", "cylinder"}
)
"""Valid forms of words that messages do not suggest."""


_MEANT: Final = tuple(
    (re.compile(pattern.replace("SUBJECT", r"((?:every\s+|all\s+)?[\w.]+)\s+")), f"write {hint}")
    for pattern, hint in (
        (r"(?:if|when)\s+(.+?)(?:,|\s+then)\s+(\w+)\s", "{1} goes from closed to open when {0}"),
        (r"SUBJECT(?:remains?|keeps?|is kept)\s+(\w+)", "{0} stays {1}"),
        (r"SUBJECT(?:begins?|is initially)\s+(\w+)", "{0} starts {1}"),
        (r"SUBJECT(.+)\s+if\s+(.+)", "{0} {1} when {2}"),
        (r"SUBJECT(?:is|are)\s+(?!an?\s)(?:always\s+)?(\w+)",
         "{0} starts {1}; all the time: {0} stays {1}"),
        (r"SUBJECT(?:\w+\s+)?opens?\s+(?:at|after|in)\s+(.+)", "{0} moves to open at {1}"),
        (r"SUBJECT(?:closes?|shuts?)\s+(?:at|after|in)\s+(.+)", "{0} moves to closed at {1}"),
        (r"SUBJECTopens?\s+when\s+(.+)", "{0} goes from closed to open when {1}"),
        (r"SUBJECT(?:closes?|shuts?)\s+when\s+(.+)", "{0} goes from open to closed when {1}"),
        (r"SUBJECT(?:goes?|moves?)\s+from\s+(\w+)\s+to\s+(\w+)\s+at\s+(.+)",
         "{0} moves to {1} at 0 s, to {2} at {3}"),
        (r".*\swhen\s+([\w.]+)\s+(?:opens?|closes?|moves?)\b", "when {0} starts to move"),
        (r".*\swhen\s+(?:the\s+)?robot\s", "when the robot is within 1 m of its hinge"),
        (r"SUBJECT(?:goes?|moves?)\s+(?:to\s+)?(\w+)\s+(?:at|after|in)\s+([^,]+)",
         "{0} moves to {1} at {2}"),
        (r"SUBJECTmoves?\s+at\s+(.+?)\s+to\s+(\w+)", "{0} moves to {2} at {1}"),
        (r"SUBJECTmoves?\s+to\s+(\w+)$", "{0} moves to {1} at 8 s"),
        (r"SUBJECTstays?\s+(\w+)\s+until\s+(.+)", "{0} moves to {1} at 0 s, and to another at {2}"),
        (r"SUBJECTtoggles?\s", "{0} toggles between closed and open every 30 s"),
        (r"SUBJECT(?:walks?|moves along)\s", "{0} walks along (0 m, 1 m), (2 m, 1 m) of hall"),
    )
)  # fmt: skip
"""Patterns of sentences of others, and the ones that they mean."""


class _SceneryLanguage(Language):
    words = _READABLE
    token = re.compile(r"\w+|\S")

    @functools.cached_property
    def _keywords(self) -> list[str]:
        return keywords_of(_GRAMMAR.read_text("utf-8"))

    def statement_starts(self, text: str) -> Sequence[int]:
        return [match.start() for match in _STATEMENT_START.finditer(without_comments(text))]

    def phrases(self, fault: SyntaxFault) -> Sequence[str]:
        """Return the expectations in words, words before signs."""
        keys = [key for key in fault.expected if key not in _OTHER_FORMS]
        if "toggles" in keys:
            keys = [key for key in keys if key not in _VERBS] + ["verb"]
        phrases = dict.fromkeys(self.words.get(key, f'"{key}"') for key in keys)
        return sorted(phrases, key=lambda phrase: not phrase.strip('"')[:1].isalnum())

    def message(self, fault: SyntaxFault) -> str:
        word = _quoted(fault.word) if fault.word else "the end of the file"
        phrases = self.phrases(fault)
        if not phrases:
            return f"{word} {'cannot be a name' if _is_reserved(fault) else 'is not expected'}"
        more = len(phrases) - _MOST_WORDS
        phrases = [*phrases[:_MOST_WORDS], f"{more} more words"] if more > 1 else phrases
        return f"expected {enumerate_words(phrases, 'or')}, found {word}"

    def hint(self, fault: SyntaxFault) -> str:
        """Compare the word with the expected ones, and the first word of its line with openings."""
        expected = self.phrases(fault)
        if not expected and _is_reserved(fault):
            return "choose another name"
        if fault.word == "#":
            return "comments start with //"
        if fault.word in ("+", "*", "/"):
            return "only the braces of a loop calculate: {1.5 * i} m"
        if re.search(r"\d,\d[^,()]*$", fault.done):
            return "write decimals with a point: 1.5, not 1,5"
        unitless = _UNITLESS.search(fault.done)
        if unitless is not None:
            return f"a unit is missing after {unitless[0]}"
        unit = _UNIT.search(fault.done)
        if unit is not None and unit[2] not in UNIT_WORDS and unit[2] not in self._keywords:
            return f'"{unit[2]}" is read as the unit of {unit[1]}, which is unknown'
        line = fault.text[fault.text.rfind("\n", 0, fault.offset) + 1 : fault.offset]
        first = re.match(r"\s*(\w+)", line)
        candidates = [
            (fault.word, [word.strip('"') for word in expected]),
            (first[1] if first else "", list(_STARTERS)),
        ]
        for word, choices in candidates:
            if len(word) < 3 or word in choices:
                continue
            if word.lower() in choices:
                return f'write "{word.lower()}" in lower case'
            close = difflib.get_close_matches(word, choices, 1, 0.75)
            if close:
                return f'did you mean "{close[0]}"?'
        sentence = (line + fault.rest.partition("\n")[0]).partition("//")[0].strip()
        meant = ((pattern.match(sentence), hint) for pattern, hint in _MEANT)
        return next((hint.format(*found.groups()) for found, hint in meant if found), "")


def _is_reserved(fault: SyntaxFault) -> bool:
    return fault.word in (*_STARTERS, "except")


def _quoted(word: str) -> str:
    return f"'{word}'" if word == '"' else f'"{word}"'


_LANGUAGE: Final = _SceneryLanguage(_GRAMMAR, autokwd=True)


def load_scenery(path: str | Path) -> SceneryLayer:
    """Read a ``.scenery`` file; raises :class:`InputError` with all its problems."""
    return parse_scenery(read_text(path), str(path))


def parse_scenery(text: str, file: str, within: Where | None = None) -> SceneryLayer:
    """Read the text of a layer; ``file`` is the name used in messages, its stem names the layer.

    ``within`` is the place of a text that is part of another file. Raises :class:`InputError` with
    all problems, but only one syntax error per statement.
    """
    source = repeated(SourceText(text, file, within=within))
    reader = SceneryReader(source)
    # An empty text gives no tree.
    nodes = getattr(_LANGUAGE.parse_sound(source, reader), "statements", ())
    values: list[_Part] = reader.read_all(nodes, partial(_part, source.text))
    _check_names(reader, values)
    reader.raise_errors()
    return SceneryLayer(
        name=Path(file).name.removesuffix(".scenery"),
        file=file,
        models=tuple(v for v in values if isinstance(v, ObjectModel)),
        instances=tuple(v for v in values if isinstance(v, Instance)),
        groups=tuple(v for v in values if isinstance(v, Group)),
        parameters=tuple(v for v in values if isinstance(v, Parameter)),
        settings=tuple(v for v in values if isinstance(v, Setting)),
        sentences=tuple(v for v in values if isinstance(v, Sentence)),
    )


def _part(text: str, reader: SceneryReader, node: SyntaxNode) -> _Part:
    match rule_of(node):
        case "Object":
            return read_object(reader, node)
        case "ObjectGroup":
            part: Group | Parameter | Instance | Setting | Sentence
            part = Group(node.name, reader.subject(node.members), reader.where(node))
        case "Parameter":
            part = Parameter(node.name, reader.measure(node.value), reader.where(node))
        case _:
            part = read_sentence(reader, node)
    source = text[node._tx_position : node._tx_position_end]
    return replace(part, text=_SPACE.sub(lambda space: space[1] or " ", source))


def _check_names(reader: SceneryReader, values: Sequence[_Part]) -> None:
    places: dict[str, Where] = {}
    for value in values:
        if isinstance(value, ObjectModel | Instance | Group | Parameter):
            if value.name in places:
                hint = f"first used at {places[value.name]}"
                reader.error(value.where, f'the name "{value.name}" is already used', hint)
            places.setdefault(value.name, value.where)
