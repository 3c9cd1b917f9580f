"""What a trace says before anything happens: topics, what identifies the run, what never moves."""

from __future__ import annotations

import functools
import hashlib
from collections.abc import Mapping

import zstandard

from daemon.spec import RunSpec
from daemon.trace import messages as ros
from daemon.trace import statics
from daemon.trace.container import Container
from grammars import codec
from grammars.mission import Mission
from grammars.robot import Robot
from grammars.scene import Scene


def describe(
    container: Container, spec: RunSpec, scene: bytes, versions: Mapping[str, str]
) -> None:
    """Declare the topics and write what identifies the run, ahead of everything recorded."""
    for topic in ros.TOPICS:
        qos = {"offered_qos_profiles": ros.latched_qos() if topic.latched else ""}
        container.add_channel(topic.name, topic.kind, ros.schema(topic.kind), qos)
    container.add_attachment("spec.json", "application/json", codec.to_json(spec))
    container.add_attachment("scene.json.zst", "application/zstd", scene)
    facts = {
        "digest": spec.digest,
        "label": spec.label,
        "campaign": spec.campaign,
        "scenario": spec.scenario,
        "sut": spec.sut.name,
        "repeat": str(spec.repeat),
        "seed": str(spec.seed),
        "limit": repr(spec.limit),
        "scene": spec.scene,
        "robot": spec.robot.name,
        "mission": spec.mission.name,
    }
    container.add_metadata("run", facts)
    container.add_metadata("versions", {"engine": spec.engine, **dict(sorted(versions.items()))})


@functools.lru_cache(maxsize=4)
def fixed(scene: Scene, robot: Robot, course: Mission) -> tuple[tuple[str, bytes], ...]:
    """Return the payloads of the latched topics but the map, the same for every repeat."""
    messages = {
        "/footprint": statics.footprint(robot),
        "/tf_static": statics.fixed_frames(robot, scene),
        "/scene": statics.markers(scene, course),
    }
    return tuple((topic, ros.serialize(m, ros.KINDS[topic])) for topic, m in messages.items())


def packed_scene(scene: Scene, digest: str) -> bytes:
    """Return the scene's canonical JSON, compressed; it must be the one the run specifies."""
    data = codec.to_json(scene)
    found = hashlib.sha256(data).hexdigest()
    if found != digest:
        raise ValueError(f"scene {found[:12]} given, {digest[:12]} specified")
    return _compressed(data)


@functools.lru_cache(maxsize=4)
def _compressed(data: bytes) -> bytes:
    return zstandard.ZstdCompressor(level=9).compress(data)
