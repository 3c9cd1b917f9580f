"""Recordings: brought here, read, kept by what they are, and tried again by who looks again."""

from __future__ import annotations

from dataclasses import replace

import pytest

from daemon.batch.errors import Refused
from daemon.batch.stores import file_sha256
from daemon.model.messages import FilePart
from daemon.model.spec import TraceInfo
from scenario_tui.dashboard.recordings import Missing, Recordings
from tests.parts import eventually
from tests.people.dashboard.dash import InlineChildren, is_reading
from tests.people.fake import CAMPAIGN
from tests.people.recorded import record_run


@pytest.fixture
def recordings(fake, tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return Recordings(fake.open, InlineChildren())


def row_of(fake, path, index=0, **changes):
    """The row of a finished run that left this trace."""
    row = fake.run(f"{CAMPAIGN}.{index}").row
    info = TraceInfo(file_sha256(path), path.stat().st_size, 1)
    return replace(row, **({"trace": str(path)} | changes), result=replace(row.result, trace=info))


def known(recordings, row):
    """What is known of a recording once it was read."""
    recordings.get(row)
    eventually(lambda: not is_reading())
    return recordings.get(row)


def send_trace(monkeypatch, fake, answer):
    """Have the daemon answer who asks for a trace."""
    get_other = fake.get

    def get(sha256, offset=0, run=""):
        return answer() if run else get_other(sha256, offset)

    monkeypatch.setattr(fake, "get", get)


def test_a_recording_is_read_meanwhile_and_kept(fake, recordings, tmp_path):
    row = row_of(fake, record_run(tmp_path / "run.mcap"))
    told = []
    recordings.on_read = lambda: told.append(recordings.read(row))
    assert recordings.get(row) == Missing()
    eventually(lambda: not is_reading())
    recording = recordings.get(row)
    assert recording.end == 10.0
    assert told == [recording]
    assert recordings.get(row) is recordings.read(row) is recording


def test_a_trace_at_the_same_place_is_another_recording(fake, recordings, tmp_path):
    path = tmp_path / "run.mcap"
    first = known(recordings, row_of(fake, record_run(path)))
    row = row_of(fake, record_run(path, speed=0.1))
    assert known(recordings, row).pose(10.0).x == pytest.approx(2.0)
    again = replace(row, result=replace(row.result, verdicts=()))
    assert known(recordings, again).verdicts == ()
    assert first.pose(10.0).x == pytest.approx(6.0)


def test_only_the_last_ones_are_kept_and_a_cursor_that_went_past_reads_nothing(
    fake, recordings, tmp_path
):
    path = record_run(tmp_path / "run.mcap")
    rows = [row_of(fake, path) for _ in range(6)]
    rows = [
        replace(row, result=replace(row.result, verdicts=row.verdicts * count))
        for count, row in enumerate(rows)
    ]
    first = known(recordings, rows[0])
    for row in rows[1:]:
        known(recordings, row)
    assert recordings.get(rows[0]) is not first
    with recordings._reading:
        recordings.get(rows[1])
        recordings.get(rows[0])
    eventually(lambda: not is_reading())
    assert recordings.get(rows[1]) == Missing()


def test_a_trace_elsewhere_is_brought_here(fake, recordings, tmp_path, monkeypatch):
    there = record_run(tmp_path / "there.mcap")
    data = there.read_bytes()
    send_trace(monkeypatch, fake, lambda: FilePart(len(data), data))
    row = row_of(fake, there, trace="/elsewhere/run.mcap")
    assert "Fetching its trace, 0." in recordings.get(row).why
    assert known(recordings, row).end == 10.0
    # Another machine may have another file under the same path.
    other = record_run(tmp_path / "here.mcap", speed=0.1)
    assert known(recordings, replace(row, trace=str(other))).pose(10.0).x == pytest.approx(6.0)


def test_a_trace_that_cannot_be_had_is_tried_again_by_who_looks_again(
    fake, recordings, tmp_path, monkeypatch
):
    there = record_run(tmp_path / "there.mcap")
    data, broken = there.read_bytes(), [True]

    def send():
        if broken[0]:
            raise Refused("the line is down")
        return FilePart(len(data), data)

    send_trace(monkeypatch, fake, send)
    row = row_of(fake, there, trace="/elsewhere/run.mcap")
    missing = known(recordings, row)
    assert "not on this machine" in missing.why
    assert "the line is down" in missing.why
    broken[0] = False
    assert recordings.get(row) is missing
    recordings.look_again()
    assert known(recordings, row).end == 10.0


def test_a_cursor_that_comes_back_to_what_is_missing_has_it_tried_again(fake, recordings, tmp_path):
    path = record_run(tmp_path / "run.mcap")
    row, data = row_of(fake, path), path.read_bytes()
    path.unlink()
    assert "not on this machine" in known(recordings, row).why
    path.write_bytes(data)
    assert "not on this machine" in known(recordings, row).why
    known(recordings, replace(row, result=replace(row.result, verdicts=())))
    assert known(recordings, row).end == 10.0


def test_a_damaged_trace_says_what_is_wrong_with_it(fake, recordings, tmp_path):
    path = tmp_path / "broken.mcap"
    path.write_bytes(b"not a trace")
    missing = known(recordings, row_of(fake, path))
    assert "is not an MCAP file" in missing.why
    assert "Run it again" in missing.why


@pytest.mark.parametrize(
    ("index", "words"), [(9, "This run was lost"), (7, "its trace exists when it ends")]
)
def test_a_run_without_a_result_has_nothing_to_look_at(fake, recordings, index, words):
    row = fake.run(f"{CAMPAIGN}.{index}").row
    assert words in recordings.get(row).why
    assert recordings.get(row) == recordings.read(row)
    assert isinstance(recordings.read(row), Missing)
