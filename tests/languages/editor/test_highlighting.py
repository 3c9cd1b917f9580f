"""The TextMate grammars know every word of the languages and colour what is written as meant."""

import re

import pytest

from grammars.editor.oracles import literals
from grammars.text.units import UNIT_WORDS
from tests.languages.editor.textmate import SYNTAXES, grammar, tokens

COLOURED = ("keyword", "support", "constant.language", "variable.language")

EXPRESSIONS = ("grammars.text", "expressions.tx")
LANGUAGES = {
    "fpm": [("grammars.floorplan", "floorplan.tx")],
    "scenery": [("grammars.scenery", "scenery.tx")],
    "variation": [("grammars.variation", "variation.tx"), EXPRESSIONS],
    "oracle": [("grammars.oracle", "oracle.tx"), EXPRESSIONS],
}

CONTEXT = {
    # Words that are keywords only in their place: an example of it.
    ("fpm", "var"): "var a = 1 m",
    ("fpm", "Space"): "Space hall:",
    ("fpm", "Column"): "Column pillar:",
    ("fpm", "Divider"): "Divider board:",
    ("fpm", "Entryway"): "Entryway door:",
    ("fpm", "Window"): "Window view:",
    ("fpm", "width"): "Rectangle width=1 m",
    ("fpm", "length"): "length = 2 m",
    ("fpm", "radius"): "Circle radius=2 m",
    ("scenery", "object"): "object door",
    ("scenery", "mover"): "mover person",
    ("scenery", "link"): "link leaf",
    ("scenery", "joint"): "joint hinge",
    ("scenery", "state"): "state open: hinge 95 deg",
    ("scenery", "group"): "group doors: a, b",
    ("scenery", "parameter"): "parameter swing = 60 deg/s",
    ("scenery", "walls"): "hall.walls[1]",
    ("scenery", "waypoint"): "waypoint kitchen is reached",
    ("variation", "import"): 'import "flat.fpm"',
    ("variation", "let"): "let a = uniform(1 .. 2)",
    ("oracle", "reached"): "reached(mission, 0.3 m)",
    ("oracle", "mission"): "reached(mission, 0.3 m)",
}

ORACLE_WORDS = ("and", "or", "not", "when", "within", "until", "on", "leg")


def example(language, word):
    """Return the word where the language has it."""
    if (language, word) in CONTEXT:
        return CONTEXT[language, word]
    return {
        "fpm": f"{word}: ",
        "oracle": f"{word} " if word in ORACLE_WORDS else f"{word}(a)",
        "variation": f"{word}(1)",
    }.get(language, f"a {word} b")


def words_of(language):
    """Return every word the textX grammar spells out, once."""
    rules = [words for grammar in LANGUAGES[language] for words in literals(*grammar).values()]
    return sorted({word for words in rules for word in words if word[0].isalpha()})


@pytest.mark.parametrize(
    ("language", "word"), [(lang, word) for lang in LANGUAGES for word in words_of(lang)]
)
def test_every_keyword_of_a_language_is_coloured(language, word):
    found = [t for t in tokens(example(language, word), language) if t.text == word]
    assert found, f"{SYNTAXES / language}.tmLanguage.json: {word!r} is no token of its own"
    assert any(scope in found[0] for scope in COLOURED), found[0]


PLACES = {
    "fpm": "var a = 3 {}",
    "scenery": "parameter a = 3 {}",
    "variation": "require 3 {} > a",
    "oracle": "always(a > 3 {})",
}


@pytest.mark.parametrize("language", PLACES)
@pytest.mark.parametrize("unit", [*UNIT_WORDS, "N m", "m/s^2", "N*m*s/rad", "m²", "°/s"])
def test_every_unit_is_coloured_in_every_language(language, unit):
    found = [t for t in tokens(PLACES[language].format(unit), language) if t.text == unit]
    assert found
    assert "keyword.other.unit" in found[0]


def test_the_words_of_a_grammar_are_read_without_its_comments():
    rules = literals("grammars.oracle", "oracle.tx")
    assert rules["TemporalOperator"] == ("always", "never", "eventually")
    assert "p95" in rules["StatisticOperator"]
    assert all("0.35" not in word for words in rules.values() for word in words)


def shipped(campaigns):
    files = [p for end in ("fpm", "scenery", "variation") for p in campaigns.glob(f"*/*.{end}")]
    return sorted(files)


def test_every_character_of_the_shipped_files_is_in_one_token(campaigns):
    files = shipped(campaigns)
    assert {p.suffix for p in files} >= {".fpm", ".scenery"}
    for path in files:
        lines = path.read_text().splitlines()
        rebuilt = [""] * len(lines)
        for token in tokens(path.read_text(), path.suffix[1:]):
            assert token.start == len(rebuilt[token.line - 1])
            rebuilt[token.line - 1] += token.text
        assert rebuilt == lines


def test_nothing_but_white_space_stays_plain_in_the_shipped_files(campaigns):
    for path in shipped(campaigns):
        found = tokens(path.read_text(), path.suffix[1:])
        plain = {t.text.strip() for t in found if len(t.scopes) == 1}
        assert plain <= {""}, path


def test_all_numbers_of_the_shipped_files_are_numbers(campaigns):
    for path in shipped(campaigns):
        for token in tokens(path.read_text(), path.suffix[1:]):
            if re.fullmatch(r"[-+]?\d[\d.]*", token.text):
                assert "constant.numeric" in token, (path, token)


def scoped(text, language):
    return {t.text: t for t in tokens(text, language)}


