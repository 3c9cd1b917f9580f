"""A stand-in for ``daemon.run`` that costs nothing and misbehaves when told to.

The parameters of the system under test say what to do: ``sleep`` [s], ``until`` (goes on until
there is this file; ``{attempt}`` in its name is the attempt's number), ``outcome``, ``crash``
(the attempt numbers that die by SIGKILL), ``kill`` (the ancestor that dies by SIGKILL: 0 is the
guardian, 1 the zygote, 2 what started that), ``abort`` (say this and abort), ``raise``,
``full`` (the disk quota is used up until there is this file),
``allocate`` [MiB], ``log`` (a file that gets a line per execution), ``leaves`` (a file that gets
the numbers of the processes that are left behind), ``prints`` [MiB], ``evidence`` (characters of
it), ``verdicts`` (so many), ``size`` (of the trace, bytes at least), ``reads`` (a file attached,
its digest ends the trace). Systems of the kind ``absent`` are not installed.
"""

import errno
import hashlib
import os
import random
import signal
import sys
import time
from dataclasses import replace
from pathlib import Path

import psutil

from daemon.model.attachments import SutMissing
from daemon.model.live_judgement import LiveJudgement, LogLine
from daemon.model.spec import LeadingMargin, Snapshot, TraceInfo
from daemon.model.verdicts import Evidence, Outcome
from grammars.model.geometry import Pose2
from tests.make import make_result


def execute(
    spec, scene, *, trace_path, on_progress=None, interest=None, leads=False, judgements=None
):
    asked = spec.sut.parameters
    if spec.sut.kind == "absent":
        raise SutMissing('no system under test of kind "absent"')
    if "log" in asked:
        with Path(asked["log"]).open("a") as log:
            log.write(f"{spec.repeat} {os.getpid()} {os.nice(0)}\n")
    if "leaves" in asked:
        leave_process(Path(asked["leaves"]))
    for number in range(asked.get("prints", 0)):
        print(f"{number:_>{2**20 - 1}}")
    if _attempt(trace_path) in asked.get("crash", ()):
        os.kill(os.getpid(), signal.SIGKILL)
    if "kill" in asked:
        psutil.Process().parents()[asked["kill"]].kill()
    if "abort" in asked:
        print(asked["abort"])
        sys.stdout.flush()
        os.abort()
    if "full" in asked and not Path(asked["full"]).exists():
        raise OSError(errno.EDQUOT, os.strerror(errno.EDQUOT))
    if "raise" in asked:
        raise RuntimeError(asked["raise"])
    ballast = bytearray(asked.get("allocate", 0) * 2**20)
    gate = asked.get("until", "").replace("{attempt}", str(_attempt(trace_path)))
    seconds = asked.get("sleep", 0.0)
    _wait(seconds, gate, spec, on_progress, interest or (lambda: "progress"), judgements)
    data = f"{spec.digest} {scene.digest} {len(ballast)}".encode()
    if "reads" in asked:
        file = Path(spec.sut.local_parameters["files"][asked["reads"]])
        data += hashlib.sha256(file.read_bytes()).hexdigest().encode()
    data += random.Random(spec.seed).randbytes(asked.get("size", 0))
    trace_path.write_bytes(data)
    trace = TraceInfo(hashlib.sha256(data).hexdigest(), len(data), 1)
    result = make_result(spec, outcome=Outcome(asked.get("outcome", "pass")), trace=trace)
    evidence = Evidence(note="x" * asked.get("evidence", 0))
    verdict = replace(result.verdicts[0], evidence=evidence)
    margin = LeadingMargin("arrives", verdict.margin, "s")
    return replace(
        result,
        verdicts=(verdict,) * asked.get("verdicts", 1),
        leads=(margin,) if leads else (),
    )


def leave_process(file):
    """Leave two processes behind that nothing but SIGKILL ends, in sessions of their own.

    Their numbers stand in the file then. One is a program, the other a mere fork.
    """
    if os.fork() == 0:
        os.setsid()
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        program = os.fork() == 0
        if not program and os.fork():
            os._exit(0)
        log = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
        os.write(log, f"{os.getpid()}\n".encode())
        if program:
            os.execvp("sleep", ["sleep", "infinity"])
        while True:
            signal.pause()
    os.wait()
    while not file.exists() or len(file.read_text().split()) < 2:
        time.sleep(0.01)


def _attempt(trace_path):
    return int(trace_path.parent.name.removeprefix("attempt-").partition(".")[0])


def _wait(seconds, gate, spec, on_progress, interest, judgements):
    start = time.monotonic()
    while (passed := time.monotonic() - start) < seconds or (gate and not Path(gate).exists()):
        wanted = interest()
        if on_progress is not None and wanted != "nothing":
            seen = (100, 200) if wanted == "everything" else ()
            judged = "nothing" if judgements is None else judgements.scope()
            margin = None if judged == "nothing" else 0.25
            on_progress(
                Snapshot(
                    passed, spec.limit, Pose2(passed), None, 0, 1, (), returns=seen, margin=margin
                )
            )
            if judgements is not None and judged == "everything":
                # Of more bytes than fit into a pipe.
                lines = tuple(LogLine(passed, "sut", f"{i * 7919:x}") for i in range(2000))
                judgements.tell(LiveJudgement("", passed, (), (), (), (), lines))
        time.sleep(0.01 if gate else min(0.01, seconds))
