"""One run, end to end, with real parts: scene, simulator, system under test, trace, oracles."""

import contextlib
import errno
import gc
import hashlib
import io
import json
import weakref
from dataclasses import replace

import numpy as np
import pymunk
import pytest
from mcap.reader import make_reader

from daemon import run
from daemon.judging.oracles import SignalSampler
from daemon.model.attachments import SutMissing
from daemon.model.spec import kernel_list, short_run
from daemon.model.sut import CostmapPicture, Progress
from daemon.model.verdicts import Outcome, Verdict
from daemon.run import SceneMismatchError
from daemon.run_loop import RunLoop
from daemon.simulator import World
from daemon.stacks.calls import make_in_time
from daemon.stacks.ros1.costmap.costmap import Costmap
from daemon.stacks.ros1.navfn.planner import Navfn
from daemon.trace import TraceWriter, read_trace
from grammars.floorplan import load_floorplan
from grammars.model.behaviour import Jump, Reaction, WaypointReached
from grammars.model.kinematics import link_poses
from grammars.model.robot_files import load_robot
from grammars.oracle import SIGNALS, RunOutline, Signal, object_signals, obstacle_names
from grammars.oracle._bounds import signal_bound
from grammars.scenery import load_scenery
from grammars.scenery.composition import compile_scene, resolve_behaviours
from grammars.text import codec
from templates.occupancy import occupancy_grid, with_objects
from tests.engine.conftest import Runs
from tests.engine.systems import System, later
from tests.engine.trace.mcap_checks import complaints


def showing(decision):
    """The decision with all that can be shown."""
    cells = np.zeros((4, 5), np.uint8)
    picture = CostmapPicture(decision.estimate.time, "odom", 0.05, 0.0, 0.0, cells)
    return replace(decision, particles=np.zeros((3, 3)), costmap=picture)


def test_what_a_system_under_test_shows_is_recorded(runs, tmp_path, plug):
    plug(System(answer=showing))
    path = tmp_path / "run.mcap"
    runs.execute(runs.spec(kind="plugged", limit=3.0), path)
    with path.open("rb") as stream:
        messages = [
            (channel.topic, message.log_time / 1e9)
            for _, channel, message in make_reader(stream).iter_messages()
        ]
    for topic in ("/particlecloud", "/move_base/local_costmap/costmap"):
        assert [time for name, time in messages if name == topic] == [0.0, 1.0, 2.0, 3.0]


def test_odometry_of_an_exact_period_keeps_its_stamps(runs, tmp_path, campaigns, plug):
    plug(System())
    robot = load_robot(campaigns / "robots" / "robile-planar-move.yaml")
    runs.execute(runs.spec(kind="plugged", robot=robot, limit=5.0), tmp_path / "run.mcap")
    trace = read_trace(tmp_path / "run.mcap")
    assert trace.problems == ()
    np.testing.assert_allclose(trace.odometry.time, 0.051 * np.arange(99), atol=1e-9)
    truth, odometry = trace.ground_truth, trace.odometry
    expected = np.interp(odometry.time, truth.time, truth.x)
    np.testing.assert_allclose(odometry.x, expected, atol=1e-6)


def test_leading_margins_are_there_where_asked_for_and_verdicts_inside_the_trace(runs, tmp_path):
    spec = replace(runs.submission.specs[5], limit=5.0)
    plain = runs.execute(spec, tmp_path / "plain.mcap")
    led = runs.execute(spec, tmp_path / "led.mcap", leads=True)
    assert plain.leads == ()
    assert (led.verdicts, led.digest) == (plain.verdicts, plain.digest)
    data = (tmp_path / "led.mcap").read_bytes()
    assert data == (tmp_path / "plain.mcap").read_bytes()
    assert led.trace.sha256 == hashlib.sha256(data).hexdigest()
    *_, last = make_reader(io.BytesIO(data)).iter_attachments()
    inside = json.loads(last.data)
    assert inside["outcome"] == led.outcome
    assert codec.from_plain(tuple[Verdict, ...], inside["verdicts"]) == led.verdicts
    assert complaints(tmp_path / "led.mcap") == []
    limited = {v.oracle: v for v in led.verdicts if v.outcome is not Outcome.MEASURE}
    assert [lead.oracle for lead in led.leads] == list(limited)
    for lead in led.leads:
        fails = limited[lead.oracle].outcome is Outcome.FAIL
        assert fails == (lead.margin is not None and lead.margin < 0.0)


def test_a_judge_that_fails_leaves_the_recording(runs, tmp_path, monkeypatch):
    def fail(*_):
        raise RuntimeError("no judgement")

    monkeypatch.setattr("daemon.run.judge", fail)
    with pytest.raises(RuntimeError, match="no judgement"):
        runs.execute(runs.spec(kind="idle", limit=1.0), tmp_path / "run.mcap")
    assert read_trace(tmp_path / "run.mcap").complete


