"""Oracle layers: YAML files of ``name: oracle``."""

from pathlib import Path

import pytest

from grammars.oracle import load_oracles

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"


def write(folder, text):
    path = folder / "navigation.oracles.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_oracles_keep_the_order_of_the_file(tmp_path):
    path = write(tmp_path, "late: never(contact)\nearly: max(speed)   # a measure\n")
    assert list(load_oracles(path)) == ["late", "early"]
    assert load_oracles(path)["early"].text == "max(speed)"


def test_a_folded_value_is_read_as_one_line(tmp_path):
    path = write(tmp_path, "a: >-\n  always(loc.error <= 1 m)\n  when speed > 0 m/s\n")
    assert load_oracles(path)["a"].guard is not None


@pytest.mark.parametrize("campaign", ["demo", "ortega2024"])
def test_the_layers_that_ship_can_be_read(campaign):
    oracles = load_oracles(CAMPAIGNS / campaign / "navigation.oracles.yaml")
    assert {"reached", "localised", "no-contact"} <= oracles.keys()
    assert not oracles["reached"].is_measure
