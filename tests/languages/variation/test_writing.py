"""Variants as files."""

import pytest

from grammars.floorplan import load_floorplan
from grammars.text.diagnostics import InputError
from grammars.variation import load_variation, sample, write_variants
from tests.languages.variation.plans import HOUSE, vary


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


def test_a_folder_that_cannot_be_written_is_named(tmp_path):
    variants = sample(vary(tmp_path, "gap: uniform([0.75])"), 1, seed=1)
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"file: cannot be written"):
        write_variants(variants, tmp_path / "file")
