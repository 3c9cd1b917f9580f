"""Damaged variations, and variations of damaged plans, are answered and never crashed on."""

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.floorplan import parse_floorplan
from grammars.text.diagnostics import InputError
from grammars.variation import parse_variation, sample
from tests.languages.variation.plans import HOUSE

SEED = """// a comment
import "plan.fpm"
let wide = uniform(0.6 m .. 1.2 m)
let k = normal(mean=1, std=0.1, min=0.8)
gap: uniform([0.8, 0.9, 1.0])
turn: discrete([(0.7, 10.0), (0.2, 20.0), (0.1, 30)])
hall: {
    location.translation.x: normal(mean=0.0, std=0.5)
    location.rotation.z: uniform(-10 deg .. 10 deg)
    defaults.wall.thickness: uniform(0.1 .. 0.3)
}
hall.pillar: { shape.radius: k / 4  height: 2 * wide - 0.1 m }
door: { shape.width: wide }
require room.area >= 2 m^2
require abs(hall.location.translation.x) < max(1, 2 m)
require distance(hall.pillar, door) - 0.1 > 0 m
require (door.width + gap) * 2 / gap != 1
"""
TOKENS = re.findall(r"\w+(?:\.\w+)*|\s+|\.\.|[<>=!]=|[^\w\s]", SEED)
STRAYS = [
    "let", "require", "import", "uniform", "discrete", "normal", "(", ")", "[", "]", "{", "}",
    "..", ".", ",", ":", "=", "<=", "-", "+", "*", "/", "m", "deg", "m^2", "mean", "min", "0", "-1",
    "1e999", "1e-320", "99999999999999", ".5", "5.", "1..2", "hall", "room.area", "gap", "turn",
    "distance", "abs", "//", "\n", "#", "\0", "ü", "\u2028", "\r", '"', "'", '"plan.fpm"',
    "shape.width", "location.translation.y", "\N{ARABIC-INDIC DIGIT THREE}", "@", "let x = ",
]  # fmt: skip
METHODS = ("random", "lhs", "halton")
NAMED = """
Floor plan: house
    Defaults: walls: thickness: 0.2 m height: 2.5 m
    var turn = 30.0 deg
    var gap = 0.9 m
    Space hall:
        shape: Rectangle width=6 m, length=4.0 m
        location: wrt: world of: this translation: x: 0 m rotation: z: turn
        walls: thickness: 0.2 m
        features: Column pillar: shape: Circle radius=0.2 m height: 2.5
            location: wrt: this.walls[1] translation: y: -1.0 m
    Space room:
        shape: Rectangle width=3.0 m, length=gap
        location: wrt: hall.walls[1] of: this.walls[3] translation: x: 0.25 m spaced
    Entryway door: shape: Rectangle width=gap, height=2 m
        location: in: hall.walls[1] and room.walls[3]
"""
"""What the seed names of the house, and no more: read twice for each mutation of the seed."""
PLAN_TOKENS = re.findall(r"\w+(?:\.\w+)?|\s+|[^\w\s]", HOUSE)


def kind(token):
    """Return what sort of token it is: those of one sort may stand for each other."""
    if token.isspace():
        return "blank"
    if token[0].isdigit():
        return "number"
    return "name" if token[0].isalpha() else token


def damaged(rng, source, damages):
    """Return the text of ``source`` after some changes, half of them to tokens of one sort."""
    tokens = list(source)
    for _ in range(damages):
        at, other = rng.randrange(len(tokens)), rng.randrange(len(tokens))
        match rng.randrange(10):
            case 0:
                del tokens[at]
            case 1:
                tokens.insert(at, rng.choice(STRAYS))
            case 2:
                tokens[at] = rng.choice(STRAYS)
            case 3:
                tokens[at], tokens[other] = tokens[other], tokens[at]
            case 4:
                tokens[at:at] = tokens[min(at, other) : min(at, other) + rng.randrange(30)]
            case _:
                alike = [t for t in source if kind(t) == kind(tokens[at])]
                tokens[at] = rng.choice(alike or STRAYS)
    return "".join(tokens)


def answers(text, folder):
    """A variation gives plans that parse, or is refused with places and messages."""
    try:
        variation = parse_variation(text, "fuzz.variation", folder)
        method = METHODS[len(text) % len(METHODS)]
        radius = 0.2 if len(text) % 2 else None
        variants = sample(variation, 2, seed=7, tries=8, check=radius, method=method)
    except InputError as refused:
        assert refused.findings
        for diagnostic in refused.findings:
            assert diagnostic.message
            if diagnostic.where.file == "fuzz.variation" and diagnostic.where.line:
                assert diagnostic.where.line <= text.count("\n") + 1
        return False
    for variant in variants:
        assert parse_floorplan(variant.text) == variant.plan
        assert all(-1e7 < value.number < 1e7 for value in variant.values)
    return True


def check(rng, damages, folder):
    (folder / "plan.fpm").write_bytes(NAMED.encode())
    return answers(damaged(rng, TOKENS, damages), folder)


def check_plan(rng, damages, folder):
    (folder / "plan.fpm").write_bytes(damaged(rng, PLAN_TOKENS, damages).encode())
    return answers(SEED, folder)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("fuzz")


@pytest.mark.parametrize("plan", [HOUSE, NAMED])
def test_the_seed_of_the_mutations_gives_variants(folder, plan):
    (folder / "plan.fpm").write_text(plan)
    assert len(sample(parse_variation(SEED, "seed.variation", folder), 3, seed=0)) == 3


@given(rng=st.randoms(use_true_random=False), damages=st.integers(1, 4))
def test_a_damaged_variation_is_answered(folder, rng, damages):
    check(rng, damages, folder)


@given(rng=st.randoms(use_true_random=False), damages=st.integers(1, 3))
def test_a_damaged_plan_is_answered(folder, rng, damages):
    check_plan(rng, damages, folder)


@given(text=st.text(max_size=60), at=st.integers(0, len(SEED)))
def test_any_text_in_a_variation_is_answered(folder, text, at):
    (folder / "plan.fpm").write_bytes(NAMED.encode())
    answers(SEED[:at] + text + SEED[at:], folder)
