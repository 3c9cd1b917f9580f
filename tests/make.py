"""Small values of the models, one of each: robots, specifications, results, rows, searches."""

from dataclasses import replace

from daemon.model.search import (
    ExtendRequest,
    OracleScale,
    Proposal,
    SearchParameter,
    SearchSubmission,
    SearchTask,
)
from daemon.model.spec import (
    MapSettings,
    OracleText,
    RunResult,
    RunSpec,
    SutReference,
    Timing,
    TraceInfo,
)
from daemon.model.status import CampaignRow, RunRow, count_runs
from daemon.model.submission import CellRun, Submission
from daemon.model.verdicts import Outcome, RunState, Verdict, combine
from grammars.model.geometry import Pose2
from grammars.model.mission import Mission, Waypoint
from grammars.model.robot import Drive, Laser, Mount, OdometryNoise, Robot
from grammars.model.scene import Region, Scene

ROBOT = Robot(
    "disc",
    ((-0.2, -0.2), (0.2, -0.2), (0.2, 0.2), (-0.2, 0.2)),
    0.3,
    20.0,
    Drive("differential", 0.5, 0.0, 1.0, 1.0, 0.0, 2.0, 100.0, 20.0, 0.5),
    Laser(Mount(0.0), 0.2, -1.5, 1.5, 91, 0.05, 10.0, 10.0, 0.01, 0.0),
    OdometryNoise(50.0, 0.01, 0.01, 0.01),
)
SCENE = Scene("room", (Region("room", ((0.0, 0.0), (4.0, 0.0), (4.0, 4.0), (0.0, 4.0))),), (), ())
MISSION = Mission("across", Pose2(1.0, 1.0, 0.0), (Waypoint("goal", 3.0, 3.0),))


def make_spec(repeat=0, *, scenario="S1", files=None, **parameters):
    """A specification; ``parameters`` and ``files`` reach the test executor as those of the SUT."""
    return RunSpec(
        campaign="test",
        scenario=scenario,
        sut=SutReference("pilot", "pilot", parameters, files or {}),
        repeat=repeat,
        scene=SCENE.digest,
        robot=ROBOT,
        mission=MISSION,
        behaviours=(),
        oracles=(OracleText("arrives", "within 10 s"),),
        map=MapSettings(),
        seed=repeat,
        limit=10.0,
    )


def make_submission(campaign, runs=3, **parameters):
    """A campaign of ``runs`` repeats of one scenario."""
    one = submission_of(campaign, make_spec(**parameters))
    return replace(one, runs=tuple(CellRun(0, 0, repeat, repeat) for repeat in range(runs)))


def submission_of(campaign, *specs, reserve=()):
    """A campaign of the given runs; fresh, so that it does what is tested every time."""
    plain = Submission.of(campaign, (*specs, *reserve), (SCENE,))
    return replace(
        plain,
        name=f"Campaign {campaign}",
        about="for tests",
        source="text",
        runs=plain.runs[: len(specs)],
        reserve=plain.runs[len(specs) :],
        fresh=True,
    )


def make_result(spec, *, outcome=Outcome.PASS, margin=0.5, trace=None, wall=0.01):
    """A result with one verdict."""
    verdict = Verdict("arrives", "within 10 s", outcome, margin, margin, "s")
    info = trace or TraceInfo("0" * 64, 0, 0)
    return RunResult(spec.digest, outcome, (verdict,), "finished", info, Timing(wall, wall, 5.0))


TASK = SearchTask(
    "doors",
    "S1",
    "pilot",
    "arrives",
    (OracleScale("arrives", 1.0, "s"),),
    (SearchParameter("swing", "behaviours", 0, "swing", "deg/s", 40.0, 80.0, 0.1),),
    runs=30,
)
"""A search of one parameter; proposal n is the scenario ``doors.n``."""


def make_search(campaign, client="lab", **changes):
    """A search that a client begins; ``changes`` are those of its task."""
    task = replace(TASK, **changes)
    return SearchSubmission(
        campaign, task.name, "for tests", "text", task, "campaign.yaml", client=client
    )


def make_proposal(position, phase="explore"):
    """The proposal of a position, by itself."""
    return Proposal(position, position, 0, phase, "halton", False, (40.0 + position,))


def make_extension(campaign, first, count=1, *, client="lab", send_scenes=True, **parameters):
    """``count`` runs of a search from position ``first`` on, one of each proposal."""
    positions = range(first, first + count)
    specs = (make_spec(scenario=TASK.scenario_of(n), number=n, **parameters) for n in positions)
    scenes = (SCENE,) if send_scenes else ()
    runs = Submission.of(campaign, tuple(specs), scenes)
    return ExtendRequest(client, tuple(map(make_proposal, positions)), runs)


def run_result(
    *verdicts, outcome=None, ended="finished", wall=0.5, cpu=0.5, simulated=60.0, **more
):
    """What a run with these verdicts leaves."""
    return RunResult(
        "0" * 64, outcome or combine(verdicts), verdicts, ended, TraceInfo("1" * 64, 1000, 10),
        Timing(0.5, cpu, simulated), **more,
    )  # fmt: skip


FRESH = {"outcome": None, "oracle": "", "margin": None, "unit": "", "simulated": 0.0,
         "wall": 0.0, "trace": ""}  # fmt: skip
"""What the row of a run has before there is a result."""


def run_row(id="c.0", scenario="S1", sut="pilot", repeat=0, result=None, **more):
    """A run of a campaign; one with a result is done."""
    campaign, _, index = id.rpartition(".")
    values = {"state": RunState.QUEUED if result is None else RunState.DONE, "limit": 1200.0}
    if result is not None:
        values |= {"outcome": result.outcome, "simulated": result.timing.simulated}
        values |= {"wall": result.timing.wall, "attempt": 1}
    values = {"attempt": 0, "worker": ""} | FRESH | values | more
    number = int(index) if index.isdecimal() else 0
    return RunRow(id, campaign, number, scenario, sut, repeat, result=result, **values)


def campaign_row(id, **more):
    """A campaign that has ended, of no runs but for what is said of it."""
    values = count_runs([]) | {"about": "", "submitted_at": 0.0, "finished_at": 1.0, "total": 0}
    return CampaignRow(**values | {"id": id, "name": id.rpartition("-")[0]} | more)


def with_result(row, **changes):
    """The same run with another result."""
    return replace(row, result=replace(row.result, **changes))
