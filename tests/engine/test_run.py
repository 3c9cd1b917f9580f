"""One run, end to end, with real parts: scene, simulator, system under test, trace, oracles."""

import errno
import hashlib
import json
import math
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from daemon.campaign import expand, load_campaign
from daemon.model.spec import SutReference
from daemon.model.sut import CostmapPicture, Decision, Estimate, Progress
from daemon.model.verdicts import Outcome, Verdict
from daemon.run import SceneMismatchError, execute
from daemon.trace import TraceWriter, read_trace
from grammars.model.geometry import Pose2, Twist2
from grammars.model.robot_files import load_robot
from grammars.text import codec
from tests.engine.trace.mcap_checks import complaints
from tests.plugins import plug_in


@pytest.fixture(scope="module")
def demo(campaigns):
    return expand(load_campaign(campaigns / "demo" / "campaign.yaml"))


@pytest.fixture(scope="module")
def scene(demo):
    return demo.scenes[0]


def idle(demo, *, seconds, scenario="busy-house"):
    spec = next(s for s in demo.specs if s.scenario == scenario)
    return replace(spec, sut=SutReference("idle", "idle", {}), limit=seconds)


class Scripted:
    """A system under test that does what a test tells it to."""

    period = 0.1
    needs_ground_truth = False

    def __init__(
        self, fail_at=1e9, finish_at=1e9, nonsense_at=1e9, lost_at=1e9, silent_at=1e9, show_at=1e9
    ):
        self._fail_at, self._finish_at, self._nonsense_at = fail_at, finish_at, nonsense_at
        self._lost_at, self._silent_at, self._show_at = lost_at, silent_at, show_at

    def start(self, briefing):
        self.briefing = briefing

    def update(self, observation):
        if observation.time >= self._fail_at:
            raise RuntimeError("no map")
        state = "succeeded" if observation.time >= self._finish_at else "active"
        speed = math.nan if observation.time >= self._nonsense_at else 0.2
        if observation.time >= self._silent_at:
            return None
        x = math.nan if observation.time >= self._lost_at else 0.0
        estimate = Estimate(observation.time, Pose2(x, 0.0, 0.0), np.eye(3))
        decision = Decision(Twist2(speed, 0.0, 0.0), Progress(0, 0, state), estimate)
        if observation.time < self._show_at:
            return decision
        cells = np.zeros((4, 5), np.uint8)
        picture = CostmapPicture(observation.time, "odom", 0.05, 0.0, 0.0, cells)
        return replace(decision, particles=np.zeros((3, 3)), costmap=picture)


@pytest.fixture
def scripted(monkeypatch):
    def make(parameters):
        return Scripted(**{key: float(str(value)) for key, value in parameters.items()})

    plug_in(monkeypatch, "scripted", make)


RUN_IN_A_PROCESS = """
import sys
from pathlib import Path
from daemon.run import execute
from daemon.model.spec import RunSpec
from grammars.text import codec
from grammars.model.scene import Scene
spec = codec.from_json(RunSpec, Path(sys.argv[1]).read_bytes())
scene = codec.from_json(Scene, Path(sys.argv[2]).read_bytes())
print(execute(spec, scene, trace_path=Path(sys.argv[3])).digest)
"""


def run_in_a_process(spec, scene, folder, hash_seed):
    (folder / "spec.json").write_bytes(codec.to_json(spec))
    (folder / "scene.json").write_bytes(codec.to_json(scene))
    trace = folder / "run.mcap"
    arguments = [str(folder / "spec.json"), str(folder / "scene.json"), str(trace)]
    done = subprocess.run(
        [sys.executable, "-c", RUN_IN_A_PROCESS, *arguments],
        env={"PYTHONHASHSEED": hash_seed, "PATH": ""},
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[2],
    )
    return done.stdout.strip(), trace.read_bytes()


def test_the_same_specification_gives_the_same_bytes_in_another_process(demo, scene, tmp_path):
    spec = replace(demo.specs[5], limit=20.0)
    here = execute(spec, scene, trace_path=tmp_path / "here.mcap").digest
    # Hashes have another seed there.
    seed = "1" if os.environ.get("PYTHONHASHSEED") != "1" else "2"
    there = run_in_a_process(spec, scene, tmp_path, seed)
    assert there == (here, (tmp_path / "here.mcap").read_bytes())


