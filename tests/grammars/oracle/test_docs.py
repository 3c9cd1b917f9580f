"""``docs/oracles.md`` says what the language says."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from grammars.oracle import load_oracles
from tests.oracle_docs import PAGE, page_with_table

EXAMPLES = re.findall(r"```yaml\n(.*?)```", PAGE.read_text(), re.DOTALL)


def test_the_table_of_signals_is_that_of_the_registry() -> None:
    assert PAGE.read_text() == page_with_table(), "write it anew: python -m tests.oracle_docs"


@pytest.mark.parametrize("text", EXAMPLES)
def test_every_example_is_an_oracle_layer(text: str, tmp_path: Path) -> None:
    layer = tmp_path / "example.oracles.yaml"
    layer.write_text(text)
    assert load_oracles(layer)


def test_there_are_examples_of_every_operator() -> None:
    words = ("always", "never", "eventually", "until", "fraction", "time", "longest", "count")
    words += ("max", "min", "mean", "final", "p95", "reached", "when", "on leg", "within", "abs")
    missing = [word for word in words if not any(word in text for text in EXAMPLES)]
    assert missing == []
