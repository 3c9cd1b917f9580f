"""A skip that nobody has allowed fails where submissions are judged, and nowhere else."""

import pytest

from tests.may_skip import LIST, listed

pytest_plugins = "pytester"
SKIPPING = {
    "test_by_mark": "@pytest.mark.skip(reason='no data')\ndef test_it(): pass",
    "test_inside": "def test_it(): pytest.skip('no data')",
    "test_fixture": "@pytest.fixture\ndef data(): pytest.skip('no data')\ndef test_it(data): pass",
    "test_whole_file": "pytest.importorskip('no_data')\ndef test_it(): pass",
}


@pytest.mark.parametrize("judged", [True, False], ids=["CI", "elsewhere"])
def test_a_skip_fails_where_submissions_are_judged(pytester, monkeypatch, judged):
    monkeypatch.setenv("CI", "1")
    if not judged:
        monkeypatch.delenv("CI")
    pytester.makepyfile(**{name: f"import pytest\n{text}" for name, text in SKIPPING.items()})
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    words = "-p", "tests.may_skip", "--continue-on-collection-errors"
    done = pytester.runpytest_inprocess(*words)
    done.assert_outcomes(**({"failed": 1, "errors": 3} if judged else {"skipped": 4}))
    said = done.stdout.str().count("was skipped, and tests/may_skip.txt does not say: ")
    assert said == (len(SKIPPING) if judged else 0)


def test_what_may_be_skipped_is_there():
    for pattern, words in listed():
        assert list(LIST.parents[1].glob(pattern.partition("::")[0]))
        assert words
