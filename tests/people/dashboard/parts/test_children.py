"""A child process works for the dashboard: the same answers, errors in words, none left behind."""

import os
import signal
import subprocess
import sys
from functools import partial
from pathlib import Path

import numpy as np
import psutil
import pytest

from daemon.batch.errors import DaemonError
from daemon.trace import TraceError
from grammars.text.diagnostics import Finding, InputError, Where
from scenario_tui.dashboard.children import Children
from scenario_tui.dashboard.playback import read_playback
from scenario_tui.library.submission import check_file
from tests.parts import eventually
from tests.people.recorded import record_run

DEMO = Path(__file__).parents[4] / "campaigns" / "demo" / "campaign.yaml"


@pytest.fixture(scope="module")
def trace(tmp_path_factory):
    return record_run(tmp_path_factory.mktemp("traces") / "run.mcap")


@pytest.fixture(scope="module")
def children():
    """A child for all: it takes a second to load what reads."""
    found = Children()
    yield found
    found.close()


def is_alive(pid):
    return psutil.pid_exists(pid) and psutil.Process(pid).status() != psutil.STATUS_ZOMBIE


def test_what_a_child_reads_is_what_is_read_here(trace, children):
    here, there = read_playback(trace, ()), children.run(read_playback, trace, ())
    assert there.label == here.label
    assert there.trace.spec == here.trace.spec
    assert there.timeline.doors == here.timeline.doors
    for time in np.linspace(here.start, here.end, 7):
        assert there.view(float(time)) == here.view(float(time))
    assert there.view(here.end).returns


def test_memory_of_what_children_sent_goes_back_to_the_system():
    this, sent, size = psutil.Process(), [], 32_000_000
    before = this.memory_info().rss
    for _ in range(2):
        children = Children()
        sent.append(children.run(np.split, np.ones(size // 8), 16))
        children.close()
    assert this.memory_info().rss - before > 2 * size
    sent.clear()
    # The last child's thread has what it took in until it ends, a moment after the child is closed.
    eventually(lambda: this.memory_info().rss - before < size)


def test_errors_come_back_as_they_are_and_the_child_stays(children, tmp_path):
    before = children.run(os.getpid)
    (tmp_path / "notes.mcap").write_text("hello")
    with pytest.raises(TraceError, match="is not an MCAP file") as refused:
        children.run(read_playback, tmp_path / "notes.mcap", ())
    assert "run it again to get one" in str(refused.value)
    findings = (Finding(Where("a.yaml"), "one"), Finding(Where("b.yaml"), "two"))
    with pytest.raises(InputError) as refused:
        children.run(partial(_refuse, findings))
    assert refused.value.findings == findings
    assert children.run(os.getpid) == before


def _refuse(findings):
    raise InputError(findings)


def test_a_campaign_is_checked_by_a_child(children):
    checked = children.run(check_file, DEMO, submit=True)
    assert checked == check_file(DEMO, submit=True)
    assert checked.submission is not None


def test_a_child_that_was_killed_is_replaced_and_one_that_dies_of_its_work_is_told(children):
    before = children.run(os.getpid)
    os.kill(before, signal.SIGKILL)
    assert children.run(os.getpid) != before
    with pytest.raises(DaemonError, match="is there enough memory"):
        children.run(os._exit, 1)
    assert children.run(os.getpid)


def test_a_child_leaves_when_it_has_nothing_to_do():
    children = Children(idle=0.0)  # it ends its work first, however soon it is to leave
    before = children.run(os.getpid)
    eventually(lambda: not is_alive(before))
    assert children.run(os.getpid) != before
    children.close()
    with pytest.raises(DaemonError, match="is closing"):
        children.run(os.getpid)


IN_A_DASHBOARD = """
import os, sys, time
from scenario_tui.dashboard.children import Children

class Captured:
    def fileno(self): return -1

sys.stderr = Captured()  # as Textual does it
children = Children()
print(children.run(os.getpid), flush=True)
time.sleep(600)
"""


def test_a_child_ends_with_a_dashboard_that_is_killed(tmp_path):
    """Started as Textual and people's folders have it: no stream, and modules with usual names.

    The script has no guard, as a short one that opens the dashboard: the child does not run it.
    """
    (tmp_path / "random.py").write_text("raise SystemExit('not this one')\n")
    script = tmp_path / "scripts" / "dashboard.py"
    script.parent.mkdir()
    script.write_text(IN_A_DASHBOARD)
    with subprocess.Popen(
        [sys.executable, script], cwd=tmp_path, stdout=subprocess.PIPE, text=True
    ) as dashboard:
        assert dashboard.stdout is not None
        child = int(dashboard.stdout.readline())
        assert is_alive(child)
        assert os.getsid(child) == child
        dashboard.kill()
    eventually(lambda: not is_alive(child))


def test_nothing_that_judges_is_loaded_to_look_at_a_run(trace, tmp_path):
    """What holds the memory: in the process of the dashboard it would stay."""
    script = tmp_path / "look.py"
    script.write_text(
        "import sys; from pathlib import Path\n"
        "import scenario_tui.dashboard.app, scenario_tui.dashboard.screens.run\n"
        "from scenario_tui.dashboard.children import Children\n"
        "from scenario_tui.dashboard.playback import read_playback\n"
        "children = Children()\n"
        "playback = children.run(read_playback, Path(sys.argv[1]), ())\n"
        "playback.view(playback.end)\n"
        "children.close()\n"
        "print({'numba', 'llvmlite', 'scipy', 'shapely', 'pymunk'} & sys.modules.keys())\n"
    )
    done = subprocess.run(
        [sys.executable, script, str(trace)], capture_output=True, text=True, check=True
    )
    assert done.stdout.strip() == "set()"