def test_what_a_system_under_test_shows_is_recorded(demo, scene, tmp_path, scripted):
    spec = replace(idle(demo, seconds=3.0), sut=SutReference("shows", "scripted", {"show_at": 0.0}))
    path = tmp_path / "run.mcap"
    execute(spec, scene, trace_path=path)
    with path.open("rb") as stream:
        messages = [
            (channel.topic, message.log_time / 1e9)
            for _, channel, message in make_reader(stream).iter_messages()
        ]
    for topic in ("/particlecloud", "/move_base/local_costmap/costmap"):
        assert [time for name, time in messages if name == topic] == [0.0, 1.0, 2.0, 3.0]


def test_odometry_of_an_exact_period_keeps_its_stamps(demo, scene, tmp_path, campaigns, scripted):
    robot = load_robot(campaigns / "robots" / "robile-planar-move.yaml")
    spec = replace(idle(demo, seconds=5.0), robot=robot, sut=SutReference("drives", "scripted", {}))
    execute(spec, scene, trace_path=tmp_path / "run.mcap")
    trace = read_trace(tmp_path / "run.mcap")
    assert trace.problems == ()
    np.testing.assert_allclose(trace.odometry.time, 0.051 * np.arange(99), atol=1e-9)
    truth, odometry = trace.ground_truth, trace.odometry
    expected = np.interp(odometry.time, truth.time, truth.x)
    np.testing.assert_allclose(odometry.x, expected, atol=1e-6)


def test_leading_margins_are_there_where_they_are_asked_for_and_change_nothing(
    demo, scene, tmp_path
):
    spec = replace(demo.specs[5], limit=20.0)
    plain = execute(spec, scene, trace_path=tmp_path / "plain.mcap")
    led = execute(spec, scene, trace_path=tmp_path / "led.mcap", leads=True)
    assert plain.leads == ()
    assert (led.verdicts, led.digest) == (plain.verdicts, plain.digest)
    assert (tmp_path / "led.mcap").read_bytes() == (tmp_path / "plain.mcap").read_bytes()
    limited = {v.oracle: v for v in led.verdicts if v.outcome is not Outcome.MEASURE}
    assert [lead.oracle for lead in led.leads] == list(limited)
    for lead in led.leads:
        fails = limited[lead.oracle].outcome is Outcome.FAIL
        assert fails == (lead.margin is not None and lead.margin < 0.0)


def test_a_trace_has_the_verdicts_of_its_run_inside(demo, scene, tmp_path):
    path = tmp_path / "run.mcap"
    result = execute(replace(demo.specs[5], limit=20.0), scene, trace_path=path)
    with path.open("rb") as stream:
        found = {a.name: a.data for a in make_reader(stream).iter_attachments()}
    inside = json.loads(found["verdicts.json"])
    assert inside["outcome"] == result.outcome
    assert codec.from_plain(tuple[Verdict, ...], inside["verdicts"]) == result.verdicts
    assert result.trace.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert complaints(path) == []


def test_a_judge_that_fails_leaves_the_recording(demo, scene, tmp_path, monkeypatch):
    def fail(*_):
        raise RuntimeError("no judgement")

    monkeypatch.setattr("daemon.run.judge", fail)
    with pytest.raises(RuntimeError, match="no judgement"):
        execute(idle(demo, seconds=1.0), scene, trace_path=tmp_path / "run.mcap")
    assert read_trace(tmp_path / "run.mcap").complete


def test_a_trace_whose_verdicts_could_not_be_written_has_no_name(
    demo, scene, tmp_path, monkeypatch
):
    def fail(self, data):
        self._container.reopen()
        raise OSError(errno.ENOSPC, "no space left")

    monkeypatch.setattr(TraceWriter, "add_verdicts", fail)
    with pytest.raises(OSError, match="no space left"):
        execute(idle(demo, seconds=1.0), scene, trace_path=tmp_path / "run.mcap")
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap.partial"]


def test_another_seed_gives_another_trace(demo, scene, tmp_path):
    spec = idle(demo, seconds=2.0)
    one = execute(spec, scene, trace_path=tmp_path / "one.mcap")
    other = execute(replace(spec, seed=spec.seed + 1), scene, trace_path=tmp_path / "other.mcap")
    assert one.trace.sha256 != other.trace.sha256


def test_repeats_are_paired_across_scenarios(demo):
    seeds = {
        scenario: [s.seed for s in demo.specs if s.scenario == scenario]
        for scenario in ("open-house", "busy-house", "rude-house")
    }
    assert seeds["open-house"] == seeds["busy-house"] == seeds["rude-house"]
    assert len(set(seeds["open-house"])) == 5


