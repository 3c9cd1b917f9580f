"""What is said of mistakes is what the golden files beside this one say."""

import pytest

from tests.grammars.errors.goldens import FILES, difference


@pytest.mark.parametrize("golden", FILES, ids=lambda golden: golden.stem)
def test_all_that_is_said_of_a_mistake_is_what_its_golden_file_says(golden, tmp_path):
    changes = difference(golden, tmp_path / "files")
    if changes:
        command = f"python -m tests.grammars.errors {golden.stem}"
        pytest.fail(f"{changes}\nIf this is how it should read: {command}", pytrace=False)
