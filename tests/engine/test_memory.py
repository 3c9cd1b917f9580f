"""What a run leaves in the memory of a process that goes on: nothing of its world and its maps."""

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

KINDS = ("ros", "pilot", "no such system")
"""The last one ends a run with an exception, before anything drives."""


@pytest.fixture
def made(monkeypatch):
    """All that is made of the types that hold much memory, while only runs collect garbage."""
    found = []

    def noting(init):
        def note(self, *args, **kwargs):
            init(self, *args, **kwargs)
            found.append(weakref.ref(self))

        return note

    stacks = [type(make_in_time(kind, {})) for kind in KINDS[:2]]
    types = [RunLoop, World, pymunk.Space, TraceWriter, Costmap, Navfn, *stacks]
    for kind in types:
        monkeypatch.setattr(kind, "__init__", noting(kind.__init__))
    gc.collect()
    gc.disable()
    yield found
    gc.enable()


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_large_outlives_its_run(kind, runs, tmp_path, made):
    for _ in range(2):
        try:
            runs.execute(runs.spec("rude-house", kind, limit=2.0), tmp_path / "run.mcap")
        except SutMissing:
            assert kind == KINDS[-1]
    if kind == KINDS[-1]:
        gc.collect()  # what a run leaves that ends with an exception goes with the next one
    kept = [left for each in made if (left := each()) is not None]
    assert made
    assert not kept


@pytest.mark.parametrize("kind", KINDS[:2])
def test_what_drove_is_gone_before_its_trace_is_judged(kind, runs, tmp_path, made, monkeypatch):
    kept = []

    def judge(*_):
        kept.extend(type(left) for each in made if (left := each()) is not None)
        return ()

    monkeypatch.setattr(run, "judge", judge)
    runs.execute(runs.spec("rude-house", kind, limit=1.0), tmp_path / "run.mcap")
    assert set(kept) == {TraceWriter}
