"""Nodes with the standard lifecycle services, and the manager that activates them in order."""

import signal
import time

import rclpy
from lifecycle_msgs.msg import State, Transition
from lifecycle_msgs.srv import ChangeState, GetState
from nav2_msgs.srv import ManageLifecycleNodes
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from standin_nodes.options import MANAGER, NODES, count_start
from std_srvs.srv import Trigger

_LABELS = {
    State.PRIMARY_STATE_UNCONFIGURED: "unconfigured",
    State.PRIMARY_STATE_INACTIVE: "inactive",
    State.PRIMARY_STATE_ACTIVE: "active",
    State.PRIMARY_STATE_FINALIZED: "finalized",
}
_STEPS = {
    Transition.TRANSITION_CONFIGURE: ("unconfigured", State.PRIMARY_STATE_INACTIVE, "Configuring"),
    Transition.TRANSITION_ACTIVATE: ("inactive", State.PRIMARY_STATE_ACTIVE, "Activating"),
    Transition.TRANSITION_DEACTIVATE: ("active", State.PRIMARY_STATE_INACTIVE, "Deactivating"),
    Transition.TRANSITION_CLEANUP: ("inactive", State.PRIMARY_STATE_UNCONFIGURED, "Cleaning up"),
}
_SETTLING = 0.1
"""What a transition takes of simulated time [s]: nothing comes up while the clock stands still."""


class Poll:
    """What a coroutine of a node awaits before it looks again.

    rclpy resumes a waiting coroutine as often as it can, which takes a whole core; hence the
    sleep. Nothing waits in this way while the robot drives, so that no command is late for it.
    """

    def __await__(self):
        """Give way once."""
        time.sleep(0.001)
        yield


class SimulatedNode(Node):
    """A node on simulated time, with a `wall` clock besides, whose coroutines can wait."""

    def __init__(self, name, options):
        super().__init__(
            name,
            namespace=options.namespace or None,
            parameter_overrides=[Parameter("use_sim_time", value=options.use_sim_time)],
        )
        self.options = options
        self.wall = Clock(clock_type=ClockType.STEADY_TIME)
        if options.has("chatter", name):
            # Twenty times a second five lines of 600 bytes.
            self.create_timer(0.05, self._chatter, clock=self.wall)

    @property
    def now(self):
        """Simulated time [ns]; 0 before the first clock."""
        return self.get_clock().now().nanoseconds

    async def pause(self, seconds):
        """Let others run for some simulated time."""
        end = self.now + round(seconds * 1e9)
        while self.now < end:
            await Poll()

    def _chatter(self):
        for _ in range(5):
            self.get_logger().info("nothing of interest " * 29)


class LifecycleNode(SimulatedNode):
    """Unconfigured, inactive, active; what a node does hangs on `active`."""

    def __init__(self, name, options):
        if options.has("fails-first", name) and count_start(options.count_file) <= options.starts:
            options.end_process()
        super().__init__(name, options)
        self._state = State.PRIMARY_STATE_UNCONFIGURED
        self.create_service(GetState, f"{name}/get_state", self._get_state)
        # A transition takes a while, in which the other callbacks have to go on.
        self.create_service(
            ChangeState,
            f"{name}/change_state",
            self._change_state,
            callback_group=ReentrantCallbackGroup(),
        )

    @property
    def active(self):
        """Whether the node does its work."""
        return self._state == State.PRIMARY_STATE_ACTIVE

    async def on_activate(self):
        """What has to happen before a node is active; False refuses."""
        return True

    def on_deactivate(self):
        """Forget what belongs to the run so far."""

    def _get_state(self, _, answer):
        answer.current_state.id = self._state
        answer.current_state.label = _LABELS[self._state]
        return answer

    async def _change_state(self, request, answer):
        known = _STEPS.get(request.transition.id)
        if known is None or _LABELS[self._state] != known[0]:
            self.get_logger().error(f"No transition {request.transition.id} from here")
            return answer
        _, target, doing = known
        self.get_logger().info(doing)
        name = self.get_name()
        if doing == "Configuring" and self.options.has("crash-at-start", name):
            self.options.end_process()
        if doing == "Activating" and self.options.has("never-ready", name):
            self.get_logger().error("Activation is refused")
            return answer
        await self.pause(_SETTLING)
        if doing == "Activating" and not await self.on_activate():
            self.get_logger().error("Activation failed")
            return answer
        if doing == "Deactivating":
            self.on_deactivate()
        self._state = target
        answer.success = True
        return answer


class LifecycleManager(SimulatedNode):
    """Brings the nodes up as nav2_lifecycle_manager does: localization, then navigation."""

    def __init__(self, options):
        super().__init__(MANAGER, options)
        self._up = False
        self._lifecycle = {
            name: self.create_client(ChangeState, f"{name}/change_state") for name in NODES
        }
        self.create_service(Trigger, f"{MANAGER}/is_active", self._is_active)
        self.create_service(
            ManageLifecycleNodes,
            f"{MANAGER}/manage_nodes",
            self._manage,
            callback_group=ReentrantCallbackGroup(),
        )

    async def start_up(self):
        """Configure and activate all nodes; False as soon as one refuses."""
        first, last = Transition.TRANSITION_CONFIGURE, Transition.TRANSITION_ACTIVATE
        for group in (NODES[:2], NODES[2:]):
            for transition in (first, last):
                for name in group:
                    if not await self._change(name, transition):
                        self.get_logger().error(f"Failed to bring up {name}: bring-up is aborted")
                        return False
        self._up = True
        self.get_logger().info("Managed nodes are active")
        return True

    async def reset(self):
        """Deactivate and clean up all nodes, in the opposite order."""
        self._up = False
        done = True
        for transition in (Transition.TRANSITION_DEACTIVATE, Transition.TRANSITION_CLEANUP):
            for name in reversed(NODES):
                done = await self._change(name, transition) and done
        return done

    async def _change(self, name, transition):
        client = self._lifecycle[name]
        while not client.service_is_ready():
            await Poll()
        request = ChangeState.Request()
        request.transition.id = transition
        answer = client.call_async(request)
        while not answer.done():
            await Poll()
        return answer.result().success

    def _is_active(self, _, answer):
        answer.success = self._up
        return answer

    async def _manage(self, request, answer):
        if request.command == ManageLifecycleNodes.Request.STARTUP:
            answer.success = await self.start_up()
        elif request.command == ManageLifecycleNodes.Request.RESET:
            answer.success = await self.reset()
        return answer


def start_rclpy(options):
    """Initialise rclpy; a stack that is to ignore SIGINT does so from here on."""
    if options.has("ignore-sigint"):
        rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
        signal.signal(signal.SIGINT, signal.SIG_IGN)
    else:
        rclpy.init(args=[])
