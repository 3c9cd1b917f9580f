"""A small campaign on disk: a robot in a corridor, past a door that shuts or does not."""

from dataclasses import replace

import numpy as np

from daemon.analysis.recorded import read_traces
from daemon.analysis.report import read_report_data
from daemon.analysis.results import read_results, write_campaign_note
from daemon.model.assessments import AssessmentRules, Expectation, RepeatPolicy, ScenarioComparison
from daemon.model.ids import trace_name
from daemon.model.spec import MapSettings, OracleText, RunSpec, SutReference
from daemon.model.submission import Submission
from daemon.model.sut import Estimate, Progress
from daemon.trace import TraceWriter
from grammars.model.behaviour import Jump, Trigger
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from grammars.text.words import command_line
from tests.engine.judging.traces import CORRIDOR, ROBOT, mission

NAME = 'evil <script>alert("1")</script> & $x^2$'
ABOUT = "Is <b>everything</b> & all of it escaped?"
WHY = "the <i>corridor</i> is narrow"
SHUT, OPEN = "shut & <u>bolted</u>", "open $\\alpha$ 門 \x07"
SUTS = ("near", 'far "<b>"')
REPEATS = 2
SECONDS, SPEED = 20.0, 0.5
LATERAL = {SUTS[0]: 0.6, SUTS[1]: 0.2}
"""How far left of the middle each system drives [m]: 0.6 m is inside the buffer all the time."""
TO_THE_LEFT = 161
"""The ray that meets the wall beside the robot: it looks 90.4 degrees to the left."""

ORACLES = (
    OracleText("reached", "reached(mission, 0.25 m)"),
    OracleText("localised", "always(loc.error <= 0.35 m)"),
    OracleText("buffer", "always(clearance(0.55 m, 0.433 m) >= 0 m)"),
    OracleText("buffer-time", "time(clearance(0.55 m, 0.433 m) < 0 m)"),
)
DECLARED = AssessmentRules(
    RepeatPolicy(n=REPEATS),
    (
        ScenarioComparison(
            "delay", "delay", SHUT, OPEN, None, "<=", 30.0, "s", "delay(shut vs open)"
        ),
    ),
    (Expectation("shut*", "buffer", (SUTS[0],), "fail", WHY),),
)


def spec(scenario, sut, repeat):
    shuts = Trigger("door-17.hinge", 0.0, -1.0, 1.3, Jump())
    return RunSpec(
        campaign=NAME,
        scenario=scenario,
        sut=SutReference(sut, "pilot", {}),
        repeat=repeat,
        scene=CORRIDOR.digest,
        robot=ROBOT,
        mission=mission((9.0, LATERAL[sut])),
        behaviours=(shuts,) if scenario == SHUT else (),
        oracles=ORACLES,
        map=MapSettings(),
        seed=repeat,
        limit=60.0,
    )


def record(path, run):
    """Record 20 s straight on; the estimate is off by 0.1 m, more in later repeats.

    Of the laser's rays one has a return.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lateral = LATERAL[run.sut.name]
    with TraceWriter(path, run, CORRIDOR) as trace:
        trace.static(OccupancyGrid(0.5, 0.0, 0.0, np.zeros((4, 20), np.int8)))
        trace.progress(0.0, Progress(0, 0, "active"))
        for step in range(round(SECONDS * 20) + 1):
            now = step / 20
            trace.ground_truth(now, Pose2(SPEED * now, lateral), Twist2(SPEED, 0.0, 0.0))
            trace.joints(now, np.zeros(1), np.zeros(1))
            if step % 20 == 0:
                ranges = np.full(ROBOT.laser.rays, np.inf, np.float32)
                ranges[TO_THE_LEFT] = 1.0 - lateral
                trace.scan(now, ranges)
            if step % 10 == 0:
                off = 0.1 + 0.02 * run.repeat
                believed = Pose2(SPEED * now + off, lateral)
                trace.estimate(Estimate(now, believed, np.diag([0.01, 0.01, 0.01])))
            if run.behaviours and step == 280:
                trace.event(now, "door-17.hinge", "triggered at 1.299 m: to -1")
        if run.sut.name == SUTS[0]:
            trace.contact(5.0, "robot", "wall-north", (2.5, 1.0), (0.0, 1.0), 0.01)
        trace.close("finished", "")
    return path


def record_all(folder):
    specs = tuple(
        spec(scenario, sut, repeat)
        for scenario in (SHUT, OPEN)
        for sut in SUTS
        for repeat in range(REPEATS)
    )
    for run in specs:
        name = trace_name("c", run.scenario, run.sut.name, run.repeat)
        record(folder / name.partition("/")[2], run)
    return specs


def record_campaign(folder):
    """Leave a folder as `scenario run` does."""
    specs = record_all(folder)
    plain = Submission.of("c", specs, (CORRIDOR,))
    write_campaign_note(folder, replace(plain, name=NAME, about=ABOUT, declared=DECLARED))
    return folder


def report_of(folder, processes=1):
    """Read a folder of traces for its report."""
    source = read_traces(str(folder))
    results = read_results(source, source.row)
    return read_report_data(results, tuple(source.specs.values()), processes=processes)


def with_assessment(data, assessment):
    """Return the data of a report with another assessment."""
    return replace(data, input=replace(data.input, assessment=assessment))


def commands(run, oracle, failed):
    """Commands about a run, as a page shows them."""
    return [(command_line("judge", run), "judge it again")]