def test_a_run_that_reaches_its_limit_ends_complete(demo, scene, tmp_path):
    result = execute(idle(demo, seconds=3.0), scene, trace_path=tmp_path / "run.mcap")
    trace = read_trace(tmp_path / "run.mcap")
    assert result.ended == "limit"
    assert result.timing.simulated == pytest.approx(3.0)
    assert trace.complete
    assert trace.ground_truth.time[-1] == pytest.approx(3.0)
    assert trace.spec == idle(demo, seconds=3.0)


@pytest.mark.usefixtures("scripted")
def test_a_run_ends_when_the_mission_is_over(demo, scene, tmp_path):
    sut = SutReference("scripted", "scripted", {"finish_at": 1.5})
    spec = replace(idle(demo, seconds=60.0), sut=sut)
    result = execute(spec, scene, trace_path=tmp_path / "run.mcap")
    assert result.ended == "finished"
    assert result.timing.simulated == pytest.approx(1.5, abs=0.1)


@pytest.mark.usefixtures("scripted")
@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("nonsense_at", "finite"),
        ("lost_at", "its estimate has values that are not finite"),
        ("silent_at", r"update\(\) must return a Decision, not NoneType"),
    ],
)
def test_nonsense_is_an_error_of_the_system_under_test(demo, scene, tmp_path, fault, words):
    sut = SutReference("scripted", "scripted", {fault: 1.0})
    spec = replace(idle(demo, seconds=60.0), sut=sut)
    result = execute(spec, scene, trace_path=tmp_path / "run.mcap")
    assert (result.ended, result.outcome) == ("crashed", Outcome.ERROR)
    assert re.search(words, result.note)


@pytest.mark.usefixtures("scripted")
def test_a_crash_of_the_system_under_test_is_an_error_never_a_failure(demo, scene, tmp_path):
    sut = SutReference("scripted", "scripted", {"fail_at": 1.0})
    spec = replace(idle(demo, seconds=60.0), sut=sut)
    result = execute(spec, scene, trace_path=tmp_path / "run.mcap")
    assert result.ended == "crashed"
    assert result.outcome is Outcome.ERROR
    assert "RuntimeError: no map" in result.note
    events = [e.text for e in read_trace(tmp_path / "run.mcap").events]
    assert any("no map" in text for text in events)


def test_a_scene_that_is_not_the_specified_one_is_refused(demo, scene, tmp_path):
    spec = replace(idle(demo, seconds=1.0), scene="0" * 64)
    with pytest.raises(SceneMismatchError):
        execute(spec, scene, trace_path=tmp_path / "run.mcap")
    assert list(tmp_path.iterdir()) == []


def test_progress_is_told_while_it_runs(demo, scene, tmp_path):
    seen = []
    execute(
        idle(demo, seconds=4.0), scene, trace_path=tmp_path / "run.mcap", on_progress=seen.append
    )
    assert [s.time for s in seen] == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.0])
    assert len(seen[0].joints) == len(scene.joint_names)


def test_the_pilot_visits_every_room_when_the_doors_are_open(demo, scene, tmp_path):
    spec = next(s for s in demo.specs if s.scenario == "open-house")
    result = execute(spec, scene, trace_path=tmp_path / "run.mcap")
    assert result.ended == "finished"
    assert result.outcome is Outcome.PASS


WARMED = """
import sys
from pathlib import Path
from daemon.run import execute, load_kernels, warm_up
from daemon.model.spec import RunSpec
from grammars.text import codec
from grammars.model.scene import Scene

folder = Path(sys.argv[1])
spec = codec.from_json(RunSpec, (folder / "spec.json").read_bytes())
scene = codec.from_json(Scene, (folder / "scene.json").read_bytes())
warm_up()
load_kernels(spec, scene)
before = set(sys.modules)
execute(spec, scene, trace_path=folder / "trace.mcap", leads=True)
print(*sorted(name for name in set(sys.modules) - before))
"""


def test_a_warmed_process_loads_nothing_more_in_a_run(demo, scene, tmp_path):
    spec = replace(demo.specs[0], limit=1.0)
    (tmp_path / "spec.json").write_bytes(codec.to_json(spec))
    (tmp_path / "scene.json").write_bytes(codec.to_json(scene))
    done = subprocess.run(
        [sys.executable, "-c", WARMED, str(tmp_path)], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == []
