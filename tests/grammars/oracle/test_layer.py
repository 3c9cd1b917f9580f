"""Oracle layers: YAML files of ``name: oracle``."""

from pathlib import Path

import pytest

from grammars.oracle import load_oracles
from grammars.text.diagnostics import InputError

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"


def write(folder, text):
    path = folder / "navigation.oracles.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def problems(folder, text):
    with pytest.raises(InputError) as caught:
        load_oracles(write(folder, text))
    return [str(d).replace(f"{folder}/", "") for d in caught.value.diagnostics]


def test_oracles_keep_the_order_of_the_file(tmp_path):
    path = write(tmp_path, "late: never(contact)\nearly: max(speed)   # a measure\n")
    assert list(load_oracles(path)) == ["late", "early"]
    assert load_oracles(path)["early"].text == "max(speed)"


def test_every_problem_of_the_file_is_reported_at_its_place(tmp_path):
    text = "a: always(loc.error <= 1 s)\nb: never(contact)\nc: 3\n'd e': max(speed)\n"
    found = problems(tmp_path, text)
    assert found[0] == "navigation.oracles.yaml:1:24: compares m with s"
    assert found[1].startswith('navigation.oracles.yaml:3:1: oracle "c" is not a line of text')
    assert found[2].startswith('navigation.oracles.yaml:4:1: "d e" cannot name an oracle')


@pytest.mark.parametrize("text", ["", "- never(contact)\n", "never(contact)\n"])
def test_a_file_of_something_else_is_refused(tmp_path, text):
    (found,) = problems(tmp_path, text)
    assert "expected lines of name: oracle" in found


def test_a_folded_value_is_read_as_one_line(tmp_path):
    path = write(tmp_path, "a: >-\n  always(loc.error <= 1 m)\n  when speed > 0 m/s\n")
    assert load_oracles(path)["a"].guard is not None


@pytest.mark.parametrize("campaign", ["demo", "ortega2024"])
def test_the_layers_that_ship_can_be_read(campaign):
    oracles = load_oracles(CAMPAIGNS / campaign / "navigation.oracles.yaml")
    assert {"reached", "localised", "no-contact"} <= oracles.keys()
    assert not oracles["reached"].is_measure
