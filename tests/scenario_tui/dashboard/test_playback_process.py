"""Another process reads traces: the same playback, errors in words, and no process left behind."""

import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from daemon.trace import TraceError
from scenario_tui.dashboard.playback_process import PlaybackProcess, read_playback
from tests.scenario_tui.dashboard.driven import SteeredDaemon
from tests.scenario_tui.dashboard.inline import make_dashboard, press, settle
from tests.scenario_tui.recorded import record_run


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    return record_run(tmp_path_factory.mktemp("traces") / "run.mcap")


@pytest.fixture(scope="module")
def process():
    """A reader for all: it takes a second to load what reads, and each leaves one that answers."""
    found = PlaybackProcess()
    yield found
    found.close()


def pid(process):
    assert process._child is not None
    return process._child.pid


def test_what_another_process_read_is_what_is_read_here(trace, process):
    here, there = read_playback(trace, ()), process.read(trace, ())
    assert there.label == here.label
    assert there.trace.spec == here.trace.spec
    for one, other in zip(there.timeline.strips, here.timeline.strips, strict=True):
        assert (one.name, one.limits, one.against) == (other.name, other.limits, other.against)
        np.testing.assert_array_equal(one.values, other.values)
    assert there.timeline.doors == here.timeline.doors
    for time in np.linspace(here.start, here.end, 7):
        assert there.view(float(time)) == here.view(float(time))
    assert there.view(here.end).returns


def test_what_cannot_be_read_is_said_and_the_next_one_is(trace, process, tmp_path):
    (tmp_path / "notes.mcap").write_text("hello")
    with pytest.raises(TraceError, match="is not an MCAP file") as refused:
        process.read(tmp_path / "notes.mcap", ())
    assert "run it again to get one" in str(refused.value)
    before = pid(process)
    assert process.read(trace, ()).verdicts == ()
    assert pid(process) == before


def test_a_process_that_was_killed_is_replaced(trace, process):
    process.read(trace, ())
    before = pid(process)
    os.kill(before, signal.SIGKILL)
    assert process.read(trace, ()).end > 0.0
    assert pid(process) != before


def test_it_leaves_when_nothing_is_asked(trace):
    process = PlaybackProcess(idle=0.1)
    process.read(trace, ())
    assert process._child is not None
    assert process._child.wait(60.0) == 0
    assert process.read(trace, ()).end > 0.0
    process.close()


def test_the_process_that_was_begun_is_the_one_that_reads(trace):
    process = PlaybackProcess()
    process.begin()
    begun = pid(process)
    process.begin()
    assert pid(process) == begun
    assert process.read(trace, ()).end > 0.0
    assert pid(process) == begun
    process.close()


def test_one_that_was_begun_and_is_not_asked_leaves_and_is_begun_anew(trace):
    process = PlaybackProcess(idle=0.1)
    process.begin()
    assert process._child is not None
    assert process._child.wait(60.0) == 0
    before = pid(process)
    process.begin()
    assert pid(process) != before
    assert process.read(trace, ()).end > 0.0
    process.close()


async def test_it_is_begun_when_runs_are_shown_and_not_before(monkeypatch):
    begun = []
    monkeypatch.setattr(PlaybackProcess, "begin", lambda process: begun.append(process))
    async with make_dashboard(SteeredDaemon(), read_playback=None).run_test() as pilot:
        await settle(pilot)
        assert not begun
        await press(pilot, "enter")
        assert len(begun) == 1


def test_nothing_that_judges_is_loaded_to_look_at_a_run(trace):
    """What holds the memory: in the process of the dashboard it would stay."""
    script = (
        "import sys; from pathlib import Path\n"
        "import scenario_tui.dashboard.app, scenario_tui.dashboard.screens.run\n"
        "from scenario_tui.dashboard.playback_process import PlaybackProcess\n"
        "process = PlaybackProcess()\n"
        "playback = process.read(Path(sys.argv[1]), ())\n"
        "playback.view(playback.end)\n"
        "process.close()\n"
        "print({'numba', 'llvmlite', 'scipy', 'shapely', 'pymunk'} & sys.modules.keys())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(trace)], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "set()"