def test_a_trace_whose_verdicts_could_not_be_written_has_no_name(runs, tmp_path, monkeypatch):
    def fail(self, data):
        self._container.reopen()
        raise OSError(errno.ENOSPC, "no space left")

    monkeypatch.setattr(TraceWriter, "add_verdicts", fail)
    with pytest.raises(OSError, match="no space left"):
        runs.execute(runs.spec(kind="idle", limit=1.0), tmp_path / "run.mcap")
    assert [path.name for path in tmp_path.iterdir()] == ["run.mcap.partial"]


def test_another_seed_gives_another_trace(runs, tmp_path):
    spec = runs.spec(kind="idle", limit=1.0)
    one = runs.execute(spec, tmp_path / "one.mcap")
    other = runs.execute(replace(spec, seed=spec.seed + 1), tmp_path / "other.mcap")
    assert one.trace.sha256 != other.trace.sha256


def test_repeats_are_paired_across_scenarios(runs):
    seeds = {}
    for spec in runs.submission.specs:
        seeds.setdefault(spec.scenario, []).append(spec.seed)
    assert seeds["open-house"] == seeds["busy-house"] == seeds["rude-house"]
    assert len(set(seeds["open-house"])) == 5


def test_a_run_that_reaches_its_limit_ends_complete_and_tells_its_progress(runs, tmp_path):
    spec, seen = runs.spec(kind="idle", limit=3.0), []
    result = runs.execute(spec, tmp_path / "run.mcap", on_progress=seen.append)
    trace = read_trace(tmp_path / "run.mcap")
    assert result.ended == "limit"
    assert result.timing.simulated == pytest.approx(3.0)
    assert trace.complete
    assert trace.ground_truth.time[-1] == pytest.approx(3.0)
    assert trace.spec == spec
    assert [s.time for s in seen] == pytest.approx([0.0, 1.0, 2.0, 3.0])
    assert len(seen[0].joints) == len(runs.scene.joint_names)


def test_a_run_ends_when_the_mission_is_over(runs, tmp_path, plug):
    done = Progress(0, 0, "succeeded")
    plug(System(answer=later(lambda right: replace(right, progress=done), 1.5)))
    result = runs.execute(runs.spec(kind="plugged", limit=60.0), tmp_path / "run.mcap")
    assert result.ended == "finished"
    assert result.timing.simulated == pytest.approx(1.5, abs=0.1)


def test_a_scene_that_is_not_the_specified_one_is_refused(runs, tmp_path):
    with pytest.raises(SceneMismatchError):
        runs.execute(runs.spec(kind="idle", scene="0" * 64), tmp_path / "run.mcap")
    assert list(tmp_path.iterdir()) == []


# Somebody at home in the demo flat.


@pytest.fixture(scope="module")
def crowd(campaigns, tmp_path_factory):
    """The scene of a house with a visitor, and the trace of a run while a door reacts."""
    folder = campaigns / "demo"
    layers = [load_scenery(folder / f"{name}.scenery") for name in ("doors", "people")]
    home = Runs(folder / "campaign.yaml")
    home.scene = compile_scene(load_floorplan(folder / "flat.fpm"), layers)
    seed = np.random.SeedSequence(1)
    walks = resolve_behaviours(home.scene, layers, seed=seed, limit=36.0).behaviours
    spec = home.spec("open-house", scene=home.scene.digest, limit=36.0)
    shut = Reaction("bedroom_door.hinge", -1.6, 0.0, WaypointReached("living-room"), Jump(), 1.0)
    held = [each for each in spec.behaviours if each.joint != shut.joint]
    path = tmp_path_factory.mktemp("crowd") / "run.mcap"
    home.execute(replace(spec, behaviours=(*held, *walks, shut)), path)
    return home.scene, read_trace(path)


