"""Variants by every design: what they cover, and plans that are sound."""

from itertools import islice, product

import pytest

from grammars.text.diagnostics import InputError, Severity
from grammars.variation import sample, source_defects
from grammars.variation._distributions import Normal, Range
from grammars.variation.designs import halton_points, latin_hypercubes, points_at
from tests.languages.plans import answers, model_text, numbers, vary

FOUR = """
    gap: uniform([0.8, 0.9, 1.0])
    turn: uniform(0 .. 90)
    room: { shape.width: normal(mean=3, std=0.5)
            location.translation.x: uniform([-0.5, 0, 0.5]) }
"""


@pytest.fixture
def variation(tmp_path):
    return vary(tmp_path, FOUR)


def rows(variation, method, n=None, **options):
    variants = sample(variation, n, seed=1, method=method, **options)
    return [tuple(numbers(v).values()) for v in variants]


def test_the_grid_is_every_combination_once(variation):
    actual = rows(variation, "grid", levels=2)
    gaps, turns, shifts = (0.8, 0.9, 1.0), (0.0, 90.0), (-0.5, 0.0, 0.5)
    widths = sorted({row[2] for row in actual})
    assert len(widths) == 2
    assert sum(widths) == pytest.approx(6.0)
    assert actual == list(product(gaps, turns, widths, shifts))


def test_a_design_of_one_draw_is_its_levels(tmp_path):
    alone = vary(tmp_path, "gap: uniform([0.8, 0.9, 0.8])")
    assert rows(alone, "grid") == [(0.8,), (0.9,)]
    never = vary(tmp_path, "gap: discrete([(0.0, 0.8), (1.0, 0.9)])")
    assert rows(never, "grid") == [(0.9,)]


def test_halton_and_latin_hypercubes_fill_every_range_evenly():
    axes = [Range(0.0, 8.0), Range(-1.0, 1.0), Normal(0.0, 1.0)]
    points = list(islice(points_at(axes, latin_hypercubes(3, 8, seed=3)), 8))
    assert sorted(int(p[0]) for p in points) == list(range(8))
    assert sorted(int((p[1] + 1) * 4) for p in points) == list(range(8))
    first = list(islice(points_at(axes, halton_points(3, seed=3)), 64))
    counts = [sum(k <= p[0] < k + 1 for p in first) for k in range(8)]
    assert counts == [8] * 8
    assert -0.3 < sum(p[2] for p in first) / 64 < 0.3


def test_points_that_are_rejected_leave_their_seeds_out(tmp_path):
    variation = vary(tmp_path, "gap: uniform([0.8, 0.9, 1.0]) require gap != 0.9 m")
    variants = sample(variation, seed=10, method="grid")
    assert [(v.seed, numbers(v)["gap"]) for v in variants] == [(10, 0.8), (12, 1.0)]


@pytest.mark.parametrize("method", ["random", "halton", "lhs"])
def test_a_rejected_point_is_followed_by_the_next(tmp_path, method):
    anything = vary(tmp_path, "gap: uniform(0.5 .. 1.5)")
    points = [numbers(v)["gap"] for v in sample(anything, 12, seed=0, method=method)]
    variation = vary(tmp_path, "gap: uniform(0.5 .. 1.5) require gap > 1 m")
    variants = sample(variation, 12, seed=0, method=method)
    actual = [numbers(v)["gap"] for v in variants]
    assert len(actual) == 12
    assert min(actual) > 1.0
    assert set(actual) >= {gap for gap in points if gap > 1.0}
    if method != "random":
        # Every point keeps the seed that it has without the requirement.
        kept = {k: gap for k, gap in enumerate(points) if gap > 1.0}
        assert {v.seed: numbers(v)["gap"] for v in variants if v.seed < 12} == kept


@pytest.mark.parametrize("method", ["random", "grid", "halton", "lhs"])
def test_a_design_nothing_is_left_of_says_why(tmp_path, method):
    variation = vary(tmp_path, "gap: uniform(0.5 .. 1.5) turn: uniform([1, 2]) require gap > 2")
    with pytest.raises(InputError) as caught:
        sample(variation, 20, seed=0, method=method, tries=5)
    assert any("rejected" in d.message and "gap > 2" in d.message for d in caught.value.findings)


def test_a_design_with_more_points_than_wanted_is_refused(variation):
    with pytest.raises(InputError, match="the grid has more than 20 variants"):
        sample(variation, 20, seed=0, method="grid")


def test_an_enormous_grid_is_refused(tmp_path):
    statements = "gap: uniform(0.8 .. 1) turn: uniform(0 .. 1) reach: uniform(-2 .. -1)"
    with pytest.raises(InputError, match="1,000,000 points"):
        sample(vary(tmp_path, statements), seed=0, method="grid", levels=100)


SOUND = model_text("sound.fpm")


def check(folder, statements):
    variation = vary(folder, statements, SOUND)
    sample(variation, 1, seed=0, tries=2, check=0.3)
    return variation


def test_plans_are_kept_if_they_are_sound(golden, tmp_path):
    def judge(statements):
        try:
            check(tmp_path, statements)
        except InputError as error:
            return " | ".join(str(finding) for finding in error.findings[1:])
        return "sound"

    table = answers("tables/variants.txt", judge).replace(f"{tmp_path}/", "")
    golden("tables/variants.txt", table)


def test_defects_of_the_source_may_stay_but_are_said(tmp_path):
    warnings = source_defects(check(tmp_path, "shift: uniform([0.1])"), 0.3)
    assert [w.message for w in warnings] == ["c cannot be reached with a radius of 0.3 m"]
    assert all(w.severity is Severity.WARNING for w in warnings)


def test_an_overlap_of_the_source_may_stay_but_not_grow(tmp_path):
    overlapping = SOUND.replace("y: -10 m", "y: -3 m")
    statements = "c: {{location.translation.y: uniform([{}])}}"
    same = vary(tmp_path, statements.format(-3.2), overlapping)
    assert sample(same, 1, seed=0, check=0.3)
    worse = vary(tmp_path, statements.format(-2.5), overlapping)
    with pytest.raises(InputError, match='"c" and "a" overlap'):
        sample(worse, 1, seed=0, tries=1, check=0.3)
