"""Numbers of the page about searches are those of the program."""

import re
from pathlib import Path

import pytest

from daemon.model.search import SPACE_FILLING
from daemon.search import nearest, point_runner, program, shrinking
from daemon.search.methods import COVARIANCE_FROM

PAGE = " ".join((Path(__file__).parents[3] / "docs" / "search.md").read_text("utf-8").split())
WORDS = {"two": 2, "three": 3, "five": 5, "twenty": 20}


def numbers(pattern):
    found = re.findall(pattern, PAGE)
    assert found, f"the page does not say {pattern} any more"
    return {WORDS.get(word.lower()) or int(word) for word in found}


@pytest.mark.parametrize(
    ("pattern", "value"),
    [
        (r"[Aa]t most (\d+) points; one that fails", nearest.NEAREST_POINTS),
        (r"its (\d+) points were spent", nearest.NEAREST_POINTS),
        (r"looked for at up to (\d+) points", nearest.NEAREST_POINTS),
        (r"for at most (\d+) of the points", nearest._TAKING_BACK),
        (r"the next worst, (\w+) in all", nearest._STARTS),
        (r"until one does, up to (\w+)", nearest._MOST_STARTS),
        (r"At most (\d+) runs\.", shrinking.SHRINK_RUNS),
        (r"candidates are runs of the search, at most (\d+)", shrinking.SHRINK_RUNS),
        (r"that is after (\d+) results", program._SETTLED_RUNS),
        (r"results, or (\w+) windows", program._SETTLED_WINDOWS),
        (r"(\w+) errors in a row", program.ERRORS_IN_A_ROW),
        (r"every point is run (\w+) times", point_runner.MEDIAN_OF),
        (r"of `confirm:`, but (\w+) at least", point_runner._FEWEST_OTHERS),
        (r"at least and (\w+) at most", point_runner._MOST_OTHERS),
        (r"`auto` \| (\d+) runs that fill", SPACE_FILLING),
        (r"from run (\d+) on `cma`", COVARIANCE_FROM),
    ],
)
def test_a_number_of_the_page_is_the_programs(pattern, value):
    assert numbers(pattern) == {value}