def test_the_visitor_walks_in_the_trace_and_makes_way_for_the_robot(crowd):
    scene, trace = crowd
    visitor = next(o for o in scene.objects if o.name == "visitor")
    first = scene.joint_names.index("visitor.x")
    states = trace.joints.position[:, first : first + 3]
    for row in (0, 40, len(states) // 2):
        pose = link_poses(visitor, states[row].tolist())["body"]
        assert 1.6 - 1e-9 <= pose.x <= 6.6 + 1e-9
        assert pose.y == pytest.approx(0.0, abs=1e-9)
    steps = np.diff(states[:, 0]) / np.diff(trace.joints.time)
    assert 0.69 < np.abs(steps).max() < 0.7 + 1e-6
    texts = [event.text for event in trace.events if event.source == "visitor"]
    assert texts[0] == "sets out"
    assert "yields to the robot" in texts


def test_a_door_reacts_to_the_mission(crowd):
    (reached,) = (e.time for e in crowd[1].events if e.text == "waypoint 2 reached")
    (reacted,) = (e.time for e in crowd[1].events if e.source == "bedroom_door.hinge")
    assert 1.0 <= reacted - reached <= 1.2


def test_the_map_of_a_crowded_house_shows_no_people(crowd):
    scene, _ = crowd
    alone = replace(scene, objects=tuple(o for o in scene.objects if o.name != "visitor"))
    building = occupancy_grid(scene, laser_height=0.3)
    crowded, empty = (
        with_objects(building, each, laser_height=0.3, joints={}).cells for each in (scene, alone)
    )
    assert np.array_equal(crowded, empty)


# A robot with several lasers, each at its own rate and told apart all the way.


@pytest.fixture(scope="module")
def two_lasers(campaigns):
    return Runs(campaigns / "two_lasers" / "campaign.yaml")


class Listener(System):
    """Keeps the scans it gets."""

    period = 0.05

    def __init__(self):
        super().__init__()
        self.scans = []

    def update(self, observation):
        self.scans += observation.scans
        return super().update(observation)


def test_each_laser_has_its_own_rate_and_they_come_in_order(two_lasers, tmp_path, plug):
    heard = plug(Listener()).scans
    two_lasers.execute(two_lasers.spec(kind="plugged", limit=2.0), tmp_path / "run.mcap")
    trace = read_trace(tmp_path / "run.mcap", scans=True)
    front, rear = trace.scans
    np.testing.assert_allclose(front.time, np.arange(21) / 10)
    np.testing.assert_allclose(rear.time, np.ceil(np.arange(17) * 12.5 - 1e-9) / 100)
    assert [s.time for s in heard] == sorted(s.time for s in heard)
    together = [s.laser for s in heard if s.time in (0.0, 0.5, 1.0, 1.5, 2.0)]
    assert together == ["front", "rear"] * 5
    for track in trace.scans:
        came = [s.ranges for s in heard if s.laser == track.laser]
        np.testing.assert_array_equal(track.ranges, came)


def test_the_pilot_drives_a_robot_with_two_lasers(two_lasers, tmp_path):
    """The other stacks do so in tests/long."""
    spec = two_lasers.spec("open-house")
    assert spec.sut.name == "pilot"
    assert two_lasers.execute(spec, tmp_path / "run.mcap").outcome is Outcome.PASS


# The list of kernels by which others load what a short run compiled.


def test_numbers_choose_no_kernel_and_words_do(runs):
    def name(**changes):
        return kernel_list(runs.spec(kind="pilot", parameters=changes))

    assert name(max_speed=0.4) == name(max_speed=0.5)
    assert name(planner="a") != name(planner="b")
    assert name(max_speed=0.4) != name()
    demo = runs.spec()
    omnidirectional = replace(demo.robot.drive, kind="omnidirectional")
    differential = replace(demo.robot.drive, kind="differential")
    robots = [replace(demo.robot, drive=drive) for drive in (omnidirectional, differential)]
    assert len({kernel_list(replace(demo, robot=robot)) for robot in robots}) == 2


def test_what_lives_elsewhere_is_left_out_of_the_short_run(runs):
    outside, demo = runs.spec(kind="ros2", parameters={"launch": "nav2"}), runs.spec()
    assert short_run(outside).sut.kind == "idle"
    assert short_run(demo).sut == demo.sut
    assert short_run(demo).limit < demo.limit


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


@pytest.mark.parametrize("scenario", ["open-house", "rude-house"])
def test_no_signal_of_a_run_leaves_the_bounds_known_before_it(runs, tmp_path, scenario):
    spec = runs.spec(scenario, limit=40.0)
    runs.execute(spec, tmp_path / "run.mcap")
    sampler, scene = SignalSampler(read_trace(tmp_path / "run.mcap")), runs.scene
    outline = RunOutline(scene, spec.robot, spec.mission, 40.0, 0.5, spec.behaviours)
    plain = (k.name for k in SIGNALS.values() if not (k.relates or k.report or k.dimension is None))
    signals = [Signal(name) for name in (*plain, *object_signals(scene))]
    signals += [Signal("distance", (Signal("robot"), Signal(n))) for n in obstacle_names(scene)]
    for signal in signals:
        low, high, *_, slack = signal_bound(signal, outline)
        values = sampler.sample(signal).values
        known = values[~np.isnan(values)]
        assert ((low - slack <= known) & (known <= high + slack)).all(), signal.name
