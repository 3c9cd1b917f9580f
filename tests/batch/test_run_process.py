"""What a run tells its worker while it lasts: bounded, and never at the cost of the run."""

import os
import socket
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

from daemon.batch.run_process import LARGEST_MESSAGE, LIVE, SnapshotSender
from daemon.model.spec import Snapshot
from daemon.model.status import LiveSnapshot
from grammars.model.geometry import Pose2
from grammars.text import codec

RUN = "a-campaign-with-a-long-name-0123abcd.99999"
FULL = Snapshot(
    0.0,
    1200.0,
    Pose2(-12.345678901234567, 23.456789012345678, -1.2345678901234567),
    None,
    0,
    12,
    tuple(-1.2345678901234567 - index for index in range(500)),
)


@pytest.fixture
def wires():
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with ours, theirs:
        yield ours, theirs


def test_a_building_full_of_doors_is_told_whole(wires):
    ours, theirs = wires
    SnapshotSender(RUN, theirs)(FULL)
    message = ours.recv(LARGEST_MESSAGE)
    assert message[:1] == LIVE
    assert codec.from_json(LiveSnapshot, message[1:]).snapshot == FULL


def test_a_run_waits_for_no_worker_and_is_told_in_whole_messages(wires):
    ours, theirs = wires
    sender = SnapshotSender(RUN, theirs)
    for second in range(1000):
        sender(replace(FULL, time=float(second)))
    ours.setblocking(False)
    times = []
    with suppress(BlockingIOError):
        while True:
            message = ours.recv(LARGEST_MESSAGE)[1:]
            times.append(codec.from_json(LiveSnapshot, message).snapshot.time)
    assert times == [float(second) for second in range(len(times))]
    assert 0 < len(times) < 1000
    ours.close()
    sender(FULL)
    assert sender.interest() == "progress"


ASKED = """
import sys
from multiprocessing.connection import wait
from pathlib import Path
from daemon.batch.worker._attempts import Attempt
from daemon.batch.worker._zygotes import ZygotePool
from daemon.model.execution import RunLimits
from daemon.model.messages import Lease
from grammars.text import codec
from tests.make import SCENE, make_spec

if __name__ == "__main__":
    folder = Path(sys.argv[1])
    (folder / "scene.json").write_bytes(codec.to_json(SCENE))
    pool = ZygotePool(1, sys.argv[2])
    pool.warm_up()
    for leads in (False, True):
        lease = Lease("c.0", "c", 1, 7, "c/0.mcap", make_spec(), leads=leads)
        attempt = Attempt.prepare(folder / f"{leads}" / "attempt-1", lease)
        execution = pool.start(attempt, folder / "scene.json", RunLimits())
        while execution.end is None:
            wait(execution.waitables)
            execution.listen()
        why = execution.end.why
        execution.close()
        if why:
            sys.exit(why)
        print([lead.margin for lead in attempt.result().leads])
"""


def test_a_run_leaves_leading_margins_where_its_lease_asks_for_them(tmp_path):
    done = subprocess.run(
        [sys.executable, "-c", ASKED, str(tmp_path), "tests.fake_run:execute"],
        capture_output=True,
        text=True,
    )
    assert (done.stdout.split("\n")[:2], done.stderr) == (["[]", "[0.5]"], "")


DRAWING = """
import os
from numpy import random
from tests.fake_run import execute as execute_fake

def execute(spec, scene, **rest):
    with open(os.environ["DRAWN"], "a") as file:
        file.write(f"{random.random()}\\n")
    return execute_fake(spec, scene, **rest)
"""


def test_chance_that_nobody_has_seeded_differs_between_runs_of_a_worker(tmp_path):
    drawn = tmp_path / "drawn.txt"
    (tmp_path / "drawing.py").write_text(DRAWING)
    paths = os.pathsep.join((str(tmp_path), str(Path.cwd())))
    done = subprocess.run(
        [sys.executable, "-c", ASKED, str(tmp_path), "drawing:execute"],
        env={**os.environ, "PYTHONPATH": paths, "DRAWN": str(drawn)},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert len(set(drawn.read_text().splitlines())) == 2
