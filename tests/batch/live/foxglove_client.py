"""A client of the Foxglove WebSocket protocol, written from its description, for tests.

Source: the protocol's specification, github.com/foxglove/ws-protocol (docs/spec.md); messages of
the server start with 1 for data and 2 for its time, those of a client with 1 for data and 2 for
service calls.
"""

import json
import struct
from contextlib import contextmanager

from websockets.sync.client import connect
from websockets.typing import Subprotocol

from daemon.model import ros_messages as ros
from tests.batch.live.worlds import DEADLINE

SUBPROTOCOL = Subprotocol("foxglove.sdk.v1")


@contextmanager
def foxglove_client(port):
    url = f"ws://127.0.0.1:{port}"
    with connect(url, subprotocols=[SUBPROTOCOL], open_timeout=DEADLINE, max_size=None) as socket:
        yield FoxgloveClient(socket)


class FoxgloveClient:
    def __init__(self, socket):
        self.socket = socket
        self.channels = {}
        self.messages = []
        self.said = []
        self.time = -1
        self._topics = {}
        self.info = self.until(lambda: self.of("serverInfo"))[-1]
        self.until(lambda: self.channels)

    def of(self, op):
        return [one for one in self.said if one["op"] == op]

    def heard(self, topic):
        return [message for name, _, message in self.messages if name == topic]

    def until(self, condition):
        """Receive until ``condition`` holds; the socket's time-out ends a wait for nothing."""
        while not (found := condition()):
            self._take(self.socket.recv(timeout=DEADLINE))
        return found

    def _take(self, data):
        if isinstance(data, str):
            said = json.loads(data)
            self.said.append(said)
            if said["op"] == "advertise":
                self.channels |= {one["topic"]: one for one in said["channels"]}
        elif data[0] == 1:
            subscription, now = struct.unpack_from("<IQ", data, 1)
            topic = self._topics[subscription]
            kind = self.channels[topic]["schemaName"]
            self.messages.append((topic, now, ros.deserialize(data[13:], kind)))
        elif data[0] == 2:
            (self.time,) = struct.unpack_from("<Q", data, 1)

    def send(self, **said):
        self.socket.send(json.dumps(said))

    def subscribe(self, *topics):
        first = len(self._topics)
        self._topics |= {first + i: topic for i, topic in enumerate(topics)}
        wanted = [
            {"id": first + i, "channelId": self.channels[topic]["id"]}
            for i, topic in enumerate(topics)
        ]
        self.send(op="subscribe", subscriptions=wanted)

    def advertise(self, number, topic, encoding, kind):
        channel = {"id": number, "topic": topic, "encoding": encoding, "schemaName": kind}
        self.send(op="advertise", channels=[channel])

    def publish(self, number, data):
        self.socket.send(struct.pack("<BI", 1, number) + data)

    def call(self, service, call, payload):
        head = struct.pack("<BIII", 2, service, call, len(b"json"))
        self.socket.send(head + b"json" + payload)
