"""A process that pretends to be a stack under rmw_zenoh_cpp: one node, made of the wire functions.

It finds its router as a stack does, by ``ZENOH_CONFIG_OVERRIDE``, answers every clock with a
command and ends when its standard input does.
"""

from __future__ import annotations

import json
import os
import signal
import struct
import subprocess
import sys
import time
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from threading import Lock

import numpy as np
import zenoh

from daemon.stacks.ros2.rmw_zenoh.interfaces import Interfaces
from daemon.stacks.ros2.rmw_zenoh.node import RosNode
from daemon.stacks.ros2.rmw_zenoh.wire import QosProfile, attachment, read_attachment

ACTION = "/navigate_to_pose"
LIFECYCLE_NODE = "/bt_navigator"


@dataclass(frozen=True)
class Options:
    """What the stack is like; ``ticks`` of the clock pass from a goal to its result.

    ``forever``: until a signal ends it. ``state``: of its lifecycle node at first. A goal beyond
    x = 100 m is rejected, one beyond 50 m aborted; the others succeed.
    """

    distribution: str = "jazzy"
    command: str = "geometry_msgs/msg/TwistStamped"
    action: str = "nav2_msgs/action/NavigateToPose"
    ticks: int = 5
    scan: str = "sensor_msgs/msg/LaserScan"
    answers: bool = True
    forever: bool = False
    state: str = "unconfigured"


@contextmanager
def running(environment, options=None):
    """Run a stack in a process of its own."""
    root = Path(__file__).parents[4]
    process = subprocess.Popen(
        [sys.executable, "-m", __name__, json.dumps(asdict(options or Options()))],
        stdin=subprocess.PIPE,
        cwd=root,
        env={**os.environ, **environment},
    )
    try:
        yield process
    finally:
        assert process.stdin is not None
        process.stdin.close()
        process.wait(60)


