"""The recipes of docs/clusters.md: executed where this machine can, read otherwise."""

import os
import re
import subprocess
import sys
from pathlib import Path

import yaml

from tests.parts import ROOT, daemon_at, end, eventually, family

PAGE = (ROOT / "docs" / "clusters.md").read_text("utf-8")
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
SCENARIO = Path(sys.executable).with_name("scenario")


def block(kind):
    (text,) = (text for found, text in BLOCKS if found == kind)
    return text


def test_the_deployment_starts_a_worker_with_options_there_are(tmp_path):
    spec = yaml.safe_load(block("yaml"))["spec"]
    pod = spec["template"]
    assert pod["metadata"]["labels"] == spec["selector"]["matchLabels"]
    (container,) = pod["spec"]["containers"]
    mounted = {mount["name"] for mount in container["volumeMounts"]}
    assert mounted == {volume["name"] for volume in pod["spec"]["volumes"]}
    scenario, *options = container["args"]
    assert scenario == "scenario"
    command = [SCENARIO, *options, "--print-unit"]
    unit = subprocess.run(command, capture_output=True, text=True, check=True, cwd=tmp_path)
    assert '"--connect" "tls/server:7447"' in unit.stdout


def test_the_job_of_slurm_is_a_worker_that_leaves_when_it_is_told_to(tmp_path):
    with daemon_at(tmp_path / "state") as daemon, daemon.client() as client:
        script = block("bash").replace("tls/server:7447", daemon.endpoint)
        variables = {
            "SLURM_CPUS_PER_TASK": "2",
            "SLURM_JOB_ID": "7",
            "TMPDIR": str(tmp_path),
            "PATH": f"{SCENARIO.parent}{os.pathsep}{os.environ['PATH']}",
        }
        job = subprocess.Popen(["bash", "-c", script], env={**os.environ, **variables})
        try:
            eventually(lambda: [row.slots for row in client.workers()] == [2])
            job.terminate()
            assert job.wait(120.0) == 0
        finally:
            if job.poll() is None:
                end(family(job.pid))
                job.wait()
