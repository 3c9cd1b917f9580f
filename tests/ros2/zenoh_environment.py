"""An environment with two other implementations of rmw_zenoh's wire, for processes of their own.

python -m tests.ros2.zenoh_environment      # make it, unless it is there and up to date
"""

import os
import shutil
import subprocess
import sys
import venv
from pathlib import Path

_HERE = Path(__file__).parent
_REQUIREMENTS = _HERE / "requirements-zenoh.txt"
_STAMP = "scenario-zenoh.stamp"


def environment_folder():
    """Where it lives, there or not: beside `.venv`, or below `SCENARIO_ROS2_ENVIRONMENTS`."""
    if shared := os.environ.get("SCENARIO_ROS2_ENVIRONMENTS"):
        return Path(shared).expanduser().absolute() / "zenoh"
    return _HERE.parents[1] / ".venv-ros2-zenoh"


def environment_python():
    """The interpreter when the environment is there and up to date, otherwise None."""
    stamp = environment_folder() / _STAMP
    if not stamp.is_file() or stamp.read_text("utf-8") != _REQUIREMENTS.read_text("utf-8"):
        return None
    return environment_folder() / "bin" / "python"


def main():
    """Make the environment and say where it is."""
    folder = environment_folder()
    if environment_python() is None:
        shutil.rmtree(folder, ignore_errors=True)
        venv.create(folder, with_pip=True)
        pip = [str(folder / "bin" / "python"), "-m", "pip", "install", "--quiet"]
        subprocess.run([*pip, "--requirement", str(_REQUIREMENTS)], check=True)
        (folder / _STAMP).write_text(_REQUIREMENTS.read_text("utf-8"), "utf-8")
    print(environment_python())
    return 0


if __name__ == "__main__":
    sys.exit(main())
