"""A stack made with zenoh-ros2-sdk, to be run by an interpreter that has it; knows nothing of ours.

    python zenoh_sdk_peer.py '{"port": ..., "definitions": ..., "hashes": {...}}'

Hashes of messages and services are its own, computed from the definition files; those of the pieces
of the action, which it does not know, are given. Ends with its standard input.
"""

import json
import logging
import sys
import threading
from collections import deque

import numpy as np
from zenoh_ros2_sdk import ROS2Publisher, ROS2ServiceServer, ROS2Subscriber
from zenoh_ros2_sdk.message_registry import get_registry
from zenoh_ros2_sdk.qos import QosDurability, QosProfile
from zenoh_ros2_sdk.session import ZenohSession

ASKED = json.loads(sys.argv[1])
NODE = {"router_port": ASKED["port"], "domain_id": ASKED["domain"], "node_name": "sdk"}
TO_POSE = "nav2_msgs/action/NavigateToPose"
ACTION = "/navigate_to_pose/_action"
# Flat, as CDR is: a message in a message has nothing around it.
GOAL = "uint8[16] goal_id\ngeometry_msgs/PoseStamped pose\nstring behavior_tree\n"
RESULT = "int8 status\nuint16 error_code\nstring error_msg\n"
FEEDBACK = (
    "uint8[16] goal_id\ngeometry_msgs/PoseStamped current_pose\n"
    "builtin_interfaces/Duration navigation_time\n"
    "builtin_interfaces/Duration estimated_time_remaining\n"
    "int16 number_of_recoveries\nfloat32 distance_remaining\n"
)
CANCEL = "uint8[16] goal_id\nbuiltin_interfaces/Time stamp\n"
CANCELED = "int8 return_code\nint32[] goals_canceling\n"


