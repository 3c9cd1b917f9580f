"""A stand-in for Nav2 in rclpy: the double that tests of external stacks drive.

    <python of a ROS 2 environment> standin.py map:=/path/map.yaml
    <python of a ROS 2 environment> standin.py nodes:=amcl,planner_server speed:=0.3 fault:=late

On the wire it is Nav2: the lifecycle services, the actions with their real types, tf, `/plan`,
`/amcl_pose`, commands as Twist or TwistStamped as the distribution has them. What it does is
simple and repeats: a command depends on contents and stamps of messages alone. The options and
the faults that can be asked for stand in `standin_nodes/options.py`.
"""

import sys

import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from standin_nodes.controller import ControllerServer, PlannerServer
from standin_nodes.lifecycle import LifecycleManager, start_rclpy
from standin_nodes.localization import Localization, MapServer
from standin_nodes.navigator import Navigator
from standin_nodes.options import MANAGER, NODES, read_options

_CLASSES = dict(
    zip(NODES, (MapServer, Localization, ControllerServer, PlannerServer, Navigator), strict=True)
)


def main(arguments):
    """Run the nodes that are named, all of them by default, until told to end."""
    chosen = [word for word in arguments if word.startswith("nodes:=")]
    names = chosen[-1].partition(":=")[2].split(",") if chosen else [*NODES, MANAGER]
    options = read_options([word for word in arguments if word not in chosen])
    start_rclpy(options)
    executor = SingleThreadedExecutor()
    for name in names:
        if name == MANAGER:
            manager = LifecycleManager(options)
            executor.add_node(manager)
            executor.create_task(manager.start_up)
        else:
            executor.add_node(_CLASSES[name](options))
    try:
        executor.spin()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        rclpy.try_shutdown()
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
