"""What a run tells its worker while it lasts: bounded, and never at the cost of the run."""

import os
import select
import subprocess
import sys
from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path

import pytest

from daemon.batch.run_process import JUDGED_FILE, LIVE, SnapshotSender, read_judged
from daemon.model.live_judgement import LARGEST_JUDGEMENT
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
    tuple(-1.2345678901234567 - index for index in range(40)),
)


def sent(snapshot, folder):
    """Return the length of what went through the pipe, and what was in it."""
    ours, theirs = Pipe(duplex=False)
    with ours, theirs:
        SnapshotSender(RUN, theirs, folder)(snapshot)
        if not ours.poll():
            return None
        message = ours.recv_bytes()
    assert message[:1] == LIVE
    return len(message), codec.from_json(LiveSnapshot, message[1:]).snapshot


@pytest.mark.parametrize(
    "sign", ["x", "\N{GRINNING FACE}", '"', "\N{LINE SEPARATOR}", "\x01", "\N{CJK RADICAL REPEAT}"]
)
def test_what_is_waited_for_fits_in_any_script(sign, tmp_path):
    waiting = sign * 120
    found = sent(replace(FULL, waiting=waiting), tmp_path)
    assert found is not None
    length, snapshot = found
    assert length + 8 <= select.PIPE_BUF
    assert snapshot.waiting == waiting
    assert len(snapshot.joints) == 40


def test_what_is_waited_for_is_told_of_a_building_full_of_doors(tmp_path):
    many = tuple(-1.2345678901234567 for _ in range(500))
    # Joints that do not fit are left out before time begins, when all are as drawn; later a
    # picture without them would be a wrong one.
    found = sent(replace(FULL, joints=many, waiting="\N{GRINNING FACE}" * 120), tmp_path)
    assert found is not None
    assert found[1].waiting
    assert found[1].joints == ()
    assert sent(replace(FULL, joints=many), tmp_path) is None


ASKED = """
import sys
from multiprocessing.connection import wait
from pathlib import Path
from daemon.batch.worker._attempts import Attempt
from daemon.batch.worker._forkserver import ForkServerPool, prepare_environment
from daemon.model.execution import RunLimits
from daemon.model.messages import Lease
from grammars.text import codec
from tests.daemon.batch.samples import SCENE, make_spec

if __name__ == "__main__":
    prepare_environment(sys.argv[2])
    folder = Path(sys.argv[1])
    (folder / "scene.json").write_bytes(codec.to_json(SCENE))
    pool = ForkServerPool(1)
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
    # In a process of its own: one has only one fork server.
    done = subprocess.run(
        [sys.executable, "-c", ASKED, str(tmp_path), "tests.daemon.batch.fake_run:execute"],
        capture_output=True,
        text=True,
    )
    assert (done.stdout.split("\n")[:2], done.stderr) == (["[]", "[0.5]"], "")


DRAWING = """
import os
from numpy import random
from tests.daemon.batch.fake_run import execute as execute_fake

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


def test_a_judgement_that_is_too_long_to_be_one_is_not_read(tmp_path):
    (tmp_path / JUDGED_FILE).write_bytes(b"x" * 10)
    assert read_judged(tmp_path) == b"x" * 10
    (tmp_path / JUDGED_FILE).write_bytes(b"x" * (LARGEST_JUDGEMENT + 1))
    assert read_judged(tmp_path) == b""
