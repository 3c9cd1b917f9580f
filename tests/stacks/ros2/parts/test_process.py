"""Stacks are started, watched and ended: real processes, no ROS needed for that."""

import json
import secrets
import signal
import sys
from pathlib import Path

import psutil
import pytest

from daemon.model.sut import SutFailure
from daemon.stacks.ros2.causes import DIED
from daemon.stacks.ros2.isolation import DomainTaken
from tests.parts import alive, eventually
from tests.stacks.ros2.holder import holder, marked, supervisor_of
from tests.stacks.ros2.parts.started import (
    PYTHON,
    is_free,
    nothing_left,
    own_seconds,
    printed,
    program,
    relay_file,
    setup_file,
    sleepers,
)

MIB = 2**20
# What leaves its parent and its session; the seconds are its own.
LEAVES = "(setsid sleep {} &); echo up; "
BEHIND = "setsid sleep {} >/dev/null 2>&1 &\n"
"""Started by a setup file, and left behind."""


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


@pytest.mark.parametrize(
    ("last", "said"),
    [("sleep {}", ""), ("true", "the launch command ended with exit code 0")],
    ids=["it goes on", "it has ended"],
)
def test_whatever_a_stack_has_started_is_ended(start, tmp_path, last, said):
    """What ignores signals, what has left its session, with our variables or without them."""
    seconds = own_seconds()
    launch = f"{LEAVES}(setsid env -i sleep {{}} &); trap '' INT TERM HUP; {last}"
    environment = setup_file(tmp_path, BEHIND.replace("{}", seconds))
    stack = start(launch.replace("{}", seconds), environment=environment, grace=0.0)
    printed(stack, "up")
    eventually(lambda: len(sleepers(seconds)) == 3 + ("sleep" in last))
    if said:
        assert said in eventually(stack.ended)
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


# The end of those who hold it


def test_nothing_is_left_when_the_holder_is_killed(tmp_path):
    launch, relay = LEAVES.format(own_seconds()) + "sleep 600", str(relay_file(tmp_path))
    with holder(launch=launch, relay=relay, python=PYTHON) as (process, told):
        folder = Path(told["folder"])
        eventually(lambda: len(marked(folder.name)) >= 3)
        process.send_signal(signal.SIGKILL)
        eventually(lambda: not folder.exists())
        assert marked(folder.name) == []
    eventually(lambda: is_free(told["domain"]))


def test_nothing_is_left_when_the_supervisor_is_killed(start, tmp_path):
    seconds = own_seconds()
    environment = setup_file(tmp_path, BEHIND.format(seconds))
    stack = start(LEAVES.format(seconds) + "sleep 600", environment=environment)
    printed(stack, "up")
    eventually(lambda: len(sleepers(seconds)) == 2)
    supervisor_of(stack.folder).kill()
    assert eventually(stack.ended) == "the supervisor of the stack was ended"
    stack.release()
    assert b"up" in stack.outputs()["stack.txt"]
    assert not sleepers(seconds)
    nothing_left(stack)


def test_what_holder_and_supervisor_left_the_next_one_ends(start):
    seconds = own_seconds()
    with holder(launch=LEAVES.format(seconds) + "sleep 600") as (process, told):
        folder = Path(told["folder"])
        # Before it has left its parent it would end together with the supervisor.
        eventually(lambda: sleepers(seconds))
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


def test_stacks_live_side_by_side_each_in_a_domain_of_its_own(start):
    first, second, third = start(begin=False), start(), start()
    assert first.folder.exists()
    assert second.ended() == third.ended() == ""
    assert second.domain != third.domain
    assert second.nonce != third.nonce
    eventually(lambda: marked(second.folder.name))
    # A domain of one's choice is for one run at a time.
    chosen = start(begin=False, environment={"ROS_DOMAIN_ID": second.domain})
    with pytest.raises(DomainTaken, match="in use by another run"):
        chosen.start()
    second.release()
    eventually(lambda: is_free(second.domain))
    chosen.start()
    assert (chosen.domain, chosen.ended()) == (second.domain, "")


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
    killed, living = (start(f"{share} {name} {{domain}}") for name in names)
    for stack in (killed, living):
        printed(stack, "sharing")

    def files(name, stack):
        port = f"port{7400 + 250 * stack.domain + 11}"
        return [p for n in (name, port) for p in Path("/dev/shm").glob(f"fastdds_{n}*")]

    # Once it is killed, any stack of this machine that ends frees them.
    assert len(files(names[0], killed)) == 4
    for process in marked(killed.folder.name):
        process.kill()
    killed.release()
    assert files(names[0], killed) == []
    assert len(files(names[1], living)) == 4
    living.release()
    assert files(names[1], living) == []


# How it ends by itself


@pytest.mark.parametrize(
    ("launch", "words"),
    [
        ("no-such-command --really", "ended with exit code 127 (command not found)"),
        ("exit 125", "ended with exit code 125"),
        ("kill -SEGV $$", "was killed by SIGSEGV"),
        ("sh -c 'kill -ABRT $$'; exit $?", "exit code 134 (SIGABRT in a process it started)"),
    ],
)
def test_the_end_of_the_launch_command_is_told(start, launch, words):
    stack = start(f"echo last words; {launch}")
    told = eventually(stack.ended)
    assert told.startswith("the launch command ")
    assert words in told
    assert stack.lines()[0] == "last words"
    stack.release()
    assert stack.ended() == told
    assert stack.lines()[0] == "last words"


