"""Stacks are started, watched and ended: real processes, no ROS needed for that."""

import json
import os
import secrets
import signal
import sys
import tempfile
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from daemon.model.sut import SutFailure
from daemon.stacks.ros2.causes import DIED
from daemon.stacks.ros2.isolation import DomainTaken, lock_domain
from daemon.stacks.ros2.process import StackProcess
from daemon.stacks.ros2.settings import Ros2Settings
from daemon.supervision.output_file import OutputFile
from daemon.supervision.plan import STACK_OUTPUT
from tests.parts import alive
from tests.stacks.ros2.holder import (
    QUIET_RELAY,
    eventually,
    holder,
    marked,
    supervisor_of,
)

PYTHON = sys.executable
MIB = 2**20
# Ignores what one can ignore, and says when it does.
STUBBORN = """
import signal, sys, time
for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
    signal.signal(number, signal.SIG_IGN)
print("stubborn", flush=True)
time.sleep(600)
"""
# Leaves a grandchild in a session of its own, whose parent is gone, without our variables.
DAEMONISED = """
import os, subprocess, sys, time
if os.fork() == 0:
    os.setsid()
    if os.fork() == 0:
        if sys.argv[1] == "unmarked":
            os.execve("/bin/sleep", ["sleep", sys.argv[3]], {})
        print("daemonised", flush=True)
        time.sleep(600)
    os._exit(0)
os.wait()
print("launched", flush=True)
if sys.argv[2] == "stays":
    time.sleep(600)
"""


@pytest.fixture(autouse=True)
def temporary(monkeypatch, tmp_path_factory):
    """Folders of stacks that no other test and no daemon sees."""
    tmp_path_factory.getbasetemp()  # chosen now, not once there is another folder for it
    with tempfile.TemporaryDirectory(dir="/tmp") as folder:
        monkeypatch.setattr("tempfile.tempdir", folder)
        monkeypatch.setenv("TMPDIR", folder)
        yield Path(folder)


@pytest.fixture
def start():
    """Start a stack; what is not released is ended after the test."""
    started = []

    def start_stack(launch="sleep 600", *, begin=True, **more):
        own = {name: more.pop(name) for name in ("relay", "grace", "values") if name in more}
        keys = {"launch": launch} if launch else {}
        settings = Ros2Settings.model_validate(keys | {"python": "sh"} | more)
        stack = StackProcess(settings, **{"values": {}, "relay": QUIET_RELAY} | own)
        started.append(stack)
        if begin:
            stack.start()
        return stack

    yield start_stack
    for stack in started:
        stack.release()


def program(folder, text, name="program.py"):
    path = folder / name
    path.write_text(text)
    return f"{PYTHON} {path}"


def printed(stack, text):
    """Wait until the stack has printed something."""
    eventually(lambda: text.encode() in stack.outputs()["stack.txt"])


def nothing_left(stack):
    assert marked(stack.folder.name) == []
    assert not stack.folder.exists()
    eventually(lambda: is_free(stack.domain))


def is_free(domain):
    try:
        lock_domain(domain)[1].close()
    except DomainTaken:
        return False
    return True


def own_seconds():
    """A time to sleep by which a process is known from those of other suites on this machine."""
    return f"601.{secrets.randbelow(10**9):09d}"


def sleepers(seconds):
    return [p for p in psutil.process_iter(["cmdline"]) if p.info["cmdline"] == ["sleep", seconds]]


# The end


def test_a_stack_that_listens_is_ended_by_sigint(start):
    launch = "trap 'echo thank you; exit 0' INT; echo up; while :; do sleep 0.05; done"
    stack = start(launch, grace=600.0)
    printed(stack, "up")
    assert stack.ended() == ""
    stack.release()
    assert b"thank you" in stack.outputs()["stack.txt"]
    nothing_left(stack)
    stack.release()


def test_one_that_ignores_everything_is_killed(start, tmp_path):
    stack = start(program(tmp_path, STUBBORN), grace=0.3)
    printed(stack, "stubborn")
    stack.release()
    nothing_left(stack)


