"""Variations of floor plans: what distributions, draws and requirements mean; variants as files."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grammars.floorplan import load_floorplan
from grammars.text.diagnostics import InputError
from grammars.variation import (
    load_variation,
    parse_variation,
    sample,
    write_variants,
)
from grammars.variation._distributions import Categorical, Normal, Range
from tests.languages.plans import HOUSE, answers, numbers, one_variant, vary


def test_draws_are_taken_in_file_order(tmp_path):
    statements = """
        gap: uniform([1.0, 2.0, 3.0])
        pane: { location.translation.x: normal(mean=0.5, std=0.1)
                location.translation.z: discrete([(0.25, 1.0), (0.75, 1.2)]) }
        let far = uniform(1 .. 2)
        hall.screen: { height: far }
        turn: normal(mean=10, std=2, min=0)
    """
    stream = np.random.RandomState(7)
    expected = [[1.0, 2.0, 3.0][stream.randint(0, 3)], round(stream.normal(0.5, 0.1), 2)]
    expected.append(stream.choice([1.0, 1.2], 1, p=[0.25, 0.75])[0])
    expected.append(round(1 + stream.random_sample(), 4))
    actual = [value.number for value in one_variant(tmp_path, statements).values]
    assert actual[:3] == expected[:3]
    assert actual[3] == actual[4] == pytest.approx(expected[3])
    assert actual[5] > 0.0


@given(st.floats(0.0, 1.0, exclude_max=True), st.floats(-9, 9), st.floats(1e-6, 20))
def test_a_range_is_never_left(share, low, width):
    assert low <= Range(low, low + width).at(share) <= low + width


limits = st.tuples(st.floats(-4, 4), st.floats(0.01, 4))


@given(limits, st.floats(0.001, 3.0))
def test_a_cut_normal_has_the_quantiles_of_the_cut_curve(limits, std):
    low, high = limits[0], limits[0] + limits[1]
    normal = Normal(1.0, std, 1.0 + low * std, 1.0 + high * std)
    values = [normal.at(share) for share in (0.0, 0.2, 0.5, 0.8, 1.0)]
    assert values == sorted(values)
    assert values[0] >= normal.low
    assert values[-1] <= normal.high

    def below(z):
        return 0.5 * math.erfc(-z / math.sqrt(2))

    half = (below((values[2] - 1.0) / std) - below(low)) / (below(high) - below(low))
    assert half == pytest.approx(0.5, abs=0.02)


def test_weights_are_shares_of_the_quantiles():
    choice = Categorical((5.0, 2.0, 7.0), (0.5, 0.2, 0.3))
    assert [choice.at(q) for q in (0.0, 0.49, 0.5, 0.69, 0.71, 0.999)] == [5, 5, 2, 2, 7, 7]


def test_a_shared_draw_is_one_draw(tmp_path):
    statements = """
        let wide = uniform(0.6 m .. 1.2 m)
        door: { shape.width: wide }
        pane: { shape.width: 2 * wide - 0.1 m }
    """
    for variant in sample(vary(tmp_path, statements), 5, seed=0):
        actual = numbers(variant)
        assert actual["door.shape.width"] == actual["wide"]
        assert actual["pane.shape.width"] == pytest.approx(2 * actual["wide"] - 0.1)
        widths = {o.name: o.width for o in variant.plan.openings}
        assert widths["door"] == pytest.approx(actual["wide"])


def test_a_draw_without_a_unit_takes_that_of_its_place(tmp_path):
    statements = "let k = uniform([45]) turn: k pane: {location.rotation.y: k / 90}"
    variant = one_variant(tmp_path, statements)
    assert [(v.number, v.unit) for v in variant.values] == [(45, ""), (45, "deg"), (0.5, "rad")]


def test_angles_are_converted_to_the_unit_of_the_plan(tmp_path):
    statements = "let half = uniform([0.25 rad]) turn: 2 * half"
    assert numbers(one_variant(tmp_path, statements))["turn"] == pytest.approx(math.degrees(0.5))


def test_a_rejected_draw_is_followed_by_the_next_of_its_stream(tmp_path):
    free = "gap: uniform(0.5 .. 1.5)"
    stream = np.random.RandomState(3)
    draws = [round(0.5 + stream.random_sample(), 4) for _ in range(50)]
    (variant,) = sample(vary(tmp_path, f"{free} require gap > 1.2"), 1, seed=3)
    assert variant.tries == next(k for k, v in enumerate(draws, 1) if v > 1.2)
    assert numbers(variant)["gap"] == pytest.approx(draws[variant.tries - 1])


def test_a_requirement_is_judged_on_the_sampled_plan(golden, tmp_path):
    def judge(text):
        variation = vary(tmp_path, f"hall.screen: {{height: uniform([1])}}\nrequire {text}")
        try:
            return "holds" if sample(variation, 1, seed=0, tries=1) else ""
        except InputError as error:
            assert str(error.findings[-1]).endswith(f":3:1: rejected 1 times: require {text}")
            return "fails"

    golden("tables/requirements.txt", answers("tables/requirements.txt", judge))


def test_what_nothing_fulfils_is_told_with_what_rejected_how_often(tmp_path):
    statements = """gap: uniform(0.5 .. 1.5)
