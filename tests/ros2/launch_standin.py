"""Starts the stand-in as `ros2 launch` starts Nav2: prefixed lines, and words about processes.

    <python of a ROS 2 environment> launch_standin.py map:=/path/map.yaml fault:=dies node:=amcl

The node that the options name has a process of its own, the others share one, as in a composed
bring-up. Like its model it goes on when a process dies.
"""

import signal
import subprocess
import sys
import threading
from pathlib import Path

from standin_nodes.options import MANAGER, NODES, read_options, say_interrupted

_STANDIN = Path(__file__).with_name("standin.py")


def main(arguments):
    """Launch the stand-in; ends with the last of its processes."""
    alone = read_options(arguments).node
    others = [name for name in (*NODES, MANAGER) if name != alone]
    threads, processes = [], []
    for label, nodes in ((f"{alone}-1", [alone]), ("component_container-2", others)):
        command = [sys.executable, str(_STANDIN), f"nodes:={','.join(nodes)}", *arguments]
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )
        _say("INFO", label, f"process started with pid [{process.pid}]")
        processes.append(process)
        threads.append(threading.Thread(target=_pass_on, args=(label, process, command)))
        threads[-1].start()

    def interrupt(number, _):
        say_interrupted()
        for process in processes:
            process.send_signal(number)

    signal.signal(signal.SIGINT, interrupt)
    for thread in threads:
        thread.join()


def _pass_on(label, process, command):
    """Print the lines of a process, then how it ended."""
    for line in process.stdout:
        print(f"[{label}] {line}", end="", flush=True)
    code = process.wait()
    if code == 0:
        _say("INFO", label, f"process has finished cleanly [pid {process.pid}]")
    else:
        words = f"pid {process.pid}, exit code {code}, cmd '{' '.join(command)}'"
        _say("ERROR", label, f"process has died [{words}].")


def _say(level, label, text):
    print(f"[{level}] [{label}]: {text}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