@pytest.mark.parametrize("launcher", ["stays", "ends"])
@pytest.mark.parametrize("variables", ["marked", "unmarked"])
def test_what_has_left_its_parent_and_its_session_is_ended(start, tmp_path, launcher, variables):
    seconds = own_seconds()
    launch = f"{program(tmp_path, DAEMONISED)} {variables} {launcher} {seconds}"
    stack = start(launch, grace=0.3)
    printed(stack, "launched")
    if launcher == "ends":
        eventually(stack.ended)
        assert "the launch command ended with exit code 0" in stack.ended()
    if variables == "marked":
        printed(stack, "daemonised")
    else:
        eventually(lambda: sleepers(seconds))
    stack.release()
    assert not sleepers(seconds)
    nothing_left(stack)


def test_a_stack_that_was_never_started_leaves_nothing(start):
    stack = start(begin=False)
    assert stack.folder.stat().st_mode & 0o777 == 0o700
    assert stack.ended() == ""
    stack.release()
    assert not stack.folder.exists()
    assert stack.outputs() == {"stack.txt": b""}


def test_nothing_is_left_when_the_holder_is_killed(tmp_path):
    launch = f"{program(tmp_path, DAEMONISED)} marked stays"
    with holder(launch=launch, relay=relay_file(tmp_path), python=PYTHON) as (process, told):
        folder = Path(told["folder"])
        eventually(lambda: len(marked(folder.name)) >= 3)
        process.send_signal(signal.SIGKILL)
        eventually(lambda: not folder.exists())
        assert marked(folder.name) == []
    eventually(lambda: is_free(told["domain"]))


def test_nothing_is_left_when_the_supervisor_is_killed(start, tmp_path):
    stack = start(f"{program(tmp_path, DAEMONISED)} marked stays")
    printed(stack, "daemonised")
    supervisor_of(stack.folder).kill()
    eventually(stack.ended)
    assert stack.ended() == "the supervisor of the stack was ended"
    stack.release()
    assert b"daemonised" in stack.outputs()["stack.txt"]
    nothing_left(stack)


def test_what_holder_and_supervisor_left_the_next_one_ends(start, tmp_path):
    launch = f"{program(tmp_path, DAEMONISED)} marked stays"
    with holder(launch=launch) as (process, told):
        folder = Path(told["folder"])
        # Before it has left its parent it would end together with the supervisor.
        eventually(lambda: b"daemonised" in OutputFile.read(folder / STACK_OUTPUT))
        supervisor = supervisor_of(folder)
        process.send_signal(signal.SIGSTOP)
        supervisor.kill()
        process.send_signal(signal.SIGKILL)
        process.wait()
    # It has the folder locked until it is really gone, which takes a moment.
    eventually(lambda: not alive([supervisor]))
    assert marked(folder.name)
    assert folder.exists()
    start().release()
    eventually(lambda: marked(folder.name) == [])
    assert not folder.exists()


def test_stacks_that_live_are_left_alone_by_the_next_one(start):
    first = start(begin=False)
    second = start()
    third = start()
    assert first.folder.exists()
    assert second.ended() == third.ended() == ""
    eventually(lambda: marked(second.folder.name))


# A participant of Fast DDS, as far as its files in shared memory are concerned.
SHARED_MEMORY = """
import fcntl, os, sys, time
kept = []
for number, name in enumerate((sys.argv[1], "port" + str(7400 + 250 * int(sys.argv[2]) + 11))):
    files = [open("/dev/shm/fastdds_" + name + suffix, "w") for suffix in ("", "_el")]
    fcntl.flock(files[-1], fcntl.LOCK_EX)
    for file in files:
        os.utime(file.fileno(), (1, 1))
    kept += files
print("sharing", flush=True)
time.sleep(600)
"""


def test_shared_memory_of_killed_processes_is_freed_that_of_others_is_not(start, tmp_path):
    """Fast DDS frees its segments itself, but not those of processes that were killed."""
    share = program(tmp_path, SHARED_MEMORY)
    names = [secrets.token_hex(8), secrets.token_hex(8)]
    killed, alive = (start(f"{share} {name} {{domain}}") for name in names)
    for stack in (killed, alive):
        printed(stack, "sharing")

    def files(name, stack):
        memory = Path("/dev/shm")
        port = f"fastdds_port{7400 + 250 * stack.domain + 11}"
        return [p.name for n in (f"fastdds_{name}", port) for p in memory.glob(f"{n}*")]

    # Once it is killed, any stack of this machine that ends frees them.
    assert len(files(names[0], killed)) == 4
    for process in marked(killed.folder.name):
        process.kill()
    killed.release()
    assert files(names[0], killed) == []
    assert len(files(names[1], alive)) == 4
    alive.release()
    assert files(names[1], alive) == []


