"""What ``rmw_zenoh`` writes on the wire: keys, liveliness tokens, attachments. Nothing has a life.

Source: ``docs/design.md`` of ros2/rmw_zenoh and its liveliness, attachment and QoS code. A topic or
service is a key of Zenoh, ``<domain>/<name>/<type>/<type hash>``; every node and endpoint stands in
the graph by a liveliness token that says all about it. Names are absolute (``/robot1/scan``), types
are ``package/msg/Name``, ``package/srv/Name`` or ``package/action/Name_SendGoal``.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final, Literal, TypeAlias

Role: TypeAlias = Literal["node", "publisher", "subscription", "server", "client"]

GRAPH: Final = "@ros2_lv"
"""First chunk of every token; ``**`` of others does not match it."""

GID_SIZE: Final = 16

_ROLES: Final[dict[Role, str]] = {
    "node": "NN",
    "publisher": "MP",
    "subscription": "MS",
    "server": "SS",
    "client": "SC",
}
_ROLES_READ: Final = {text: role for role, text in _ROLES.items()}

_DEFAULT_DEPTH: Final = 42
_ATTACHMENT: Final = struct.Struct("<qqB")


@dataclass(frozen=True, slots=True)
class QosProfile:
    """Quality of service as far as tokens say it and this side asks for; the rest is default."""

    reliable: bool = True
    transient_local: bool = False
    depth: int = 10
    keep_all: bool = False


@dataclass(frozen=True, slots=True)
class Token:
    """A node or one of its endpoints: what a liveliness token says.

    ``session`` is the id of its Zenoh session, ``node_id`` and ``entity_id`` are counted by it.
    ``node`` is the absolute name. ``name``, ``kind``, ``hash`` and ``qos`` are an endpoint's.
    """

    domain: int
    session: str
    node_id: int
    entity_id: int
    role: Role
    node: str
    name: str = ""
    kind: str = ""
    hash: str = ""
    qos: QosProfile = QosProfile()


def topic_key(domain: int, name: str, kind: str, type_hash: str) -> str:
    """Return the key a topic or service lives at."""
    return f"{domain}/{name.strip('/')}/{dds_name(kind)}/{type_hash}"


def dds_name(kind: str) -> str:
    """Return the type as keys have it: ``sensor_msgs::msg::dds_::LaserScan_``."""
    package, room, name = kind.split("/")
    return f"{package}::{room}::dds_::{name}_"


def kind_of(dds: str) -> str:
    """Return the type a key names, ``sensor_msgs/msg/LaserScan``; as it is when it names none."""
    parts = dds.split("::")
    if len(parts) != 4 or parts[2] != "dds_":
        return dds
    return f"{parts[0]}/{parts[1]}/{parts[3].removesuffix('_')}"


def token_key(token: Token) -> str:
    """Return the key a token is declared at."""
    namespace, _, node = token.node.rpartition("/")
    chunks = [
        GRAPH,
        str(token.domain),
        token.session,
        str(token.node_id),
        str(token.entity_id),
        _ROLES[token.role],
        "%",  # the enclave of its security, none
        _mangled(namespace or "/"),
        node,
    ]
    if token.role != "node":
        chunks += [_mangled(token.name), dds_name(token.kind), token.hash, qos_text(token.qos)]
    return "/".join(chunks)


def read_token(key: str) -> Token | None:
    """Return what a token says, ``None`` for a key that is none."""
    chunks = key.split("/")
    if len(chunks) < 9 or chunks[0] != GRAPH or chunks[5] not in _ROLES_READ:
        return None
    role: Role = _ROLES_READ[chunks[5]]
    numbers = (chunks[1], chunks[3], chunks[4])
    if not all(number.isascii() and number.isdigit() for number in numbers):
        return None
    namespace = _plain(chunks[7]).rstrip("/")
    head = (int(chunks[1]), chunks[2], int(chunks[3]), int(chunks[4]), role)
    node = f"{namespace}/{chunks[8]}"
    if role == "node":
        return Token(*head, node)
    if len(chunks) < 13:
        return None
    # What later versions may add behind is not looked at.
    name, dds, type_hash, qos = chunks[9:13]
    return Token(*head, node, _plain(name), kind_of(dds), type_hash, read_qos(qos))


def qos_text(qos: QosProfile) -> str:
    """Return a profile as tokens have it: what is default is empty."""
    reliability = "" if qos.reliable else "2"
    durability = "1" if qos.transient_local else ""
    history = "2" if qos.keep_all else ""
    depth = "" if qos.depth == _DEFAULT_DEPTH else str(qos.depth)
    return f"{reliability}:{durability}:{history},{depth}:,:,:,,"


def read_qos(text: str) -> QosProfile:
    """Return the profile of a token; what is not understood counts as default."""
    reliability, durability, history, *_ = (*text.split(":"), "", "", "")
    kind, _, depth = history.partition(",")
    return QosProfile(
        reliable=reliability != "2",
        transient_local=durability == "1",
        depth=int(depth) if depth.isascii() and depth.isdigit() else _DEFAULT_DEPTH,
        keep_all=kind == "2",
    )


def gid(key: str) -> bytes:
    """Return the 16 bytes an endpoint is known by: a hash of the key of its token."""
    import xxhash

    number = xxhash.xxh3_128_intdigest(key.encode())
    return struct.pack("<QQ", number & 0xFFFF_FFFF_FFFF_FFFF, number >> 64)


def attachment(sequence: int, time: int, sender: bytes) -> bytes:
    """Return what goes with every message, request and reply.

    ``time`` is wall clock [ns since 1970], ``sender`` a :func:`gid`. A reply has the sequence
    number and the sender of its request.
    """
    return _ATTACHMENT.pack(sequence, time, len(sender)) + sender


def read_attachment(data: bytes) -> tuple[int, int, bytes]:
    """Return sequence number, time [ns] and sender; raises ``ValueError`` for anything else."""
    if len(data) < _ATTACHMENT.size:
        raise ValueError(f"an attachment has {_ATTACHMENT.size + GID_SIZE} bytes, not {len(data)}")
    sequence, time, size = _ATTACHMENT.unpack_from(data)
    sender = data[_ATTACHMENT.size :]
    if size != GID_SIZE or len(sender) != size:
        raise ValueError(f"an attachment ends with {GID_SIZE} bytes of its sender")
    return sequence, time, sender


def _mangled(name: str) -> str:
    return name.replace("/", "%")


def _plain(name: str) -> str:
    return name.replace("%", "/")
