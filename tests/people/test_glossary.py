"""One word for one thing: what people read uses the words of the glossary and none beside them."""

import json
import re
from pathlib import Path

import pytest

from grammars.text.words import format_quantity
from scenario_tui.cli.commands import COMMANDS, load_command
from scenario_tui.dashboard.key_bindings import list_key_bindings
from scenario_tui.text.styles import GLYPHS

ROOT = Path(__file__).parents[2]
GLOSSARY = ROOT / "docs" / "glossary.md"
_ROW = re.compile(r"^\| ([^|`]+?) \| ([^|]+?) \| ([^|]+?) \|$", re.MULTILINE)
_CODE = re.compile(r"```.*?```|`[^`\n]*`|<!--.*?-->|\]\([^)]*\)", re.DOTALL)
_HYPHENATED = re.compile(r"(?<![\w.\-–])-\d+(\.\d+)? (m|s|rad|%)(?!\w)")


def glossary():
    """Return the words with those that are not used in their place."""
    rows = _ROW.findall(GLOSSARY.read_text("utf-8"))
    return {word: tuple(no.split(", ")) for word, _, no in rows if word not in ("word", "---")}


def pages():
    """Yield the text of every page, without code and addresses."""
    for path in sorted((*(ROOT / "docs").rglob("*.md"), ROOT / "README.md")):
        if path != GLOSSARY:
            yield str(path.relative_to(ROOT)), _CODE.sub("", path.read_text("utf-8"))


def helps():
    """Yield what every command and option says of itself."""

    def walk(name, command):
        yield name, command.help or ""
        for parameter in command.params:
            yield f"{name} {parameter.name}", getattr(parameter, "help", None) or ""
        for word, inner in getattr(command, "commands", {}).items():
            yield from walk(f"{name} {word}", inner)

    for name in COMMANDS:
        yield from walk(f"scenario {name}", load_command(name))


def keys():
    for bound in list_key_bindings():
        yield f"key {bound.id}", bound.meaning


def schemas():
    """Yield what an editor says of every property of a file."""

    def walk(name, part):
        for key, inner in part.items() if isinstance(part, dict) else enumerate(part):
            if key == "description" and isinstance(inner, str):
                yield name, inner
            elif isinstance(inner, dict | list):
                yield from walk(f"{name} {key}", inner)

    for path in sorted((ROOT / "grammars" / "editor" / "schemas").glob("*.json")):
        yield from walk(path.name, json.loads(path.read_text("utf-8")))


TEXTS = (*pages(), *helps(), *keys(), *schemas())


def test_the_texts_are_there():
    names = [name for name, text in TEXTS if text.strip()]
    assert {"README.md", "docs/dashboard.md", "scenario submit", "key retry"} <= set(names)
    assert any(name.startswith("campaign.schema.json") for name in names)
    assert len(names) > 300


@pytest.mark.parametrize("word", glossary())
def test_nothing_is_called_by_another_word(word):
    for other in glossary()[word]:
        wrong = re.compile(rf"\b{re.escape(other)}(s|es)?\b".replace(r"\ ", r"\s+"), re.IGNORECASE)
        found = {name: match[0] for name, text in TEXTS if (match := wrong.search(text))}
        assert found == {}, f"say {word}"


def test_words_stand_in_the_glossary_once_and_none_is_rejected():
    rejected = [other for others in glossary().values() for other in others]
    assert len(rejected) == len(set(rejected))
    assert not set(glossary()) & set(rejected)
    assert {"verdict", "oracle", "unexpected", "lost", "limit", "replay", "filter", "cell",
            "repeat", "margin", "trace"} <= set(glossary())  # fmt: skip


def test_states_and_verdicts_are_shown_by_the_signs_of_the_glossary():
    text = GLOSSARY.read_text("utf-8")
    for word in ("pass", "fail", "inconclusive", "error", "lost"):
        assert f"`{GLYPHS[word]} {word}`" in text
    assert f"`{format_quantity(-0.03124, 'm')}`" in text


def test_numbers_have_a_minus_sign_and_changes_an_arrow():
    hyphens = {name: match[0] for name, text in TEXTS if (match := _HYPHENATED.search(text))}
    assert hyphens == {}
    # Without spaces it is a transform of ROS, such as map->odom.
    assert [name for name, text in TEXTS if re.search(r"->(?!\w)|(?<!\w)->", text)] == []
