"""What a run leaves in the memory of a process that goes on: nothing of its world and its maps."""

import contextlib
import gc
import weakref

import pymunk
import pytest

from daemon import run
from daemon.model.attachments import SutMissing
from daemon.run_loop import RunLoop
from daemon.simulator import World
from daemon.stacks.calls import make_in_time
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.navfn.planner import Navfn
from daemon.trace import TraceWriter


@pytest.fixture
def made(monkeypatch):
    """All that is made of the types that hold much memory, while only runs collect garbage."""
    found = []

    def noting(init):
        def note(self, *args, **kwargs):
            init(self, *args, **kwargs)
            found.append(weakref.ref(self))

        return note

    stacks = [type(make_in_time(kind, {})) for kind in ("ros", "pilot")]
    types = [RunLoop, World, pymunk.Space, TraceWriter, Costmap, Navfn, *stacks]
    for kind in types:
        monkeypatch.setattr(kind, "__init__", noting(kind.__init__))
    gc.collect()
    gc.disable()
    yield found
    gc.enable()


def left(made):
    return {type(thing) for each in made if (thing := each()) is not None}


@pytest.mark.parametrize("kind", ["ros", "pilot"])
def test_what_drove_is_gone_before_its_trace_is_judged(kind, runs, tmp_path, made, monkeypatch):
    kept = []
    monkeypatch.setattr(run, "judge", lambda *_: kept.append(left(made)) or ())
    runs.execute(runs.spec("rude-house", kind, limit=0.5), tmp_path / "run.mcap")
    assert kept == [{TraceWriter}]
    assert left(made) == set()


def test_an_exception_before_anything_drives_leaves_its_run_to_the_next_collection(
    runs, tmp_path, made
):
    with contextlib.suppress(SutMissing):
        runs.execute(runs.spec("rude-house", "no such system"), tmp_path / "run.mcap")
    gc.collect()
    assert made
    assert left(made) == set()
