"""Nodes of the stand-in, and the manager that activates them in order."""

import threading

from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState
from nav_msgs.msg import Path
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.lifecycle import LifecycleNodeMixin
from rclpy.node import Node
from rclpy.parameter import Parameter
from standin_nodes.options import MANAGER, NODES

SIMULATED = [Parameter("use_sim_time", value=True)]


class StandinNode(LifecycleNodeMixin, Node):
    """A lifecycle node on simulated time that fails as its options say."""

    def __init__(self, name, options):
        Node.__init__(self, name, parameter_overrides=SIMULATED)
        # States are asked for during a transition too.
        LifecycleNodeMixin.__init__(self, callback_group=ReentrantCallbackGroup())
        self.options = options
        self._alarm = None
        if options.has("dies", name):
            self.create_subscription(Path, "plan", self._on_plan, 10)

    @property
    def is_active(self):
        """Whether the node does its work."""
        return self._state_machine.current_state[1] == "active"

    def on_configure(self, state):
        """Configure the node."""
        options, name = self.options, self.get_name()
        self.get_logger().info("Configuring")
        if options.has("dies-at-start", name):
            options.end_process()
        if options.has("late-response", name):
            threading.Event().wait(2 * options.seconds)
        return super().on_configure(state)

    def on_activate(self, state):
        """Activate the node."""
        self.get_logger().info("Activating")
        return super().on_activate(state)

    def _on_plan(self, _):
        if self._alarm is None:
            self._alarm = self.create_timer(self.options.after, self.options.end_process)


class LifecycleManager(Node):
    """Brings the nodes up as nav2_lifecycle_manager does."""

    def __init__(self, options):
        super().__init__(MANAGER, parameter_overrides=SIMULATED)
        # A response that is late on purpose is not waited for.
        self._limit = options.seconds if options.has("late-response") else None
        self._nodes = {
            name: self.create_client(ChangeState, f"{name}/change_state") for name in NODES
        }
        threading.Thread(target=self._start_up, daemon=True).start()

    def _start_up(self):
        for transition in (Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE):
            for name, client in self._nodes.items():
                if not self._change_state(client, transition):
                    self.get_logger().error(f"Failed to change state for node: {name}")
                    self.get_logger().error(
                        "Failed to bring up all requested nodes. Aborting bringup."
                    )
                    return
        self.get_logger().info("Managed nodes are active")

    def _change_state(self, client, transition):
        client.wait_for_service()
        request = ChangeState.Request()
        request.transition.id = transition
        done = threading.Event()
        future = client.call_async(request)
        future.add_done_callback(lambda _: done.set())
        return done.wait(self._limit) and future.result().success
