"""A stand-in for Nav2 in rclpy: the double that tests of external stacks drive.

    <python of a ROS 2 environment> standin.py map:=/path/map.yaml
    <python of a ROS 2 environment> standin.py fault:=dies node:=planner_server after:=2

On the wire it is Nav2: the lifecycle services, the actions with their genuine types, tf, `/plan`,
`/amcl_pose`, commands as Twist or TwistStamped as the distribution has them. It drives straight to
the goal, whatever is in the way. Options and faults are listed in `standin_nodes/options.py`.
"""

import signal
import sys
import threading
from contextlib import suppress
from pathlib import Path

import rclpy
from rclpy.executors import (
    ExternalShutdownException,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
)
from rclpy.signals import SignalHandlerOptions
from standin_nodes.driving import ControllerServer, Localization, PlannerServer
from standin_nodes.lifecycle import LifecycleManager, StandinNode
from standin_nodes.navigator import Navigator
from standin_nodes.options import (
    MANAGER,
    read_options,
    say_interrupted,
    without_spent_fault,
)


class MapServer(StandinNode):
    """A node of this name; nothing here needs the map."""

    def __init__(self, options):
        super().__init__("map_server", options)

    def on_configure(self, state):
        """Look whether the file of the map is there."""
        if not Path(self.options.map).is_file():
            self.get_logger().fatal(f"Failed to load map yaml file: {self.options.map}")
        return super().on_configure(state)


_CLASSES = {
    "map_server": MapServer,
    "amcl": Localization,
    "controller_server": ControllerServer,
    "planner_server": PlannerServer,
    "bt_navigator": Navigator,
    MANAGER: LifecycleManager,
}


def main(arguments):
    """Run the nodes that are named, all of them by default, until asked to end."""
    options = without_spent_fault(read_options(arguments))
    names = options.nodes.split(",")
    ended = threading.Event()
    signal.signal(signal.SIGINT, lambda *_: ended.set())
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    threads = [
        threading.Thread(target=_spin, args=(_CLASSES[name](options),), daemon=True)
        for name in names
    ]
    for thread in threads:
        thread.start()
    ended.wait()
    say_interrupted()
    rclpy.try_shutdown()
    for thread in threads:
        thread.join(2.0)
    return 0


def _spin(node):
    """Run one node; the planner waits in a transition for what comes meanwhile."""
    kind = MultiThreadedExecutor if isinstance(node, PlannerServer) else SingleThreadedExecutor
    executor = kind()
    executor.add_node(node)
    with suppress(ExternalShutdownException):
        executor.spin()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
