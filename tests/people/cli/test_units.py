"""Daemons and workers: wrong options are refused before anything starts; systemd units."""

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


def test_units_name_everything_by_absolute_paths(scenario, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    unit = scenario("daemon", "--print-unit", "--state", "my state", "--slots", "2").out
    assert f'"daemon" "--state" "{tmp_path}/my state" "--slots" "2"' in unit
    wide = scenario("daemon", "--print-unit", "--listen", "tls/[::]:7447", "--keys", "k").out
    assert f'"--keys" "{tmp_path}/k"' in wide
    assert '"--listen" "tls/[::]:7447"' in wide
    assert scenario("worker", "--print-unit", "--state", "here").out.count(f"{tmp_path}/here") == 1
    far = scenario("worker", "--print-unit", "--connect", "tcp/far:7447").out
    assert '"--connect" "tcp/far:7447"\n' in far
    assert "--state" not in far
