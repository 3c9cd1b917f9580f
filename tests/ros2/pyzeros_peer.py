"""A stack made with pyzeros, to be run by an interpreter that has it; knows nothing of ours.

    python pyzeros_peer.py '{"port": ..., "domain": ..., "hashes": [...]}'

Types, hashes and tokens are its own. It first says, as one line of JSON, the hashes of the types it
is asked for, and key, token and gid of its publisher. Ends with its standard input.
"""

import asyncio
import json
import sys

import pyzeros
import zenoh
from pyzeros.qos import QosProfile
from pyzeros.utils import rmw_zenoh_gid
from ros2_pyterfaces import core
from ros2_pyterfaces.core import all_msgs, all_srvs
from ros2_pyterfaces.core.lifecycle_msgs import srv as lifecycle
from ros2_pyterfaces.cydr.geometry_msgs.msg import Twist, TwistStamped, Vector3
from ros2_pyterfaces.cydr.lifecycle_msgs.msg import State
from ros2_pyterfaces.cydr.lifecycle_msgs.srv import GetState_Request, GetState_Response
from ros2_pyterfaces.cydr.rosgraph_msgs.msg import Clock
from ros2_pyterfaces.cydr.sensor_msgs.msg import LaserScan
from ros2_pyterfaces.cydr.std_msgs.msg import Header

ASKED = json.loads(sys.argv[1])


class GetState:
    """The service as pyzeros wants one: its messages cannot be had as a whole with cydr."""

    Request = GetState_Request
    Response = GetState_Response

    @staticmethod
    def get_type_name():
        return "lifecycle_msgs/srv/GetState"

    @staticmethod
    def hash_rihs01():
        return core.hash_rihs01(lifecycle.GetState)


def known_hashes():
    hashes = {}
    for module in (all_msgs, all_srvs):
        for schema in vars(module).values():
            if isinstance(schema, dict) and "__typename" in schema:
                hashes[schema["__typename"]] = core.hash_rihs01(schema)
    return {kind: hashes[kind] for kind in ASKED["hashes"] if kind in hashes}


def session():
    config = zenoh.Config()
    config.insert_json5("mode", '"peer"')
    config.insert_json5("connect/endpoints", json.dumps([f"tcp/127.0.0.1:{ASKED['port']}"]))
    config.insert_json5("listen/endpoints", '["tcp/127.0.0.1:0"]')
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("timestamping/enabled", "true")
    return zenoh.open(config)


async def follow_clock(clock, command):
    async for message in clock.listen_reliable(queue_size=1000):
        header = Header(stamp=message.clock, frame_id=b"base_link")
        command.publish(TwistStamped(header=header, twist=Twist(linear=Vector3(x=0.5))))


async def hear_scans(scans, seen):
    async for message in scans.listen_reliable(queue_size=1000):
        assert len(message.ranges) == 400
        seen.publish(message)


async def tell_state(server):
    async for asked in server.listen_reliable(queue_size=1000):
        asked.response.current_state = State(id=3, label=b"active")
        asked.send()


async def main():
    command = pyzeros.Pub(TwistStamped, "cmd_vel")
    seen = pyzeros.Pub(LaserScan, "scan_seen", QosProfile.sensor_data())
    print(
        json.dumps(
            {
                "hashes": known_hashes(),
                "key": command.publisher_keyexpr,
                "token": command.token_keyexpr,
                "gid": rmw_zenoh_gid(command.token_keyexpr).hex(),
                "far": pyzeros.pub.token_keyexpr(
                    "scan",
                    seen.dds_type,
                    seen.hash,
                    QosProfile.sensor_data(),
                    "amcl",
                    domain_id=3,
                    namespace="/robot1",
                    _node_id=4,
                    _zenoh_id="ab12",
                    _entity_id=7,
                ),
            }
        ),
        flush=True,
    )
    tasks = [
        follow_clock(pyzeros.Sub(Clock, "clock"), command),
        hear_scans(pyzeros.Sub(LaserScan, "scan", QosProfile.sensor_data()), seen),
        tell_state(pyzeros.Server(GetState, "bt_navigator/get_state")),
        asyncio.to_thread(sys.stdin.read),
    ]
    _, pending = await asyncio.wait(
        [asyncio.ensure_future(task) for task in tasks], return_when=asyncio.FIRST_COMPLETED
    )
    for task in pending:
        task.cancel()


if __name__ == "__main__":
    with (
        session() as opened,
        pyzeros.auto_context("bt_navigator", opened, domain_id=ASKED["domain"]),
    ):
        asyncio.run(main())