class PretendedStack:
    def __init__(self, options, environment):
        self.options = options
        self.interfaces = Interfaces(options.distribution)
        session = zenoh.open(config(environment["ZENOH_CONFIG_OVERRIDE"]))
        domain = int(environment["ROS_DOMAIN_ID"])
        self.node = RosNode(session, domain, LIFECYCLE_NODE, self.interfaces)
        self.lock = Lock()
        self.state = options.state
        self.maps = 0
        self.scans = 0
        self.goals = {}
        self.held = []
        load = self.interfaces.load
        for kind in (options.command, options.action, options.scan, "nav_msgs/msg/OccupancyGrid"):
            load(kind)
        for kind in ("rosgraph_msgs/msg/Clock", "nav_msgs/msg/Path", "rcl_interfaces/msg/Log"):
            load(kind)
        self.plan = self.node.publisher("/plan", "nav_msgs/msg/Path", QosProfile())
        self.log = self.node.publisher("/rosout", "rcl_interfaces/msg/Log", QosProfile())
        self.feedback = self.node.publisher(
            f"{ACTION}/_action/feedback", f"{options.action}_FeedbackMessage", QosProfile()
        )
        self.command = self.node.publisher("/cmd_vel", options.command, QosProfile())
        self.serve("get_state", "lifecycle_msgs/srv/GetState", self.get_state)
        self.serve("change_state", "lifecycle_msgs/srv/ChangeState", self.change_state)
        self.serve("get_parameters", "rcl_interfaces/srv/GetParameters", self.get_parameters)
        self.serve_action()
        latched = QosProfile(transient_local=True, depth=1)
        self.node.subscribe("/map", "nav_msgs/msg/OccupancyGrid", latched, self.hear_map)
        self.node.subscribe("/scan", options.scan, QosProfile(reliable=False), self.hear_scan)
        self.node.subscribe("/clock", "rosgraph_msgs/msg/Clock", QosProfile(), self.hear_clock)

    def serve(self, service, kind, answer):
        self.interfaces.load(kind)
        self.offer(f"{LIFECYCLE_NODE}/{service}", kind, answer)

    def offer(self, name, kind, answer):
        key = self.node.key(name, kind)

        def take(query):
            assert query.payload is not None
            request = self.interfaces.deserialize(query.payload.to_bytes(), f"{kind}_Request")
            fields = answer((request, query))
            if fields is not None:
                self.reply(query, key, kind, fields)

        self.held.append(self.node.session.declare_queryable(key, take, complete=True))
        self.node.announce("server", name, kind, QosProfile())

    def reply(self, query, key, kind, fields):
        assert query.attachment is not None
        sequence, _, sender = read_attachment(query.attachment.to_bytes())
        assert sequence > 0
        query.reply(
            key,
            self.interfaces.serialize(f"{kind}_Response", **fields),
            attachment=attachment(sequence, time.time_ns(), sender),
        )
        query.drop()

    def get_state(self, asked):
        make = self.interfaces.make
        return {"current_state": make("lifecycle_msgs/msg/State", id=3, label=self.state)}

    def change_state(self, asked):
        known = {1: "inactive", 2: "unconfigured", 3: "active", 4: "inactive"}
        self.state = known[asked[0].transition.id]
        return {"success": True}

    def get_parameters(self, asked):
        make = self.interfaces.make
        kind = "rcl_interfaces/msg/ParameterValue"
        known = {
            "controller_frequency": make(kind, type=3, double_value=20.0),
            "plugins": make(kind, type=9, string_array_value=["a", "b"]),
            "maps": make(kind, type=2, integer_value=self.maps),
            "scans": make(kind, type=2, integer_value=self.scans),
        }
        names = asked[0].names
        # As rclcpp does: where one is not declared, nothing is answered.
        values = [known[name] for name in names] if set(names) <= set(known) else []
        return {"values": values}

    def serve_action(self):
        kind = self.options.action
        self.interfaces.load("action_msgs/srv/CancelGoal")
        self.offer(f"{ACTION}/_action/send_goal", f"{kind}_SendGoal", self.take_goal)
        self.offer(f"{ACTION}/_action/get_result", f"{kind}_GetResult", self.take_result)
        cancel = "action_msgs/srv/CancelGoal"
        self.offer(f"{ACTION}/_action/cancel_goal", cancel, self.take_cancel)

    def take_goal(self, asked):
        request, _ = asked
        goal = request.goal
        poses = getattr(goal, "poses", None)
        if poses is None:
            poses = [goal.pose]
        poses = getattr(poses, "goals", poses)
        x = poses[-1].pose.position.x
        if x > 100.0:
            return {"accepted": False}
        identifier = bytes(request.goal_id.uuid)
        status = 6 if x > 50.0 else 4
        with self.lock:
            self.goals[identifier] = {"left": self.options.ticks, "status": status, "asked": []}
        return {"accepted": True}

    def take_result(self, asked):
        request, query = asked
        with self.lock:
            self.goals[bytes(request.goal_id.uuid)]["asked"].append(query)

    def take_cancel(self, asked):
        with self.lock:
            goal = self.goals.get(bytes(asked[0].goal_info.goal_id.uuid))
            if goal is not None:
                goal["status"], goal["left"] = 5, 0
        return {"return_code": 0}

    def hear_map(self, data):
        self.maps += 1

    def hear_scan(self, data):
        self.scans += 1

    def hear_clock(self, data):
        seconds, rest = struct.unpack_from("<iI", data, 4)
        make = self.interfaces.make
        vector = make("geometry_msgs/msg/Vector3", x=0.25)
        twist = make("geometry_msgs/msg/Twist", linear=vector)
        stamp = make("builtin_interfaces/msg/Time", sec=seconds, nanosec=rest)
        header = make("std_msgs/msg/Header", stamp=stamp, frame_id="base_link")
        if self.options.command.endswith("Stamped"):
            fields = {"header": header, "twist": twist}
        else:
            fields = {"linear": vector}
        self.work_goals()
        self.log.publish(self.interfaces.serialize("rcl_interfaces/msg/Log", msg=f"at {seconds}"))
        self.plan.publish(self.interfaces.serialize("nav_msgs/msg/Path", header=header))
        if self.options.answers:
            self.command.publish(self.interfaces.serialize(self.options.command, **fields))

    def work_goals(self):
        kind = f"{self.options.action}_GetResult"
        with self.lock:
            goals = dict(self.goals)
        for identifier, goal in goals.items():
            if goal["left"] > 0:
                goal["left"] -= 1
                self.give_feedback(identifier, goal["left"])
                continue
            while goal["asked"]:
                query = goal["asked"].pop()
                result = self.result(goal["status"])
                key = self.node.key(f"{ACTION}/_action/get_result", kind)
                self.reply(query, key, kind, {"status": goal["status"], "result": result})

    def give_feedback(self, identifier, left):
        kind = self.options.action
        feedback = self.interfaces.make(
            f"{kind}_Feedback",
            distance_remaining=float(left),
            number_of_poses_remaining=left,
            current_waypoint=left,
        )
        goal_id = self.interfaces.make(
            "unique_identifier_msgs/msg/UUID", uuid=np.frombuffer(identifier, np.uint8)
        )
        self.feedback.publish(
            self.interfaces.serialize(f"{kind}_FeedbackMessage", goal_id=goal_id, feedback=feedback)
        )

    def result(self, status):
        make = self.interfaces.make
        kind = f"{self.options.action}_Result"
        missed = np.array([1, 3], np.int32)
        listed = self.interfaces.field_types(kind).get("missed_waypoints", "")
        if listed.endswith("/MissedWaypoint"):
            missed = [make(listed, index=number) for number in (1, 3)]
        elif listed:
            missed = [make(listed, waypoint_index=number) for number in (1, 3)]
        code = 0 if status == 4 else 9001
        return make(kind, error_code=code, error_msg="no way", missed_waypoints=missed)


def config(override):
    """Read the text as rmw_zenoh_cpp does, on top of what its sessions are by default."""
    made = zenoh.Config()
    for key, value in {"mode": "peer", "scouting/multicast/enabled": False}.items():
        made.insert_json5(key, json.dumps(value))
    made.insert_json5("timestamping/enabled", "true")
    for part in override.split(";"):
        key, _, value = part.partition("=")
        made.insert_json5(key, value)
    return made


def main():
    options = Options(**json.loads(sys.argv[1]))
    stack = PretendedStack(options, os.environ)
    if options.forever:
        signal.pause()
    sys.stdin.read()
    stack.node.session.close()


if __name__ == "__main__":
    main()
