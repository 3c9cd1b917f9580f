"""Metrics: text that a strict reader of Prometheus' format takes, with the right numbers."""

import re
from dataclasses import replace

from daemon.batch.operation import DaemonStatus, prometheus_text
from daemon.model.status import CampaignRow, DaemonOverview, DiskUsage, WorkerRow

_NAME = r"[a-zA-Z_:][a-zA-Z0-9_:]*"
_LABEL = r'([a-zA-Z_][a-zA-Z0-9_]*)="((?:[^"\\\n]|\\\\|\\"|\\n)*)"'
_SAMPLE = re.compile(rf"({_NAME})(?:\{{((?:{_LABEL},?)*)\}})? ([-+0-9.eE]+)\Z")
_HEAD = re.compile(rf"# (HELP|TYPE) ({_NAME}) (.*)\Z")
Metrics = dict[tuple[str, frozenset[tuple[str, str]]], float]


def read_exposition(text):
    """Read exposition format 0.0.4 strictly: HELP and TYPE first, families whole, no doubles."""
    assert text.endswith("\n")
    found = {}
    families = []
    for line in text[:-1].split("\n"):
        if head := _HEAD.match(line):
            assert (head[2] in families) == (head[1] == "TYPE")
            families += [head[2]] if head[1] == "HELP" else []
            assert head[1] == "HELP" or head[3] in ("gauge", "counter")
            continue
        sample = _SAMPLE.match(line)
        assert sample is not None, line
        assert sample[1] == families[-1]
        labels = re.findall(_LABEL, sample[2] or "")
        key = (sample[1], frozenset((name, _unescaped(value)) for name, value in labels))
        assert key not in found
        found[key] = float(sample[5])
    return found


def _unescaped(text):
    return re.sub(r"\\(.)", lambda m: "\n" if m[1] == "n" else m[1], text)


OVERVIEW = DaemonOverview(
    version="1.2", state="/s", started_at=1.8e9, now=1.8e9 + 60.5, campaigns=2, workers=1,
    queued=3, running=2, done=9, lost=1, cancelled=0, passed=5, failed=3, inconclusive=1,
    errors=0, rate=90.0, seconds_left=4.0,
)  # fmt: skip
OPEN = CampaignRow(
    id="open", name="open", about="", submitted_at=0.0, finished_at=None, total=8, queued=3,
    running=2, done=2, lost=1, cancelled=0, passed=1, failed=1, inconclusive=0, errors=0,
    paused=True,
)  # fmt: skip
SHUT = replace(OPEN, id="shut", queued=0, running=0, finished_at=5.0)
WORKER = WorkerRow('w"1\\\n', "host", 1, "1.2", 4, 2, 1.8e9, 1.8e9 + 60.0)
STANDING = DaemonStatus(
    OVERVIEW, (OPEN, SHUT), (WORKER,), DiskUsage(10**12, 10**11, 4096, 10**9, 2 * 10**9)
)


def test_numbers_are_those_of_the_daemon():
    found = read_exposition(prometheus_text(STANDING))

    def value(name, **labels):
        return found[f"scenario_{name}", frozenset(labels.items())]

    assert value("info", version="1.2") == 1
    states = ("queued", "running", "done", "lost", "cancelled")
    assert [value("runs", state=state) for state in states] == [3, 2, 9, 1, 0]
    words = ("pass", "fail", "inconclusive", "error")
    assert [value("outcomes", outcome=word) for word in words] == [5, 3, 1, 0]
    assert value("campaign_runs", campaign="open", state="queued") == 3
    assert value("campaign_paused", campaign="open") == 1
    assert not any(("campaign", "shut") in labels for _, labels in found)
    assert value("run_rate_hertz") == 1.5
    worker = {"worker": 'w"1\\\n', "host": "host"}
    assert (value("worker_slots", **worker), value("worker_busy", **worker)) == (4, 2)
    assert value("worker_silence_seconds", **worker) == 0.5
    assert (value("workers"), value("worker_away", **worker)) == (1, 0)
    assert (value("disk_bytes"), value("disk_free_bytes")) == (1e12, 1e11)
    assert value("ledger_bytes") == 4096
    assert (value("traces_bytes"), value("traces_quota_bytes")) == (1e9, 2e9)
    assert value("trouble") == 0


def test_an_idle_daemon_in_trouble_has_metrics_too():
    quiet = replace(STANDING, overview=replace(OVERVIEW, trouble="full"), campaigns=(), workers=())
    found = read_exposition(prometheus_text(quiet))
    assert found["scenario_trouble", frozenset()] == 1
    assert found["scenario_workers", frozenset()] == 0
    gone = replace(STANDING, workers=(replace(WORKER, away=True),))
    assert read_exposition(prometheus_text(gone))["scenario_workers", frozenset()] == 0
