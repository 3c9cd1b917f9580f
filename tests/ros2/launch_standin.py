"""Starts the stand-in as `ros2 launch` starts Nav2: a process for every node, prefixed lines.

    <python of a ROS 2 environment> launch_standin.py map:=/path/map.yaml fault:=crash

With `one_process:=true` all nodes share a process, as in a composed bring-up. Like its model it
goes on when a node dies, unless `shutdown_on_exit:=true`, and starts it again with `respawn:=true`.
"""

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

from standin_nodes.options import MANAGER, NODES, read_options

_STANDIN = Path(__file__).with_name("standin.py")
_ENDING = 5.0
"""Wall time [s] between SIGINT and SIGTERM, and between SIGTERM and SIGKILL."""


class Launcher:
    """The processes of a launch and what is printed about them."""

    def __init__(self, options, arguments):
        self._options = options
        self._arguments = arguments
        self._processes = {}
        self._lock = threading.Lock()
        self.ending = False
        self.failed = False

    def run(self):
        """Start everything and wait until all processes have ended."""
        groups = [[name] for name in (*NODES, MANAGER)]
        if self._options.one_process:
            groups = [[*NODES, MANAGER]]
        self._say("INFO", "launch", "Default logging verbosity is set to INFO")
        threads = []
        for number, nodes in enumerate(groups, 1):
            label = f"{nodes[0] if len(nodes) == 1 else 'component_container'}-{number}"
            threads.append(threading.Thread(target=self._keep, args=(label, nodes), daemon=True))
            threads[-1].start()
        for thread in threads:
            # In short waits, so that signals are handled meanwhile.
            while thread.is_alive():
                thread.join(0.1)
                if self.failed and self._options.shutdown_on_exit and not self.ending:
                    self.end()
        return int(self.failed and self._options.shutdown_on_exit)

    def end(self):
        """End the processes in steps, as launch does; the waiting is done on a thread."""
        if not self.ending:
            self.ending = True
            threading.Thread(target=self._end_in_steps, daemon=True).start()

    def _end_in_steps(self):
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            with self._lock:
                left = [each for each in self._processes.values() if each.poll() is None]
            for process in left:
                process.send_signal(number)
            limit = time.monotonic() + _ENDING
            while time.monotonic() < limit and any(each.poll() is None for each in left):
                time.sleep(0.05)

    def _keep(self, label, nodes):
        """Run one process, again if it is to be respawned, and pass its lines on."""
        command = [sys.executable, str(_STANDIN), f"nodes:={','.join(nodes)}", *self._arguments]
        while not self.ending:
            process = subprocess.Popen(
                command,
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
                errors="replace",
                start_new_session=self._options.has("orphans"),
            )
            with self._lock:
                self._processes[label] = process
            self._say("INFO", label, f"process started with pid [{process.pid}]")
            assert process.stdout is not None
            for line in process.stdout:
                print(f"[{label}] {line}", end="", flush=True)
            code = process.wait()
            if code == 0:
                self._say("INFO", label, f"process has finished cleanly [pid {process.pid}]")
            else:
                self._say(
                    "ERROR",
                    label,
                    f"process has died [pid {process.pid}, exit code {code},"
                    f" cmd '{' '.join(command)}'].",
                )
            self.failed = self.failed or not self.ending
            if not self._options.respawn:
                return

    def _say(self, level, label, text):
        print(f"[{level}] [{label}]: {text}", flush=True)


def main(arguments):
    """Launch the stand-in; ends with the last of its processes, or when told to."""
    options = read_options(arguments)
    launcher = Launcher(options, arguments)

    def interrupted(number, _):
        if options.has("orphans"):
            os._exit(0)
        name = signal.Signals(number).name
        print(f"[WARNING] [launch]: user interrupted with ctrl-c ({name})", flush=True)
        launcher.end()

    ignored = options.has("ignore-sigint")
    signal.signal(signal.SIGINT, signal.SIG_IGN if ignored else interrupted)
    signal.signal(signal.SIGTERM, interrupted)
    return launcher.run()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
