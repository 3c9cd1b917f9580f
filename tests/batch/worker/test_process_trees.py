"""Nothing that a run has started outlives it, whatever ends it: processes that are really there."""

import signal
from contextlib import suppress

import psutil
import pytest

from daemon.model.run_state import RunState
from tests.make import make_spec, make_submission, submission_of
from tests.parts import DEADLINE, alive, daemon_at, eventually, worker_for

RUNS = {
    "ends": {},
    "raises": {"raise": "no such door"},
    "crashes": {"crash": [1]},
    # It goes on for so long: otherwise it may have ended before it is noticed.
    "its guardian is killed": {"kill": 0, "sleep": 600.0},
}


def processes(file):
    """The processes that a run said it had left behind, those that are there."""
    found = []
    for number in map(int, file.read_text().split()):
        with suppress(psutil.NoSuchProcess):
            found.append(psutil.Process(number))
    return found


def test_nothing_outlives_a_run_however_it_ends(tmp_path):
    specs = [
        make_spec(number, leaves=str(tmp_path / str(number)), **what)
        for number, what in enumerate(RUNS.values())
    ]
    with daemon_at(tmp_path / "state", 2, attempts=1) as daemon, daemon.client() as client:
        client.submit(submission_of("c", *specs))
        eventually(lambda: all(row.finished for row in client.campaigns()))
        states = [row.state for row in client.runs("c").rows]
        assert states == [RunState.DONE] + 3 * [RunState.LOST]
        for number, name in enumerate(RUNS):
            # Not only in the end: before anybody was told that the run has ended.
            assert alive(processes(tmp_path / str(number))) == [], name
        reasons = [row.reason for row in client.runs("c").rows[1:]]
        assert "no such door" in reasons[0]
        assert "SIGKILL" in reasons[1]
        assert "SIGKILL" in reasons[2]


def test_nothing_outlives_a_run_whose_time_is_up(tmp_path):
    # On a busy machine a run may not come so far in a short time as to leave anything.
    for wall in (2.0, 8.0, 32.0):
        file = tmp_path / f"left-{wall:g}"
        settings = {"wall": wall, "attempts": 1}
        state = tmp_path / f"state-{wall:g}"
        with daemon_at(state, 1, **settings) as daemon, daemon.client() as client:
            client.submit(make_submission("c", 1, leaves=str(file), sleep=600.0))
            eventually(lambda c=client: all(row.finished for row in c.campaigns()), 4 * DEADLINE)
            assert f"stopped after {wall:g} s" in client.run("c.0").row.reason
            if file.exists() and len(file.read_text().split()) == 2:
                assert alive(processes(file)) == []
                return
    raise AssertionError("no run has left processes behind before its time was up")


@pytest.fixture(scope="module")
def daemon(tmp_path_factory):
    with daemon_at(tmp_path_factory.mktemp("trees") / "state") as part:
        yield part


@pytest.fixture(scope="module")
def client(daemon):
    with daemon.client() as connected:
        yield connected


def test_nothing_outlives_a_run_that_is_not_wanted(daemon, client, tmp_path):
    with worker_for(daemon):
        begun = begin(client, "cancelled", tmp_path / "left")
        client.cancel("cancelled")
        eventually(lambda: not alive(begun))


@pytest.mark.parametrize("number", [signal.SIGQUIT, signal.SIGKILL], ids=lambda n: n.name)
def test_nothing_outlives_a_worker(daemon, client, tmp_path, number):
    with worker_for(daemon) as worker:
        begun = begin(client, f"worker-{number:d}", tmp_path / "left")
        worker.signal(number)
        worker.wait()
        eventually(lambda: not alive(begun))
    client.cancel(f"worker-{number:d}")


def test_nothing_outlives_a_zygote(daemon, client, tmp_path):
    with worker_for(daemon) as worker:
        begun = begin(client, "server", tmp_path / "left")
        (server,) = [one for one in psutil.Process(worker.pid).children() if one.children()]
        server.kill()
        client.cancel("server")
        eventually(lambda: not alive(begun))


def begin(client, campaign, file):
    """Have a run begin that lasts; returns what it has left behind so far."""
    client.submit(make_submission(campaign, 1, leaves=str(file), sleep=600.0))
    return eventually(lambda: file.exists() and len(found := processes(file)) == 2 and found)
