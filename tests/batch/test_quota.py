"""What a daemon keeps stays bounded: traces by a quota, logs by rotation."""

import pytest

from daemon.batch.amounts import QUOTA_VARIABLE, parse_size, size_text
from daemon.batch.errors import DaemonError
from daemon.batch.launch import ensure_daemon
from tests.make import make_submission
from tests.parts import daemon_at, eventually

SIZE = 40_000


def finished(client, campaign):
    return next(row.finished for row in client.campaigns() if row.id == campaign)


def traces(state, campaign):
    return len(list((state / "traces" / campaign).glob("*.mcap")))


def test_the_oldest_traces_go_when_the_quota_is_reached(tmp_path):
    with daemon_at(tmp_path / "state", 2, quota="320kB") as daemon, daemon.client() as client:
        for name in ("old", "new"):
            client.submit(make_submission(name, 5, size=SIZE))
            eventually(lambda name=name: finished(client, name))

        def removed():
            return sum(line["traces"] for line in daemon.noted("traces removed"))

        eventually(lambda: 2 <= removed() == 5 - traces(daemon.state, "old"))
        disk = eventually(lambda: 0 < (now := client.disk()).traces <= now.quota and now)
        gone = removed()
        assert traces(daemon.state, "new") == 5
        reasons = [row.reason for row in client.runs("old").rows]
        assert reasons.count("its trace is gone") == gone
        assert disk.quota == 320_000
        assert client.overview().trouble == ""


def test_runs_wait_when_unfinished_campaigns_alone_take_too_much(tmp_path):
    with daemon_at(tmp_path / "state", 1, quota="100kB") as daemon, daemon.client() as client:
        client.submit(make_submission("big", 40, size=SIZE, sleep=0.1))
        trouble = eventually(lambda: client.overview().trouble)
        assert "the quota is 97.7 KiB: no more runs start" in trouble
        assert "--quota, or cancel" in trouble
        eventually(lambda: client.overview().running == 0)
        there = traces(daemon.state, "big")
        assert there == client.overview().done
        client.cancel("big")
        eventually(lambda: not client.overview().trouble)
        assert traces(daemon.state, "big") < there
        client.submit(make_submission("next", 1))
        eventually(lambda: finished(client, "next"))


def test_the_log_of_a_worker_that_stays_is_put_aside_when_it_has_grown(tmp_path):
    with daemon_at(tmp_path / "state", 1) as daemon, daemon.client() as client:
        eventually(client.workers)
        log = daemon.state / "worker.log"
        with log.open("ab") as file:
            file.write(b"many words\n" * 500_000)
        eventually(lambda: log.with_suffix(".log.1").exists() and log.stat().st_size < 1000)
        client.submit(make_submission("raises", 1, **{"raise": "in the new log"}))
        eventually(lambda: finished(client, "raises"))
        assert "in the new log" in log.read_text()
        assert len(client.workers()) == 1


def test_a_quota_that_is_no_size_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv(QUOTA_VARIABLE, "20")
    with pytest.raises(DaemonError, match="the quota of traces: '20' is not a size"):
        ensure_daemon(tmp_path / "state")


def test_sizes_are_read_as_they_are_written():
    assert [parse_size(text) for text in ("20GiB", "1.5 kB", " 7 B ")] == [20 * 2**30, 1500, 7]
    assert size_text(parse_size("1.5GiB")) == "1.5 GiB"
    for wrong in ("", "20", "GiB", "-1B", "1e9B", "20 parsecs"):
        with pytest.raises(ValueError, match="is not a size"):
            parse_size(wrong)
