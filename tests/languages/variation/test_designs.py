"""Designs besides random: what they cover, and what becomes of points that are rejected."""

from itertools import islice, product

import pytest

from grammars.text.diagnostics import InputError
from grammars.variation import Normal, Range, sample
from grammars.variation.designs import halton_points, latin_hypercubes, points_at
from tests.languages.variation.plans import numbers, vary

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
    found = rows(variation, "grid", levels=2)
    gaps, turns, shifts = (0.8, 0.9, 1.0), (0.0, 90.0), (-0.5, 0.0, 0.5)
    widths = sorted({row[2] for row in found})
    assert len(widths) == 2
    assert sum(widths) == pytest.approx(6.0)
    assert found == list(product(gaps, turns, widths, shifts))


def test_a_design_of_one_draw_is_its_levels(tmp_path):
    alone = vary(tmp_path, "gap: uniform([0.8, 0.9, 0.8])")
    assert rows(alone, "grid") == [(0.8,), (0.9,)]


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
    found = [numbers(v)["gap"] for v in variants]
    assert len(found) == 12
    assert min(found) > 1.0
    assert set(found) >= {gap for gap in points if gap > 1.0}
    if method != "random":
        # Every point keeps the seed that it has without the requirement.
        kept = {k: gap for k, gap in enumerate(points) if gap > 1.0}
        assert {v.seed: numbers(v)["gap"] for v in variants if v.seed < 12} == kept


def test_the_header_says_which_design_it_was(variation):
    variants = sample(variation, 3, seed=5, method="lhs")
    assert [v.text.splitlines()[1] for v in variants] == [
        f"// Seed: {5 + k}, lhs design 5" for k in range(3)
    ]


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
