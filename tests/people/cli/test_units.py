"""Daemons and workers: wrong options are refused before anything starts; systemd units."""


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