# How it ends by itself


@pytest.mark.parametrize(
    ("launch", "words"),
    [
        ("no-such-command --really", "ended with exit code 127 (command not found)"),
        ("exit 3", "ended with exit code 3"),
        ("kill -SEGV $$", "was killed by SIGSEGV"),
        ("sh -c 'kill -ABRT $$'; exit $?", "exit code 134 (SIGABRT in a process it started)"),
    ],
)
def test_the_end_of_the_launch_command_is_told(start, launch, words):
    stack = start(f"echo last words; {launch}")
    eventually(stack.ended)
    assert stack.ended().startswith("the launch command ")
    assert words in stack.ended()
    assert stack.lines()[0] == "last words"
    told = stack.ended()
    stack.release()
    assert stack.ended() == told
    assert stack.lines()[0] == "last words"


def relay_file(folder, text="import time\nprint('here')\ntime.sleep(600)\n"):
    path = folder / "relay.py"
    path.write_text(text)
    return str(path)


def test_a_killed_relay_is_noticed(start, tmp_path):
    stack = start(relay=Path(relay_file(tmp_path)), python=PYTHON)
    eventually(lambda: stack.outputs().get("relay.txt") == b"here\n")
    (relay,) = (p for p in marked(stack.folder.name) if "relay.py" in " ".join(p.cmdline()))
    relay.kill()
    eventually(stack.ended)
    assert stack.ended() == 'the relay was killed by SIGKILL: "here"'
    stack.release()
    nothing_left(stack)


def test_a_relay_says_why_it_ended(start, tmp_path):
    relay = Path(relay_file(tmp_path, "import no_such_rclpy\n"))
    stack = start(relay=relay, python=PYTHON)
    eventually(stack.ended)
    words = "the relay ended with exit code 1: \"ModuleNotFoundError: No module named 'no_such"
    assert stack.ended().startswith(words)


def test_the_relay_is_alone_in_its_folder_and_knows_where_to_connect(start, tmp_path):
    """Files that lie beside it in our package must not be imported in place of the stack's."""
    text = "import os, sys; print(sys.path[0], os.listdir(sys.path[0]), len(os.environ['SCENARIO_"
    relay = Path(relay_file(tmp_path, text + "NONCE']), os.environ['SCENARIO_SOCKET'])\n"))
    (tmp_path / "rclpy.py").touch()
    stack = start("env; sleep 600", relay=relay, python=PYTHON)
    where = stack.folder / "relay"
    expected = f"{where} ['relay.py'] {len(stack.nonce)} {stack.socket}\n"
    eventually(lambda: stack.outputs().get("relay.txt") == expected.encode())
    printed(stack, "SCENARIO_STACK=")
    assert stack.nonce.encode() not in stack.outputs()["stack.txt"]


# What keeps it from being started


def test_a_setup_file_that_is_missing_or_fails_is_named(start, tmp_path):
    with pytest.raises(SutFailure, match=r"there is no setup file /opt/ros/no/setup.bash\Z"):
        start(environment={"setup": "/opt/ros/no/setup.bash"})
    setup = tmp_path / "setup.bash"
    setup.write_text("echo trouble; exit 3\n")
    with pytest.raises(SutFailure, match=r"setup.bash ended its shell, exit code 3\Z"):
        start(environment={"setup": str(setup)})


def test_a_setup_file_that_never_ends_is_ended(start, tmp_path):
    setup = tmp_path / "setup.bash"
    setup.write_text("sleep 600\n")
    stack = start(begin=False, **{"environment": {"setup": str(setup)}, "start-up": "0.5 s"})
    with pytest.raises(SutFailure, match=r"the setup files did not end within 0.5 s"):
        stack.start()
    stack.release()
    nothing_left(stack)


