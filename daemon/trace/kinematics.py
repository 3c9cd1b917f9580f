"""Where the moving links of a scene are for recorded joint positions.

A link's frame is the object's frame carried along by the link: with all joints at zero they
coincide, so a link's polygons, given in the object frame, are constant in its own frame.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from grammars.kinematics import cos_sin, link_tracks
from grammars.scene import Scene, SceneObject
from grammars.values import Floats


@dataclass(frozen=True, slots=True)
class MovingLinks:
    """The links of a scene that joints can move, prepared for :meth:`poses`.

    ``names`` are ``<object>/<link>``, in the order of the scene.
    """

    names: tuple[str, ...]
    _objects: tuple[tuple[SceneObject, int], ...]

    @classmethod
    def of(cls, scene: Scene) -> MovingLinks:
        """Collect the moving links of all objects that are not frozen.

        Raises :class:`ValueError` when the joints of an object form no tree.
        """
        objects: list[tuple[SceneObject, int]] = []
        column = 0
        for item in scene.objects:
            if item.joints and not item.frozen:
                link_tracks(item, np.empty((0, len(item.joints))))
                objects.append((item, column))
            column += len(item.joints)
        names = (f"{item.name}/{link}" for item, _ in objects for link in _moving(item))
        return cls(tuple(names), tuple(objects))

    def poses(self, positions: Floats) -> Floats:
        """Return the world poses (n, links, 4) as x, y, qz, qw for joint positions (n, k).

        ``qz`` and ``qw`` are the quaternion of the yaw.
        """
        out = np.empty((len(positions), len(self.names), 4))
        index = 0
        for item, column in self._objects:
            tracks = link_tracks(item, positions[:, column : column + len(item.joints)])
            for link in _moving(item):
                track = tracks[link]
                qw, qz = cos_sin(track[:, 2] / 2)
                out[:, index] = np.column_stack((track[:, 0], track[:, 1], qz, qw))
                index += 1
        return out


def _moving(item: SceneObject) -> list[str]:
    """Return the links of ``item`` that have a joint, in the order of its links."""
    children = {joint.child for joint in item.joints}
    return [link.name for link in item.links if link.name in children]
