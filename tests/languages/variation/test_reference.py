"""Agreement with the published tool: its draws, and the geometry they mean (reference data)."""

import json

import pytest

from grammars.floorplan import parse_floorplan
from grammars.variation import load_variation, sample
from tests.languages.floorplan.test_reference import assert_matches

NAMES = ("kitchen", "hbrs")


@pytest.fixture(scope="module", params=NAMES)
def published(request, reference_data):
    golden = json.loads(
        (reference_data / "goldens" / f"{request.param}.variation.json").read_text()
    )
    return reference_data / "floorplans" / f"{request.param}.variation", golden["variants"]


def drawn(path, seed, count):
    return sample(load_variation(path), count, seed=seed)


def test_every_published_draw_is_reproduced(published):
    path, goldens = published
    variants = drawn(path, goldens[0]["seed"], len(goldens))
    for variant, golden in zip(variants, goldens, strict=True):
        assert variant.seed == golden["seed"]
        assert f"{variant.name}.fpm" == golden["expected_file_name"]
        assert [v.number for v in variant.values] == [s["value"] for s in golden["samples"]]
        assert variant.tries == 1


def test_every_written_plan_has_the_intended_geometry(published):
    path, goldens = published
    for variant, golden in zip(drawn(path, 1000, len(goldens)), goldens, strict=True):
        assert_matches(parse_floorplan(variant.text), golden["intended"])


def test_a_file_depends_on_its_own_seed_only(published):
    path, _ = published
    assert drawn(path, 1000, 5)[3].text == drawn(path, 1003, 1)[0].text