class Stack:
    def __init__(self):
        registry = get_registry(ASKED["definitions"])
        self.store = ZenohSession.get_instance("127.0.0.1", ASKED["port"]).store
        for kind in ("geometry_msgs/msg/PoseStamped", "builtin_interfaces/msg/Duration"):
            assert registry.load_message_type(kind)
        self.maps = 0
        self.goal = None
        self.ticks = 0
        self.canceled = False
        self.scans = deque()
        self.command = ROS2Publisher("/cmd_vel", "geometry_msgs/msg/TwistStamped", **NODE)
        self.map_seen = ROS2Publisher("/map_seen", "std_msgs/msg/UInt32", **NODE)
        self.feedback = ROS2Publisher(
            f"{ACTION}/feedback",
            f"{TO_POSE}_FeedbackMessage",
            msg_definition=FEEDBACK,
            type_hash=ASKED["hashes"][f"{TO_POSE}_FeedbackMessage"],
            **NODE,
        )
        self.parameters = ROS2ServiceServer(
            "/sdk/get_parameters", "rcl_interfaces/srv/GetParameters", self.get_parameters, **NODE
        )
        self.states = ROS2ServiceServer(
            "/sdk/change_state", "lifecycle_msgs/srv/ChangeState", self.change_state, **NODE
        )
        self.goals = self.serve("send_goal", f"{TO_POSE}_SendGoal", self.send_goal,
                                GOAL, "bool accepted\nbuiltin_interfaces/Time stamp\n")  # fmt: skip
        self.results = self.serve("get_result", f"{TO_POSE}_GetResult", None,
                                  "uint8[16] goal_id\n", RESULT)  # fmt: skip
        self.cancel = self.serve("cancel_goal", "action_msgs/srv/CancelGoal", self.cancel_goal,
                                 CANCEL, CANCELED)  # fmt: skip
        latched = QosProfile(durability=QosDurability.TRANSIENT_LOCAL, history_depth=1)
        self.heard = [
            ROS2Subscriber(
                "/map", "nav_msgs/msg/OccupancyGrid", self.hear_map, qos=latched, **NODE
            ),
            ROS2Subscriber("/scan", "sensor_msgs/msg/LaserScan", self.hear_scan, **NODE),
            ROS2Subscriber("/clock", "rosgraph_msgs/msg/Clock", self.hear_clock, **NODE),
        ]
        self.asked = threading.Event()
        threading.Thread(target=self.answer_results, daemon=True).start()

    def serve(self, name, kind, callback, request, response):
        return ROS2ServiceServer(
            f"{ACTION}/{name}",
            kind,
            callback,
            request_definition=request,
            response_definition=response,
            type_hash=ASKED["hashes"][kind],
            mode="callback" if callback else "queue",
            **NODE,
        )

    def make(self, kind, **fields):
        return self.store.types[kind](**fields)

    def hear_map(self, message):
        self.maps += 1
        assert (message.info.width, message.info.height) == (400, 300)
        assert len(message.data) == 120000

    def hear_scan(self, message):
        assert len(message.ranges) == 400
        self.scans.append(message.header.stamp.sec)

    def hear_clock(self, message):
        self.map_seen.publish(data=self.maps)
        if self.goal is not None:
            self.ticks += 1
            pose = self.make(
                "geometry_msgs/msg/Pose", position=self.point(), orientation=self.turn()
            )
            stamped = self.make(
                "geometry_msgs/msg/PoseStamped", header=self.header(message), pose=pose
            )
            none = self.make("builtin_interfaces/msg/Duration", sec=0, nanosec=0)
            self.feedback.publish(
                goal_id=self.goal, current_pose=stamped, navigation_time=none,
                estimated_time_remaining=none, number_of_recoveries=2,
                distance_remaining=float(self.ticks),
            )  # fmt: skip
        vector = self.make("geometry_msgs/msg/Vector3", x=0.5, y=0.0, z=0.0)
        twist = self.make("geometry_msgs/msg/Twist", linear=vector, angular=vector)
        self.command.publish(header=self.header(message), twist=twist)

    def header(self, clock):
        return self.make("std_msgs/msg/Header", stamp=clock.clock, frame_id="base_link")

    def point(self):
        return self.make("geometry_msgs/msg/Point", x=0.0, y=0.0, z=0.0)

    def turn(self):
        return self.make("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)

    def get_parameters(self, request):
        value = self.store.types["rcl_interfaces/msg/ParameterValue"]
        blank = {"bool_value": False, "integer_value": 0, "double_value": 0.0, "string_value": ""}
        arrays = {"byte": "uint8", "bool": "bool", "integer": "int64", "double": "float64"}
        empty = {f"{name}_array_value": np.zeros(0, kind) for name, kind in arrays.items()}
        empty["string_array_value"] = []
        values = [
            value(**(blank | empty | {"type": 4, "string_value": f"{name} of the sdk"}))
            for name in request.names
        ]
        return self.answer("rcl_interfaces/srv/GetParameters_Response", values=values)

    def change_state(self, request):
        assert (request.transition.id, request.transition.label) == (3, "activate")
        return self.answer("lifecycle_msgs/srv/ChangeState_Response", success=True)

    def answer(self, kind, **fields):
        known = ZenohSession.get_instance()._registered_types
        return self.store.types[known[kind]](**fields)

    def send_goal(self, request):
        taken = request.pose.pose.position.x == 1.0 and request.pose.header.frame_id == "map"
        self.goal = request.goal_id if taken else None
        now = self.make("builtin_interfaces/msg/Time", sec=0, nanosec=0)
        # It keeps the parts of every service below srv.
        kind = f"{TO_POSE}_SendGoal_Response".replace("action/", "srv/")
        return self.answer(kind, accepted=taken, stamp=now)

    def cancel_goal(self, request):
        self.canceled = bytes(request.goal_id) == bytes(self.goal)
        kind = "action_msgs/srv/CancelGoal_Response"
        return self.answer(kind, return_code=0, goals_canceling=np.zeros(0, "int32"))

    def answer_results(self):
        while True:
            key, request = self.results.take_request()
            while self.ticks < 5 and not self.canceled:
                self.asked.wait(0.01)
            assert bytes(request.goal_id) == bytes(self.goal)
            status = 5 if self.canceled else 4
            self.goal, self.ticks, self.canceled = None, 0, False
            kind = f"{TO_POSE}_GetResult_Response".replace("action/", "srv/")
            self.results.send_response(
                key, self.answer(kind, status=status, error_code=3, error_msg="from the sdk")
            )


if __name__ == "__main__":
    logging.basicConfig(level=logging.ERROR)
    stack = Stack()
    sys.stdin.read()