def test_a_python_that_is_missing_is_named(start, tmp_path):
    words = "there is no program python9 where the relay is to be started"
    with pytest.raises(SutFailure, match=words):
        start(relay=Path(relay_file(tmp_path)), python="python9")


def test_a_placeholder_without_a_value_is_named(start):
    with pytest.raises(SutFailure, match='no placeholder "speed"'):
        start("echo {speed}")


def test_what_a_setup_file_starts_belongs_to_the_stack(start, tmp_path):
    setup = tmp_path / "setup.bash"
    seconds = own_seconds()
    setup.write_text(f"setsid sleep {seconds} >/dev/null 2>&1 &\n")
    stack = start(environment={"setup": str(setup)})
    eventually(lambda: sleepers(seconds))
    assert stack.ended() == ""
    supervisor_of(stack.folder).kill()
    stack.release()
    assert not sleepers(seconds)
    nothing_left(stack)


# What it finds


def test_it_is_started_as_in_a_terminal_though_a_run_is_not(tmp_path):
    """Signals do what they do by default, memory is not bounded, our Python is not in sight."""
    text = (
        "import os, resource, signal, sys; s = signal.getsignal(signal.SIGINT);"
        "print(s is signal.default_int_handler, signal.pthread_sigmask(signal.SIG_BLOCK, ()),"
        "resource.getrlimit(resource.RLIMIT_AS)[0] == resource.getrlimit(resource.RLIMIT_AS)[1],"
        "sorted(n for n in os.environ if n.startswith(('SCENARIO_', 'PYTHONSAFE'))),"
        f"{str(Path(sys.prefix) / 'bin')!r} in os.environ['PATH'].split(':'), flush=True)"
    )
    launch = f"{program(tmp_path, text)}; env python3 -c 'import sys; print(sys.prefix)'"
    with holder(launch=launch, as_run=True) as (process, told):
        output = Path(told["folder"], "stack.output")
        eventually(lambda: output.read_bytes().count(b"\n") == 2)
        process.stdin.write("end\n")
        process.stdin.flush()
        (said,) = json.loads(process.stdout.readline())
    first, prefix = said.splitlines()
    assert first == "True set() True ['SCENARIO_STACK'] False"
    assert prefix != sys.prefix or sys.prefix == sys.base_prefix


def test_its_environment_is_that_of_setup_files_and_sut_file(start, tmp_path):
    setup = tmp_path / "setup.bash"
    setup.write_text('echo "$#" arguments; export FROM_SETUP=yes HOME=/wrong\n')
    stack = start(
        "env; echo {domain}; sleep 600",
        environment={"setup": str(setup), "ROS_LOG_DIR": "/chosen", "DOMAIN": "no. {domain}"},
    )
    domain = stack.domain
    printed(stack, f"\n{domain}\n")
    lines = stack.outputs()["stack.txt"].decode().splitlines()
    assert lines[0] == "0 arguments"
    expected = {
        "FROM_SETUP=yes",
        f"HOME={stack.folder}/home",
        f"TMPDIR={stack.folder}/tmp",
        "ROS_LOG_DIR=/chosen",
        f"DOMAIN=no. {domain}",
        f"ROS_DOMAIN_ID={domain}",
        f"SCENARIO_STACK={stack.folder.name}",
    }
    assert expected <= set(lines)


def test_two_at_once_have_nothing_in_common(start):
    one, other = start(), start()
    assert one.domain != other.domain
    assert one.folder != other.folder
    assert one.nonce != other.nonce


def test_a_domain_of_ones_choice_is_for_one_run_at_a_time(start):
    first = start()
    second = start(begin=False, environment={"ROS_DOMAIN_ID": first.domain})
    with pytest.raises(DomainTaken, match="in use by another run"):
        second.start()
    first.release()
    eventually(lambda: is_free(first.domain))
    second.start()
    assert second.domain == first.domain
    assert second.ended() == ""


# Output


