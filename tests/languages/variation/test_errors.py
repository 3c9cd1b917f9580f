"""What a variation cannot mean is refused: where, what, and what to do."""

import pytest

from grammars.text.diagnostics import InputError
from grammars.variation import load_variation, parse_variation
from tests.languages.variation.plans import HOUSE, vary


def refused(folder, statements):
    with pytest.raises(InputError) as caught:
        vary(folder, statements)
    for diagnostic in caught.value.findings:
        assert diagnostic.where.file == "test.variation"
        assert diagnostic.where.line >= 1
        assert diagnostic.where.column >= 1
    return [str(d) for d in caught.value.findings]


def test_a_name_that_no_file_can_have_suggests_those_that_are_there(tmp_path):
    (tmp_path / "plan.fpm").write_text(HOUSE)
    with pytest.raises(InputError, match='did you mean "plan.fpm"'):
        parse_variation('import "pl\0an.fpm" gap: uniform([1])', "test.variation", tmp_path)


def test_files_that_cannot_be_read_are_named(tmp_path):
    with pytest.raises(InputError, match=r"none\.variation: no such file"):
        load_variation(tmp_path / "none.variation")
    (tmp_path / "bad.variation").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"bad\.variation: the variation is not UTF-8"):
        load_variation(tmp_path / "bad.variation")


@pytest.mark.parametrize(
    "text", ["(" * 2000 + "1", "-" * 4000 + "1", "abs(" * 500 + "1" + ")" * 500]
)
def test_monsters_are_refused(tmp_path, text):
    assert refused(tmp_path, f"gap: {text}")
    assert refused(tmp_path, f"require {text} > 2")


def test_a_number_that_is_too_large_hides_no_other_error(tmp_path):
    statements = "gap: 1e400 m\nrequire turn > 1e400 deg\nlet wide = uniform(2 .. 1)"
    assert [text.rpartition(": ")[2] for text in refused(tmp_path, statements)] == [
        "1e400 m is too large",
        "1e400 deg is too large",
        "the range 2 .. 1 is empty\n    the smaller number comes first",
    ]


def test_probabilities_that_no_float_can_sum_up_are_refused(tmp_path):
    (text,) = refused(tmp_path, "gap: discrete([(1e308, 1), (1e308, 2)])")
    assert "the probabilities sum to inf" in text