def test_a_floor_plan_shows_definitions_references_and_units():
    found = scoped(
        "Entryway door:  // in the hall\n    location: in: hall.walls[1] and this.walls[0]\n"
        "        translation: x: -1.7 m, z: door_middle",
        "fpm",
    )
    assert "keyword.declaration" in found["Entryway"]
    assert "entity.name.type.opening" in found["door"]
    assert "comment.line" in found["// in the hall"]
    assert "variable.other.reference" in found["hall"]
    assert "keyword.other.walls" in found["walls"]
    assert "constant.numeric" in found["-1.7"]
    assert "keyword.other.unit" in found["m"]
    assert "keyword.other.axis" in found["z"]
    assert "variable.other.reference" in found["door_middle"]


def test_a_sentence_of_scenery_shows_who_does_what():
    found = scoped(
        "kitchen_door is a hinged_door in kitchen_doorway, hinge left, opening into kitchen\n"
        "all doors go from open to closed when the robot is within 1.2 m of their doorway,\n"
        "    by servo at 90 deg/s with 20 N m",
        "scenery",
    )
    assert "entity.name.type.instance" in found["kitchen_door"]
    assert "support.class.model" in found["hinged_door"]
    assert "variable.other.place" in found["kitchen_doorway"]
    assert "constant.language" in found["left"]
    assert "variable.other.reference" in found["kitchen"]
    assert "keyword.control.quantifier" in found["all"]
    assert "keyword.control.verb" in found["go"]
    assert "variable.other.reference" in found["closed"]
    assert "support.function.motion" in found["servo"]
    assert "keyword.other.unit" in found["deg/s"]
    assert "keyword.other.unit" in found["N m"]


def test_names_that_begin_like_keywords_are_names():
    for name in ("opening_time", "atrium", "isle", "minute_hand", "x2"):
        assert "variable.other" in scoped(f"a stays {name}", "scenery")[name]
    assert "variable.other" in scoped("wrt: walls_of_glass", "fpm")["walls_of_glass"]
    assert "variable.other" in scoped("never(time-close > 1)", "oracle")["time-close"]


def test_parts_may_be_called_like_keywords():
    found = tokens("joint hinge revolute from post to leaf\nstate open: hinge 95 deg", "scenery")
    called = [t for t in found if t.text in ("hinge", "leaf")]
    assert len(called) == 3
    assert not any("keyword" in t for t in called)


def test_a_variation_shows_targets_draws_and_ranges():
    found = scoped(
        'import "flat.fpm"\nlet slack = uniform(0 m .. 0.25 m)\n'
        "hall.pillar: { location.translation.x: normal(mean=1.6, std=0.5) }\n"
        "require distance(hall.pillar, door) >= 12 m^2",
        "variation",
    )
    assert "string.quoted" in found['"flat.fpm"']
    assert "entity.name.variable" in found["slack"]
    assert "support.function.distribution" in found["uniform"]
    assert "keyword.operator.range" in found[".."]
    assert "entity.name.tag.target" in found["location.translation.x"]
    assert "variable.parameter" in found["mean"]
    assert "support.function.arithmetic" in found["distance"]
    assert "keyword.operator.comparison" in found[">="]
    assert "keyword.other.unit" in found["m^2"]


def test_an_oracle_shows_operators_signals_and_limits():
    found = scoped("max(door-17.angle) <= 0.8 m/s when not contact and speed > 5 %", "oracle")
    assert "support.function" in found["max"]
    assert "variable.other.signal" in found["door-17.angle"]
    assert "keyword.operator.comparison" in found["<="]
    assert "keyword.other.unit" in found["m/s"]
    assert "keyword.operator.word" in found["when"]
    assert "keyword.operator.word" in found["not"]
    assert "keyword.other.unit" in found["%"]


def test_oracle_lines_are_coloured_inside_yaml(campaigns):
    for path in sorted(campaigns.glob("*/*.oracles.yaml")):
        lines = [x for x in path.read_text().splitlines() if x and not x.startswith("#")]
        for line in lines:
            found = [t for t in tokens(line, "oracles.injection") if "meta.embedded" in t]
            assert "".join(t.text for t in found) == line.partition(": ")[2]
            first = found[0]
            assert "keyword.control.temporal" in first or any("support" in s for s in first.scopes)


@pytest.mark.parametrize("line", ["name: max", "about: always be kind", "x: [max, min]"])
def test_other_yaml_is_left_alone(line):
    assert not [t for t in tokens(line, "oracles.injection") if "meta.embedded" in t]


def test_oracles_are_not_looked_for_inside_oracles():
    # Without its own scope left out, the injection matches again where it began, for ever.
    selector = grammar("oracles.injection")["injectionSelector"]
    assert selector.startswith("L:source.yaml")
    for left_out in ("comment", "string", "meta.embedded.inline.oracle"):
        assert f" - {left_out}" in selector


def test_a_comment_behind_an_oracle_is_left_to_yaml():
    found = tokens("a: never(contact)  # not even gently", "oracles.injection")
    assert [t.text for t in found if "meta.embedded" in t] == ["never", "(", "contact", ")"]


def test_scopes_end_with_their_language():
    for path in sorted(SYNTAXES.glob("*.json")):
        language = path.name.removesuffix(".tmLanguage.json")
        if language == "oracles.injection":
            continue
        names = re.findall(r'"name": "([^"]+)"', path.read_text())
        assert grammar(language)["name"] == names[0]
        assert all(name.endswith(f".{language}") for name in names[1:]), path
