"""``scenario worker``: what is wrong with its options is said before anything starts."""

import pytest


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--dask", "host"), "'host' is no address"),
        (("--memory", "much"), "'much' is not a size"),
        (("--wall", "long"), "'long' is not a time"),
        (("--nice", "20"), "less than or equal to 19"),
    ],
)
def test_wrong_options_are_explained(scenario, options, words):
    said = scenario("worker", *options)
    assert said.code == 2
    assert words in said.err


def test_the_unit_of_a_worker_says_what_was_asked(scenario, tmp_path):
    scheduler = ("--dask", "tls://host:8786")
    limits = ("--nice", "5", "--wall", "10min", "--memory", "1GiB", "--state", str(tmp_path))
    unit = scenario("worker", "--print-unit", *scheduler, *limits).out
    assert '"--dask" "tls://host:8786"' in unit
    assert '"--nice" "5" "--wall" "10min" "--memory" "1GiB"' in unit
    assert "\nNice=5\n" in unit
