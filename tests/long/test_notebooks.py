"""Notebooks of the documentation do what they show."""

import nbformat
import pytest

from tests.docs import notebooks


@pytest.mark.parametrize("path", notebooks.NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_shows_what_it_does(path):
    stored = notebooks.outputs(nbformat.read(path, as_version=4))
    assert stored == notebooks.outputs(notebooks.executed(path)), (
        "write them anew: python -m tests.docs --notebooks"
    )
