"""Exported worlds beside the checker of Gazebo, where it is installed."""

import os
import shutil
import subprocess

import pytest

from grammars.model.behaviour import Hold
from templates.sdf import write_sdf
from templates.world import BehaviourDraw
from tests.scene.templates.worlds import BEHAVIOURS, job

CHECKER = shutil.which("gz") or shutil.which("ign")


@pytest.mark.skipif(CHECKER is None, reason="no gz or ign to check SDF with (libsdformat)")
@pytest.mark.parametrize("ending", ["sdf", "world"])
def test_libsdformat_has_no_complaint(tmp_path, ending):
    draw = BehaviourDraw("", (*BEHAVIOURS, Hold("other.hinge", 0.3)))
    write_sdf(job(tmp_path, "errand", draw))
    world = tmp_path / "gazebo" / "worlds" / f"errand.{ending}"
    done = subprocess.run(
        [CHECKER, "sdf", "--check", str(world)],
        env=os.environ | {"SDF_PATH": str(tmp_path / "gazebo" / "models"), "HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
    )
    output = done.stdout + done.stderr
    assert "Valid." in output, output
    assert "Warning" not in output, output
    assert "Error" not in output, output
    # Elements it does not know are only noted in its log.
    for log in tmp_path.rglob("sdformat.log"):
        assert "not defined in SDF" not in log.read_text()
