"""Folders say how much of a machine their tests need."""

import pytest

from tests.rings import TESTS, ring_of


@pytest.mark.parametrize(
    ("file", "ring"),
    [
        ("batch/ledger/test_ledger.py", "unit"),
        ("batch/parts/test_survival.py", "parts"),
        ("long/test_tutorials.py", "long"),
        ("stacks/test_parts.py", "unit"),
    ],
)
def test_the_ring_is_that_of_the_folder(file, ring):
    assert ring_of(TESTS / file) == ring
