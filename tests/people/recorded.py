"""A recorded run to look at: ten seconds along the corridor, with everything a replay draws."""

from dataclasses import replace

import numpy as np

from daemon.batch.ledger import LedgerWriter, connect
from daemon.batch.stores import copy_between, file_sha256
from daemon.judging.oracles import judge, overall_outcome
from daemon.model.messages import Completion
from daemon.model.spec import OracleText, RunResult, Timing, TraceInfo
from daemon.model.submission import Submission
from daemon.model.sut import Estimate, Progress
from daemon.trace import TraceWriter, read_trace
from grammars.model.geometry import Pose2, Twist2
from grammars.model.grid import OccupancyGrid
from tests.analysis.report.recordings import DECLARED, OPEN, SHUT, SUTS, record, spec
from tests.engine.judging.traces import CORRIDOR
from tests.people.fake import ROBOT, make_row, make_scene, make_spec

WORLD = make_scene()
ORACLES = (
    OracleText("slow", "max(speed) <= 0.6 m/s"),
    OracleText("calm", "always(speed.angular <= 0.5 rad/s)"),
    OracleText("no-contact", "never(contact)"),
)
HIT, TURNED = 6.0, 8.0
"""When the robot touches something, and when it turns too fast [s]."""


def result_of_trace(path):
    """The result of a recorded run, judged by its own oracles."""
    trace = read_trace(path)
    verdicts = judge(trace, trace.spec.oracles)
    outcome, timing = overall_outcome(trace, verdicts), Timing(1.5, 1.0, 20.0)
    info = TraceInfo(file_sha256(path), path.stat().st_size, 1)
    return RunResult(trace.spec.digest, outcome, verdicts, "finished", info, timing)


def make_run(index=5):
    return replace(make_spec(make_row(index), WORLD.digest), oracles=ORACLES, limit=20.0)


def record_run(path, *, index=5, speed=0.5, outputs=None, robot=ROBOT):
    """Drive from (1, 2) to (6, 2) in 10 s while the door turns; everything at 20 Hz.

    At another ``speed`` [m/s] it does not come as far. With ``outputs`` it was an external system
    that printed them, whose planner said something.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with TraceWriter(path, replace(make_run(index), robot=robot), WORLD) as trace:
        trace.static(OccupancyGrid(0.5, 0.0, 0.0, np.zeros((8, 24), np.int8)))
        trace.plan(0.0, np.array([(1.0, 2.0), (4.0, 2.0)]))
        trace.plan(5.0, np.array([(4.0, 2.0), (8.0, 1.0)]))
        for step in range(201):
            now = step * 0.05
            pose = Pose2(1.0 + speed * now, 2.0)
            turning = 0.9 if abs(now - TURNED) < 0.01 else 0.0
            trace.ground_truth(now, pose, Twist2(speed, 0.0, turning))
            trace.joints(now, np.array([-0.1 * now]), np.array([-0.1]))
            if step % 20 == 0:
                for laser in robot.lasers:
                    trace.scan(now, np.full(laser.rays, 1.5, np.float32), laser.name)
                trace.estimate(Estimate(now, Pose2(pose.x + 0.2, pose.y), np.eye(3)))
            if abs(now - HIT) < 0.01:
                front = (pose.x + 0.35, 2.0)
                trace.contact(now, "robot", "door-1.leaf", front, (1.0, 0.0), 0.01)
            if step in (0, 120):
                done = int(step == 120)
                trace.progress(now, Progress(done, done, "active"))
        if outputs:
            trace.event(4.0, "planner_server", "no \x1b[31mpath\x1b[0m yet", level="warn")
        for name, data in (outputs or {}).items():
            trace.attach(name, data)
        trace.close("finished", "")
    return path


def campaign_at(places, store=""):
    """Fill a state directory: two runs with traces, in a store if there is one; one that waits."""
    places.make_folders()
    specs = (spec(SHUT, SUTS[0], 0), spec(OPEN, SUTS[0], 0), spec(OPEN, SUTS[1], 0))
    connection = connect(places.ledger)
    ledger = LedgerWriter(connection)
    plain = Submission.of("corr-1", specs, (CORRIDOR,))
    ledger.submit(replace(plain, name="corr", about="about", declared=DECLARED), 1.0)
    for lease in ledger.lease("w", 2, 1.0):
        path = record(places.trace(lease.trace), lease.spec)
        result = result_of_trace(path)
        ledger.complete(Completion("w", lease.run, lease.attempt, lease.token, result), 2.0)
        if store:
            url = f"{store}/{lease.trace}"
            copy_between(str(path), url)
            ledger.record_move(lease.trace, result.digest, url)
            path.unlink()
    connection.close()
