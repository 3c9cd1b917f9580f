"""A skip that nobody has allowed fails where submissions are judged, and nowhere else."""

import os
import subprocess
import sys

import pytest

from tests.may_skip import LIST, listed

SKIPPING = {
    "by a mark": "import pytest\n@pytest.mark.skip(reason='no data')\ndef test_it(): pass\n",
    "inside": "import pytest\ndef test_it(): pytest.skip('no data')\n",
    "in a fixture": "import pytest\n@pytest.fixture\ndef data(): pytest.skip('no data')\n"
    "def test_it(data): pass\n",
    "a whole file": "import pytest\npytest.importorskip('no_data')\ndef test_it(): pass\n",
}


@pytest.mark.parametrize("how", SKIPPING)
@pytest.mark.parametrize("judged", [True, False], ids=["CI", "elsewhere"])
def test_a_skip_fails_where_submissions_are_judged(tmp_path, how, judged):
    (tmp_path / "test_one.py").write_text(SKIPPING[how])
    environment = {name: value for name, value in os.environ.items() if name != "CI"}
    words = ["-p", "tests.may_skip", "-p", "no:cacheprovider", "--rootdir", str(tmp_path), "-q"]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *words, "-c", os.devnull, str(tmp_path / "test_one.py")],
        env=environment | ({"CI": "1"} if judged else {}),
        cwd=LIST.parents[1],
        capture_output=True,
        text=True,
    )
    if judged:
        assert done.returncode in (1, 2)
        assert "was skipped, and tests/may_skip.txt does not say" in done.stdout
    else:
        assert done.returncode in (0, 5), "skipped, or nothing collected"


def test_what_may_be_skipped_is_there():
    for pattern, words in listed():
        assert list(LIST.parents[1].glob(pattern.partition("::")[0]))
        assert words
