"""Frames, poses and positions as JSON-LD nodes: what plans and objects have in common.

Identifiers are up to the writers, the keys and their order are not: files of equal plans are equal.
"""

from __future__ import annotations

from typing import Any, Final, TypeAlias

from grammars.floorplan import Point3
from grammars.model.geometry import Pose2

Json: TypeAlias = dict[str, Any]

POINT: Final = ["3D", "Euclidean", "Point"]
_POSE_COORDINATE: Final = ["PoseReference", "PoseCoordinate", "VectorXYZ", "EulerAngles"]
_POSITION_COORDINATE: Final = ["PositionReference", "PositionCoordinate", "VectorXYZ"]


def frame_nodes(frame: str, origin: str) -> list[Json]:
    """Return a plain frame and its origin."""
    return [
        {"@id": origin, "@type": POINT},
        {"@id": frame, "@type": "Frame", "origin": origin},
    ]


def pose_nodes(
    ids: tuple[str, str], of: str, wrt: str, pose: Pose2, z: float = 0.0, tilt: float = 0.0
) -> list[Json]:
    """Return the pose of frame ``of`` with respect to ``wrt``, and its coordinates.

    ``ids`` are the identifiers of both.
    """
    return [
        {"@id": ids[0], "@type": "Pose", "of": of, "with-respect-to": wrt},
        {
            "@id": ids[1],
            "@type": _POSE_COORDINATE,
            "of-pose": ids[0],
            "as-seen-by": wrt,
            "unit": ["M", "RAD"],
            "alpha": pose.yaw,
            "beta": tilt,
            "x": pose.x,
            "y": pose.y,
            "z": z,
        },
    ]


def position_nodes(
    ids: tuple[str, str], point: str, frame: str, origin: str, at: Point3
) -> list[Json]:
    """Return the position of a point in a frame with this origin, and its coordinates.

    ``ids`` are the identifiers of both.
    """
    x, y, z = at
    return [
        {"@id": ids[0], "@type": "Position", "of": point, "with-respect-to": origin},
        {
            "@id": ids[1],
            "@type": _POSITION_COORDINATE,
            "of-position": ids[0],
            "as-seen-by": frame,
            "unit": "M",
            "x": x,
            "y": y,
            "z": z,
        },
    ]


def polyhedron_node(id: str, points: list[str]) -> Json:
    """Return a prism: its near ring, then the far one, as many corners each."""
    count = len(points) // 2
    sides = [[k, (k + 1) % count, (k + 1) % count + count, k + count] for k in range(count)]
    faces = [list(range(count)), list(range(count, 2 * count)), *sides]
    return {
        "@id": id,
        "@type": "Polyhedron",
        "points": points,
        "faces": [[points[k] for k in face] for face in faces],
    }