def test_a_chatty_stack_is_never_held_up_and_fills_nothing(start, tmp_path):
    text = "import sys, time\nfor i in range(60_000): print(f'line {i:058d}')\n"
    text += "print('\\x1b[31mdone\\x1b[0m', flush=True); time.sleep(600)\n"
    stack = start(program(tmp_path, text))
    eventually(lambda: stack.lines()[-1:] == ["done"])
    assert sum(path.stat().st_size for path in stack.folder.glob("*.output")) <= MIB
    output = stack.outputs()["stack.txt"]
    assert len(output) <= MIB
    lines = output.splitlines()
    assert lines[0] == b"line " + b"0" * 58
    assert lines[-2] == b"line " + b"59999".zfill(58)
    assert sum(b"bytes left out" in line for line in lines) == 1
    assert stack.lines()[-3] == "line " + "59998".zfill(58)


def test_alarms_are_reported_as_they_are_printed(start, tmp_path):
    died = f"[ERROR] [amcl-2]: {DIED} [pid 7, exit code -9]."
    # In pieces, and far more of them than anybody wants to read.
    launch = f"printf '%s' '{died[:30]}'; sleep 0.2; echo '{died[30:]}'; echo up; sleep 600"
    stack = start(launch)
    eventually(lambda: stack.alarms() == [died])
    chatty = start(f"i=0; while [ $i -lt 500 ]; do echo '{died}'; i=$((i+1)); done; exit 3")
    eventually(chatty.ended)
    assert chatty.alarms() == 100 * [died]
    assert len(chatty.lines()) == 500


def test_the_process_of_a_node_is_watched_and_no_other(start):
    node, other = own_seconds(), own_seconds()
    # The shell has the name among its words, too, and the first process goes on.
    renamed = f"sh -c 'exec sleep {node}' --ros-args -r __node:=amcl"
    stack = start(f"sleep {other} & (exec -a planner_server sleep {node}) & : {renamed}; wait")
    eventually(lambda: sleepers(other) and named("planner_server", node))
    stack.watch_nodes(["/amcl", "/planner_server"])
    assert stack.dead_process() == ""
    for process in sleepers(other):
        process.kill()
    psutil.wait_procs(sleepers(other))
    assert stack.dead_process() == ""
    for process in named("planner_server", node):
        process.kill()
    eventually(lambda: stack.dead_process() == "planner_server")
    stack.release()
    assert (stack.alarms(), stack.dead_process()) == ([], "")


def named(name, seconds):
    return [p for p in psutil.process_iter(["cmdline"]) if p.info["cmdline"] == [name, seconds]]


def test_what_was_printed_is_whole_up_to_the_limit(start):
    stack = start("head -c 1000000 /dev/zero | tr '\\0' x; echo; echo end; sleep 600")
    printed(stack, "end")
    assert stack.outputs()["stack.txt"] == b"x" * 1_000_000 + b"\nend\n"


# Containers: with an engine that is pretended by a script, which honours what it is told


ENGINE = """#!{python}
import json, os, signal, subprocess, sys
here = {folder!r}
with open(here + "/calls", "a") as calls:
    calls.write(json.dumps(sys.argv[1:]) + "\\n")
verb, rest = sys.argv[1], sys.argv[2:]
if verb == "image":
    known = rest[-1] == "my/nav2:1.4"
    print('["sh", "-c", "echo own command; sleep 600"]' if known else "", flush=True)
    sys.exit(0 if known else "Error: no such image")
if verb in ("kill", "rm"):
    try:
        group = int(open(f"{{here}}/{{rest[-1]}}").read())
        os.killpg(group, signal.SIGKILL)
    except (OSError, ValueError):
        sys.exit("no such container")
    sys.exit(0)
assert verb == "run"
options = iter(rest)
environment = {{"PATH": os.environ["PATH"]}}
name = work = ""
for word in options:
    if word in ("--rm", "--init"):
        continue
    if not word.startswith("--"):
        image = word
        break
    value = next(options)
    if word == "--env":
        environment.update([value.split("=", 1)])
    elif word == "--name":
        name = value
    elif word == "--workdir":
        work = value
command = list(options)
inside = subprocess.Popen(command, env=environment, cwd=work, start_new_session=True)
open(f"{{here}}/{{name}}", "w").write(str(inside.pid))
if "ignores" not in image:
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda number, _: os.kill(inside.pid, number))
else:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
sys.exit(inside.wait())
"""


