"""What is wrong with the geometry of a walls layer: areas that are none, doorways that are none."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from grammars.floorplan import FloorPlan, Opening
from grammars.model.geometry import Pose2, Ring
from grammars.text.diagnostics import Findings, Where

if TYPE_CHECKING:
    import shapely
    from shapely.geometry import Polygon

_SMALLEST: Final = 1e-6
"""Area of the smallest outline [m²]."""
_OVERLAP: Final = 1e-2
"""Floor two spaces may share before it is worth a word [m²], as in floor plans."""
_SWALLOWED: Final = 0.9
"""Share of a space that walls may stand on."""
_JAMB: Final = 0.25
"""How far a jamb may be from the nearest wall [m]: walls of maps end a few cells too early."""
_BESIDE: Final = 0.2
"""Steps off the faces of an entryway to see whether there is floor [m]."""


class WallsChecker(Findings):
    """Collects what is wrong with the areas of one layer, and with the plan they make."""

    def check_area(
        self, outline: Ring, holes: Sequence[Ring], where: Where, holes_at: Sequence[Where]
    ) -> None:
        """Report an outline or hole that crosses itself, and holes that are not inside."""
        import shapely
        from shapely.geometry import Polygon

        rings = [Polygon(outline), *map(Polygon, holes)]
        sound = [
            self._check_ring(ring, "hole" if k else "outline", place)
            for k, (ring, place) in enumerate(zip(rings, (where, *holes_at), strict=True))
        ]
        if not all(sound) or Polygon(outline, holes).is_valid:
            return
        outer, *inner = rings
        shapely.prepare(outer)
        for hole, place in zip(inner, holes_at, strict=True):
            if not outer.covers(hole):
                self.error(place, "this hole is not inside of its outline")
        if not self.errors:
            self.error(where, "the holes of this outline overlap or cut it in two")

    def _check_ring(self, ring: Polygon, kind: str, where: Where) -> bool:
        import shapely

        if not ring.is_valid:
            reason, _, place = shapely.is_valid_reason(ring).partition("[")
            x, _, y = place.rstrip("]").partition(" ")
            near = f" near [{x}, {y}]" if y and "Self" in reason else ""
            hint = "list the corners in order around the area"
            self.error(where, f"this {kind} crosses itself{near}", hint)
            return False
        if ring.area < _SMALLEST:
            self.error(where, f"this {kind} has no area", "it needs three corners or more")
            return False
        return True

    def check_plan(self, plan: FloorPlan) -> None:
        """Report swallowed spaces and blocked entryways; warn of what is placed suspiciously.

        All areas of ``plan`` must be valid.
        """
        import shapely
        from shapely.geometry import Polygon

        walls = [Polygon(item.footprint, item.holes) for item in plan.features]
        tree = shapely.STRtree(walls)
        floors = [Polygon(space.outline, space.holes) for space in plan.spaces]
        for space, floor in zip(plan.spaces, floors, strict=True):
            standing = shapely.union_all([walls[k] for k in tree.query(floor, "intersects")])
            if floor.intersection(standing).area > _SWALLOWED * floor.area:
                self.error(
                    space.where,
                    f'walls cover the floor of "{space.name}"',
                    "the outline of a wall that encloses a space needs a hole for it",
                )
        self._check_overlaps(plan, floors)
        for opening in plan.openings:
            self._check_entryway(opening, tree, floors)

    def _check_overlaps(self, plan: FloorPlan, floors: Sequence[Polygon]) -> None:
        import shapely

        first, second = shapely.STRtree(floors).query(floors, predicate="intersects")
        for a, b in sorted(zip(first.tolist(), second.tolist(), strict=True)):
            area = floors[a].intersection(floors[b]).area if a < b else 0.0
            if area > _OVERLAP:
                names = f'"{plan.spaces[b].name}" and "{plan.spaces[a].name}"'
                self.warning(plan.spaces[b].where, f"{names} overlap ({area:.2f} m²)")

    def _check_entryway(
        self, opening: Opening, tree: shapely.STRtree, floors: Sequence[Polygon]
    ) -> None:
        import shapely
        from shapely.geometry import LineString, Point

        half, middle = opening.width / 2, opening.depth / 2
        label = f'entryway "{opening.name}"'

        def at(x: float, y: float) -> tuple[float, float]:
            return (opening.frame @ Pose2(x, y)).apply((0.0, 0.0))

        line = LineString([at(-half, middle), at(half, middle)])
        walls = tree.geometries
        crossed = shapely.union_all(walls[tree.query(line, "intersects")])
        if line.intersection(crossed).length > line.length / 2:
            self.error(
                opening.where,
                f"{label} leads through a wall",
                "leave the gap in the outlines of the walls: an entryway here cuts nothing",
            )
            return
        for name, jamb in (("from", at(-half, middle)), ("to", at(half, middle))):
            if len(tree.query(Point(jamb), predicate="dwithin", distance=_JAMB)) == 0:
                x, y = jamb
                self.warning(
                    opening.where,
                    f'{label}: no wall stands at "{name}" [{x:g}, {y:g}]',
                    "an entryway leads from the end of one wall to that of another",
                )
        # On one side may be the outside.
        probes = [Point(at(0.0, y)) for y in (-_BESIDE, opening.depth + _BESIDE)]
        if not any(floor.covers(probe) for floor in floors for probe in probes):
            self.warning(opening.where, f"{label} leads to no space")
