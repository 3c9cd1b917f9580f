"""The process that executes cases for :mod:`tests.benchmarks.against`, in one of two checkouts.

It is started by its path with another checkout on ``PYTHONPATH``, so it uses nothing that is not in
both: no module of this folder but those that have been there for long. Reads names of cases from
its input, one a line, each perhaps with another limit of simulated seconds, and answers with a line
of JSON: CPU seconds, simulated seconds and the digest of the trace.
"""

import hashlib
import json
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

CAMPAIGNS = {
    "s1": ("ortega2024", "S1", "a2s"),
    "s3.1-omni": ("ortega2024", "S3.1", "fro-omni"),
    "rude-house": ("demo", "rude-house", None),
}
"""Campaign, scenario and system under test of the cases that come from a campaign."""
REFERENCE = "s1"
"""The case by which the speed of a machine is told."""
CORRIDORS = ("rest", "moving", "s2")
"""The cases of ``bench_run``, in its order."""


def load(name):
    """Return the specification and the scene of a case."""
    if name in CORRIDORS:
        from tests.benchmarks.bench_run import cases

        _, spec, scene = cases()[CORRIDORS.index(name)]
        return spec, scene
    campaign, scenario, sut = CAMPAIGNS[name]
    return run_of(Path("campaigns", campaign, "campaign.yaml").resolve(), scenario, sut)


def run_of(file, scenario, sut=None):
    """Return the first run of a scenario in a campaign's file, and its scene."""
    from daemon.campaign import expand, load_campaign

    submission = expand(load_campaign(file))
    spec = next(
        run for run in submission.specs if run.scenario == scenario and sut in (None, run.sut.name)
    )
    return spec, next(scene for scene in submission.scenes if scene.digest == spec.scene)


def cpu_of_case(name):
    """Return CPU and simulated seconds of a case in a process that has everything loaded."""
    from daemon.run import execute
    from tests.kernels import load_all

    load_all()
    spec, scene = load(name)
    with tempfile.TemporaryDirectory(prefix="bench-case-") as folder:
        start = time.process_time()
        result = execute(spec, scene, trace_path=Path(folder) / "trace.mcap")
        return time.process_time() - start, result.timing.simulated


def main(folder):
    import daemon
    from daemon.run import execute
    from tests.kernels import load_all

    load_all()
    print(json.dumps(str(Path(daemon.__file__).parents[1])), flush=True)
    loaded = {}
    for line in sys.stdin:
        name, _, limit = line.strip().partition(" ")
        if name not in loaded:
            loaded[name] = load(name)
        spec, scene = loaded[name]
        if limit:
            spec = replace(spec, limit=float(limit))
        path = folder / "trace.mcap"
        start = time.process_time()
        result = execute(spec, scene, trace_path=path)
        used = time.process_time() - start
        digest = hashlib.sha256(path.read_bytes()).hexdigest()
        print(json.dumps([used, result.timing.simulated, digest]), flush=True)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory(prefix="bench-case-") as name:
        main(Path(name))
