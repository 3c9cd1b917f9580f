"""Messages about mistakes are those of the golden files."""

import pytest

from tests.languages.errors.goldens import GOLDENS, renew


@pytest.mark.parametrize("path", GOLDENS, ids=lambda path: path.stem)
def test_findings_are_those_of_the_golden_file(path, golden, tmp_path):
    golden(path.name, renew(path, tmp_path / "files"))
