"""What a run tells its worker while it lasts: bounded, and never at the cost of the run."""

from __future__ import annotations

import select
from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path

import pytest

from daemon.batch.run_process import LIVE, SnapshotSender
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


def sent(snapshot: Snapshot, folder: Path) -> tuple[int, Snapshot] | None:
    """Return the length of what went through the pipe, and what was in it."""
    ours, theirs = Pipe(duplex=False)
    with ours, theirs:
        SnapshotSender(RUN, theirs, folder / "watched")(snapshot)
        if not ours.poll():
            return None
        message = ours.recv_bytes()
    assert message[:1] == LIVE
    return len(message), codec.from_json(LiveSnapshot, message[1:]).snapshot


@pytest.mark.parametrize(
    "sign", ["x", "\N{GRINNING FACE}", '"', "\N{LINE SEPARATOR}", "\x01", "\N{CJK RADICAL REPEAT}"]
)
def test_what_is_waited_for_fits_in_any_script(sign: str, tmp_path: Path) -> None:
    waiting = sign * 120
    found = sent(replace(FULL, waiting=waiting), tmp_path)
    assert found is not None
    length, snapshot = found
    assert length + 8 <= select.PIPE_BUF
    assert snapshot.waiting == waiting
    assert len(snapshot.joints) == 40


def test_what_is_waited_for_is_told_of_a_building_full_of_doors(tmp_path: Path) -> None:
    many = tuple(-1.2345678901234567 for _ in range(500))
    # Joints that do not fit are left out before time begins, when all are as drawn; later a
    # picture without them would be a wrong one.
    found = sent(replace(FULL, joints=many, waiting="\N{GRINNING FACE}" * 120), tmp_path)
    assert found is not None
    assert found[1].waiting
    assert found[1].joints == ()
    assert sent(replace(FULL, joints=many), tmp_path) is None
