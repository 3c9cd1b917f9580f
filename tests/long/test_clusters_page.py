"""The job of docs/clusters.md, executed as a shell script."""

import os
import re
import subprocess
import sys
from pathlib import Path

from tests.parts import ROOT, daemon_at, end, eventually, family

PAGE = (ROOT / "docs" / "clusters.md").read_text("utf-8")
(JOB,) = re.findall(r"^```bash\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
SCENARIO = Path(sys.executable).with_name("scenario")


def test_the_job_of_slurm_is_a_worker_that_leaves_when_it_is_told_to(tmp_path):
    with daemon_at(tmp_path / "state") as daemon, daemon.client() as client:
        script = JOB.replace("tls/server:7447", daemon.endpoint)
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
