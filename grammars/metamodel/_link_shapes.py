"""Shapes of links: cuboids and prisms as polygons in the object frame."""

from __future__ import annotations

from typing import Final

from grammars.metamodel._nodes import Node, Nodes, index_by
from grammars.metamodel._object_geometry import tidy
from grammars.metamodel._poses import LENGTHS, Placed, Positions, scaled
from grammars.metamodel._vocabulary import OBJ, POLY, local_name
from grammars.values import Ring

_LEVEL: Final = 1e-6


class LinkShapes:
    """Reads the shapes of links; problems are noted in the nodes' findings."""

    def __init__(self, nodes: Nodes) -> None:
        self._nodes = nodes
        self._positions = Positions(nodes)
        self._views: dict[str, list[Node]] = {}
        for kind in ("LinkPhysicsRepresentation", "LinkVisualRepresentation"):
            for body, found in index_by(nodes.by_id, OBJ[kind], OBJ["link"]).items():
                self._views.setdefault(body, found)

    def of(self, body: str) -> list[Node]:
        """Return what shows the shapes of a body: for collisions, else for the eye."""
        return self._views.get(body, [])

    def shape(
        self, view: Node, here: Placed, placed: dict[str, Placed]
    ) -> tuple[Ring, tuple[float, float]] | None:
        """Return the outline and the lowest and highest point of a shape, in the object frame.

        ``here`` is the frame of its link; ``None`` after noting why it cannot be read.
        """
        shape = self._nodes.by_id.get(view.ref(OBJ["polytope"]) or "")
        if shape is None:
            return None
        if POLY["CuboidWithSize"] in shape.types:
            sizes = [scaled(shape, POLY[f"{axis}-size"], LENGTHS) for axis in "xyz"]
            if any(size is None or not 1e-6 < size < 1e6 for size in sizes):
                self._nodes.error(shape.id, f"cuboid {local_name(shape.id)} lacks a size")
                return None
            x, y, z = (size / 2 for size in sizes if size is not None)
            ring = here.pose.apply_ring(((-x, -y), (x, -y), (x, y), (-x, y)))
            return _tidy_ring(ring), (tidy(here.z - z), tidy(here.z + z))
        points = shape.refs(POLY["points"])
        drawn = self._positions.outline(points) if len(points) >= 6 else None
        frame = placed.get(drawn[0]) if drawn is not None else None
        if drawn is None or frame is None or not is_level(frame):
            message = (
                f"shape {local_name(shape.id)} is neither a cuboid nor a prism of known corners"
            )
            self._nodes.error(shape.id, message)
            return None
        corners = frame.pose.apply_ring(tuple((x, y) for x, y, _ in drawn[1]))
        return self._prism(shape, corners, [tidy(z + frame.z) for _, _, z in drawn[1]])

    def _prism(
        self, shape: Node, corners: Ring, heights: list[float]
    ) -> tuple[Ring, tuple[float, float]] | None:
        import shapely

        hull = shapely.MultiPoint(corners).convex_hull
        half = len(corners) // 2
        ring = _tidy_ring(corners[:half])
        if not isinstance(hull, shapely.Polygon) or hull.area < 1e-9:
            self._nodes.error(shape.id, f"shape {local_name(shape.id)} has no area")
            return None
        if shapely.Polygon(ring).is_valid and abs(shapely.Polygon(ring).area - hull.area) < 1e-9:
            return ring, (min(heights), max(heights))
        outline = [(float(x), float(y)) for x, y in hull.exterior.coords[:-1]]
        message = f"shape {local_name(shape.id)} is no convex prism: its convex hull is taken"
        self._nodes.warn(shape.id, message)
        return _tidy_ring(tuple(reversed(outline))), (min(heights), max(heights))


def is_level(placed: Placed) -> bool:
    return abs(placed.tilt) < _LEVEL


def _tidy_ring(ring: Ring) -> Ring:
    return tuple((tidy(x), tidy(y)) for x, y in ring)