@pytest.fixture
def engine(tmp_path, monkeypatch):
    """Put an engine on the path; returns what it was told."""
    place = tmp_path / "engine"
    place.mkdir()
    for name in ("podman", "docker"):
        (place / name).write_text(ENGINE.format(python=PYTHON, folder=str(place)))
        (place / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{place}:{os.environ['PATH']}")

    def calls():
        with suppress(FileNotFoundError):
            return [json.loads(line) for line in (place / "calls").read_text().splitlines()]
        return []

    return calls


def test_stack_and_relay_live_in_one_container(start, tmp_path, engine):
    setup = tmp_path / "setup.bash"
    setup.write_text("export ROS_DISTRO=humble\n")
    params = tmp_path / "params file.yaml"
    params.touch()
    relay = relay_file(tmp_path, "import os, time\nprint(dict(os.environ))\ntime.sleep(600)\n")
    stack = start(
        "echo stack $ROS_LOCALHOST_ONLY $HOME; trap 'echo bye; exit 0' INT; "
        "while :; do sleep 0.05; done",
        container={"image": "my/nav2:1.4", "options": ["--shm-size", "512m"]},
        environment={"setup": str(setup)},
        files={"params": str(params)},
        relay=Path(relay),
        python=PYTHON,
        grace=600.0,
    )
    printed(stack, f"stack 1 {stack.folder}/home")
    printed(stack, f"'SCENARIO_SOCKET': '{stack.socket}'")
    token = stack.folder.name
    ((verb, *words),) = engine()
    assert verb == "run"
    options = " ".join(words[: words.index("my/nav2:1.4")])
    assert options.startswith(
        f"--rm --init --name scenario-{token} --label scenario={token} --network none "
        f"--volume {stack.folder}:{stack.folder} "
    )
    assert " --user 0:0 " in options
    assert f"--volume {params}:{params}:ro" in options
    assert f" --env SCENARIO_STACK={token} " in options
    assert options.endswith(" --shm-size 512m")
    assert stack.ended() == ""
    stack.release()
    assert b"bye" in stack.outputs()["stack.txt"]
    nothing_left(stack)


def test_a_container_that_does_not_listen_is_killed_by_its_name(start, engine):
    stack = start("echo up; sleep 600", container={"image": "ignores/it"}, grace=0.3)
    printed(stack, "up")
    stack.release()
    name = f"scenario-{stack.folder.name}"
    assert ["kill", name] in engine()
    assert ["rm", "-f", name] in engine()
    nothing_left(stack)


def test_the_container_of_a_killed_supervisor_is_ended(start, engine):
    stack = start("echo up; sleep 600", container={"image": "my/nav2:1.4"})
    printed(stack, "up")
    supervisor_of(stack.folder).kill()
    eventually(stack.ended)
    stack.release()
    assert ["kill", f"scenario-{stack.folder.name}"] in engine()
    nothing_left(stack)


def test_the_end_of_stack_and_relay_in_a_container_is_told(start, tmp_path, engine):
    container = {"image": "my/nav2:1.4"}
    stack = start("echo Error: no space left; exit 125", container=container)
    eventually(stack.ended)
    assert stack.ended() == 'the container cannot be started: "Error: no space left"'
    stack = start("exit 5", container=container)
    eventually(stack.ended)
    assert stack.ended() == "the launch command ended with exit code 5"
    relay = Path(relay_file(tmp_path, "raise SystemExit(4)\n"))
    stack = start(container=container, relay=relay, python=PYTHON)
    eventually(stack.ended)
    assert stack.ended() == "the relay ended with exit code 4"
    assert engine()


def test_a_container_may_start_its_own_command(start, engine):
    stack = start("", container={"image": "my/nav2:1.4", "engine": "docker"})
    printed(stack, "own command")
    with pytest.raises(SutFailure, match="podman knows no image my/typo"):
        start("", container={"image": "my/typo"})
    assert engine()


def test_an_engine_that_is_missing_is_named(start, tmp_path, monkeypatch):
    (tmp_path / "sh").symlink_to("/bin/sh")
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(SutFailure, match="there is no podman on this machine"):
        start(container={"image": "my/nav2:1.4"})