require gap > 1 m
require gap <= 1 m
require door.width > 0"""
    with pytest.raises(InputError) as caught:
        sample(vary(tmp_path, statements), 3, seed=7, tries=100)
    first, *reasons = [str(d) for d in caught.value.findings]
    assert first.startswith("test.variation:1:1: seed 7: none of 100 draws fulfils all")
    assert len(reasons) == 2
    counts = {r.rsplit(": ", 1)[1]: int(r.split("rejected ")[1].split()[0]) for r in reasons}
    assert set(counts) == {"require gap > 1 m", "require gap <= 1 m"}
    assert sum(counts.values()) == 100


def test_a_draw_without_a_meaning_is_drawn_again(tmp_path):
    variation = vary(tmp_path, "room: {shape.width: normal(mean=0, std=1)}")
    variants = sample(variation, 8, seed=0)
    assert all(numbers(v)["room.shape.width"] > 0 for v in variants)
    assert any(v.tries > 1 for v in variants)


def test_a_plan_that_never_compiles_is_explained_at_its_line(tmp_path):
    variation = vary(tmp_path, "room: {shape.width: uniform([-1, -2])}")
    with pytest.raises(InputError) as caught:
        sample(variation, 1, seed=0, tries=10)
    line = 1 + HOUSE[: HOUSE.index("width=3.0")].count("\n")
    reason = caught.value.findings[1]
    assert (reason.where.line, reason.message[:17]) == (line, "rejected 10 times")
    assert "must be positive" in reason.message


def test_equal_features_in_two_spaces_are_told_apart(tmp_path):
    plan = HOUSE.replace("Column post", "Column pillar")
    variant = one_variant(tmp_path, "closet.pillar: {height: uniform([1.25])}", plan)
    assert {(f.space, f.name): f.height for f in variant.plan.features} == {
        ("hall", "pillar"): 2.5,
        ("hall", "screen"): 1.0,
        ("closet", "pillar"): 1.25,
    }


def test_keywords_may_be_names(tmp_path):
    plan = HOUSE.replace("gap", "let").replace("turn", "require").replace("reach", "uniform")
    plan = plan.replace("door", "normal").replace("room", "import").replace("pane", "m")
    statements = """
        let : uniform([1.0]) require: uniform([5]) uniform: normal(mean=1, std=0.1)
        let abs = uniform([2])
        import: {shape.width: abs}
        require abs >= 2
        m: {shape.width: uniform([1 m])}
        normal: {shape.width: uniform([0.8])}
        require import.area > 0 require let == 1
    """
    actual = numbers(one_variant(tmp_path, statements, plan))
    assert actual["import.shape.width"] == 2.0
    assert actual["m.shape.width"] == 1.0


def test_variants_are_plans_with_their_own_names(tmp_path):
    (tmp_path / "plan.fpm").write_text(HOUSE)
    path = tmp_path / "house.variation"
    path.write_text('import "plan.fpm" gap: uniform([0.8, 1.0])')
    actual = sample(load_variation(path), 3, seed=20, suffix=True)
    assert [variant.name for variant in actual] == ["house_20", "house_21", "house_22"]
    assert [variant.plan.name for variant in actual] == ["house_20", "house_21", "house_22"]
    assert all(variant.plan.spaces[0].name == "hall" for variant in actual)


def test_the_name_of_the_plan_is_kept_unless_a_suffix_is_wanted(tmp_path):
    variation = vary(tmp_path, "gap: uniform([1.0])")
    assert sample(variation, 1, seed=5)[0].plan.name == "house"
    assert sample(variation, 1, seed=5, suffix=True)[0].plan.name == "house_5"


@pytest.mark.parametrize(("n", "seed"), [(2, 2**32 - 1), (1, -1)])
def test_seeds_out_of_range_are_refused(tmp_path, n, seed):
    variation = vary(tmp_path, "gap: uniform([1.0])")
    with pytest.raises(ValueError, match="between"):
        sample(variation, n, seed=seed)


def test_files_are_named_after_plan_and_seed_and_load_again(tmp_path):
    variants = sample(vary(tmp_path, "gap: uniform(0.5 .. 1)"), 3, seed=8)
    written = write_variants(variants, tmp_path / "new" / "folder")
    assert [w.path.name for w in written] == ["house_8.fpm", "house_9.fpm", "house_10.fpm"]
    assert [w.outcome for w in written] == ["written"] * 3
    for entry, variant in zip(written, variants, strict=True):
        assert load_floorplan(entry.path) == variant.plan
        assert (entry.seed, entry.values) == (variant.seed, variant.values)
    assert len(list((tmp_path / "new" / "folder").iterdir())) == 3


def test_line_ends_and_bytes_are_those_of_the_text(tmp_path):
    plan = "\ufeff" + HOUSE.replace("\n", "\r\n").replace("hall", "büro")
    variants = sample(vary(tmp_path, "gap: uniform([0.75])", plan), 1, seed=8)
    (entry,) = write_variants(variants, tmp_path)
    assert entry.path.read_bytes() == variants[0].text.encode()
    assert b"\r\n" in entry.path.read_bytes()


def test_files_that_exist_are_kept_unless_told(tmp_path):
    variants = sample(vary(tmp_path, "gap: uniform([0.75])"), 2, seed=1)
    (tmp_path / "house_1.fpm").write_text("mine")
    write_variants(variants[1:], tmp_path)
    assert [w.outcome for w in write_variants(variants, tmp_path)] == ["kept", "unchanged"]
    assert (tmp_path / "house_1.fpm").read_text() == "mine"
    again = write_variants(variants, tmp_path, overwrite=True)
    assert [w.outcome for w in again] == ["overwritten", "unchanged"]
    assert (tmp_path / "house_1.fpm").read_text() == variants[0].text


def test_the_plan_itself_is_never_overwritten(tmp_path):
    source = tmp_path / "house_3.fpm"
    source.write_text(HOUSE)
    path = tmp_path / "house.variation"
    path.write_text('import "house_3.fpm" gap: uniform([0.75])')
    variation = load_variation(path)
    variants = sample(variation, 1, seed=3)
    with pytest.raises(InputError, match="is the plan itself"):
        write_variants(variants, tmp_path, overwrite=True, source=variation.plan_file)
    assert source.read_text() == HOUSE


def test_files_and_folders_that_cannot_be_used_are_named(tmp_path):
    variants = sample(vary(tmp_path, "gap: uniform([0.75])"), 1, seed=1)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"file: cannot be written"):
        write_variants(variants, tmp_path / "file")
    with pytest.raises(InputError, match=r"none\.variation: no such file"):
        load_variation(tmp_path / "none.variation")
    (tmp_path / "bad.variation").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"bad\.variation: the variation is not UTF-8"):
        load_variation(tmp_path / "bad.variation")
    with pytest.raises(InputError, match='did you mean "plan.fpm"'):
        parse_variation('import "pl\0an.fpm" gap: uniform([1])', "test.variation", tmp_path)