def test_the_end_of_the_relay_is_told(start, tmp_path):
    stack = start(relay=relay_file(tmp_path), python=PYTHON)
    eventually(lambda: stack.outputs().get("relay.txt") == b"here\n")
    (relay,) = (p for p in marked(stack.folder.name) if "relay.py" in " ".join(p.cmdline()))
    relay.kill()
    assert eventually(stack.ended) == 'the relay was killed by SIGKILL: "here"'
    stack.release()
    nothing_left(stack)
    stack = start(relay=relay_file(tmp_path, "import no_such_rclpy\n"), python=PYTHON)
    words = "the relay ended with exit code 1: \"ModuleNotFoundError: No module named 'no_such"
    assert eventually(stack.ended).startswith(words)


# What keeps it from being started


@pytest.mark.parametrize(
    ("keys", "setup", "words"),
    [
        ({"environment": {"setup": "/there/is/none.bash"}}, "",
         r"there is no setup file /there/is/none.bash\Z"),
        ({}, "echo trouble; exit 3\n", r"setup.bash ended its shell, exit code 3\Z"),
        ({"python": "python9"}, "",
         "the relay cannot be started: its PATH has no program python9"),
        ({"launch": "echo {speed}"}, "", 'no placeholder "speed"'),
        ({"start-up": "0.1 s"}, "sleep 600\n", "the setup files did not end within 0.1 s"),
    ],
)  # fmt: skip
def test_what_keeps_a_stack_from_starting_is_named(start, tmp_path, keys, setup, words):
    stack = start(begin=False, **{"environment": setup_file(tmp_path, setup)} | keys)
    with pytest.raises(SutFailure, match=words):
        stack.start()
    stack.release()
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
    """The relay is alone in its folder and knows where to connect.

    Files that lie beside it in our package must not be imported in place of the stack's.
    """
    relay = relay_file(tmp_path, "import os, sys; print(sys.path[0], os.listdir(sys.path[0]), "
        "len(os.environ['SCENARIO_NONCE']), os.environ['SCENARIO_SOCKET'], flush=True)\n"
        "sys.stdin.read()\n")  # fmt: skip
    (tmp_path / "rclpy.py").touch()
    text = 'echo "$#" arguments; export FROM_SETUP=yes HOME=/wrong\n'
    chosen = {"ROS_LOG_DIR": "/chosen", "DOMAIN": "no. {domain}"}
    environment = setup_file(tmp_path, text) | chosen
    launch = "env; echo {domain}; sleep 600"
    stack = start(launch, environment=environment, relay=relay, python=PYTHON)
    where = stack.folder / "relay"
    expected = f"{where} ['relay.py'] {len(stack.nonce)} {stack.socket}\n"
    eventually(lambda: expected.encode() in stack.outputs().get("relay.txt", b""))
    printed(stack, f"\n{stack.domain}\n")
    assert stack.nonce.encode() not in stack.outputs()["stack.txt"]
    lines = stack.outputs()["stack.txt"].decode().splitlines()
    assert lines[0] == "0 arguments"
    expected = {
        "FROM_SETUP=yes",
        f"HOME={stack.folder}/home",
        f"TMPDIR={stack.folder}/tmp",
        "ROS_LOG_DIR=/chosen",
        f"DOMAIN=no. {stack.domain}",
        f"ROS_DOMAIN_ID={stack.domain}",
        f"SCENARIO_STACK={stack.folder.name}",
    }
    assert expected <= set(lines)


# Output


def test_a_chatty_stack_is_never_held_up_and_fills_nothing(start, tmp_path):
    text = "import sys, time\nfor i in range(20_000): print(f'line {i:058d}')\n"
    text += "print('\\x1b[31mdone\\x1b[0m', flush=True); time.sleep(600)\n"
    stack = start(program(tmp_path, text))
    eventually(lambda: stack.lines()[-1:] == ["done"])
    assert sum(path.stat().st_size for path in stack.folder.glob("*.output")) <= MIB
    output = stack.outputs()["stack.txt"]
    assert len(output) <= MIB
    lines = output.splitlines()
    assert lines[0] == b"line " + b"0" * 58
    assert lines[-2] == b"line " + b"19999".zfill(58)
    assert sum(b"bytes left out" in line for line in lines) == 1
    assert stack.lines()[-3] == "line " + "19998".zfill(58)


def test_alarms_are_reported_as_they_are_printed(start, tmp_path):
    died = f"[ERROR] [amcl-2]: {DIED} [pid 7, exit code -9]."
    # In pieces, and far more of them than anybody wants to read.
    gate = tmp_path / "gate"
    wait = f"until [ -e {gate} ]; do sleep 0.01; done"
    stack = start(f"printf '%s' '{died[:30]}'; {wait}; echo '{died[30:]}'; echo up; sleep 600")
    printed(stack, died[:30])
    assert stack.alarms() == []
    gate.touch()
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
    eventually(lambda: sleepers(other) and sleepers(node, "planner_server"))
    stack.watch_nodes(["/amcl", "/planner_server"])
    assert stack.dead_process() == ""
    for process in sleepers(other):
        process.kill()
    psutil.wait_procs(sleepers(other))
    assert stack.dead_process() == ""
    for process in sleepers(node, "planner_server"):
        process.kill()
    eventually(lambda: stack.dead_process() == "planner_server")
    stack.release()
    assert (stack.alarms(), stack.dead_process()) == ([], "")
