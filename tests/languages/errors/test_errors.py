"""Messages about mistakes are those of the golden files."""

import pytest

from tests.languages.errors.goldens import GOLDENS, difference


@pytest.mark.parametrize("golden", GOLDENS, ids=lambda golden: golden.stem)
def test_findings_are_those_of_the_golden_file(golden, tmp_path):
    changes = difference(golden, tmp_path / "files")
    if changes:
        command = f"python -m tests.languages.errors {golden.stem}"
        pytest.fail(f"{changes}\nTo keep the new messages: {command}", pytrace=False)
