"""Models as they were published in 2023, with the faults those have, made from models of ours."""

import json
import math

from tests.languages.jsonld.samples import ROB2B

_OLD = "https://hbrs-sesame.github.io/metamodels/"
_LISTS = {"@container": "@list", "@type": "@id"}
CONTEXTS = {
    "skeleton": [
        {"geom": f"{ROB2B}geometry/structural-entities#"},
        f"{ROB2B}geometry/structural-entities.json",
    ],
    "shape": [{"polytope": f"{_OLD}polytope#"}, f"{_OLD}geometry/polytope.json"],
    "spatial_relations": [
        # One of the two published plans has the address of the context for a prefix.
        {"geor": f"{ROB2B}geometry/spatial-relations.json"},
        f"{ROB2B}geometry/spatial-relations.json",
    ],
    "coordinate": [
        {"coord": f"{ROB2B}geometry/coordinates#"},
        f"{ROB2B}qudt.json",
        f"{ROB2B}geometry/coordinates.json",
        f"{_OLD}geometry/coordinate-extension.json",
    ],
    "floorplan": [{"floorplan": f"{_OLD}floorplan#"}, f"{_OLD}floor-plan/floor-plan.json"],
}


class _Plan:
    """The nodes of the files, in the order and with the identifiers of their time."""

    def __init__(self, plan):
        self.files = {name: [] for name in CONTEXTS}
        self._frame("world", "world")
        for space in plan.spaces:
            name, own = space.name, space.frame.inverse()
            self._frame(f"center-{name}", f"center-{name}")
            placed = space.placement
            assert placed is not None
            of, wrt = (self._earlier(frame) for frame in (placed.of, placed.wrt))
            # Of frames of another file, only some are written with their prefix.
            seen = wrt.removeprefix("geom:")
            self._pose(
                f"pose-{of.removeprefix('geom:')}-to-{wrt[5:]}", of, wrt, seen, placed.offset
            )
            corners = [f"point-shape-{name}-{k}" for k in range(len(space.outline))]
            self._outline(name, corners, list(own.apply_ring(space.outline)), f"center-{name}")
            for wall in space.walls:
                stem = f"{name}-wall-{wall.index}"
                self._frame(stem, f"frame-{stem}")
                pose = f"pose-of-wall-{wall.index}-frame-to-{name}-frame"
                centre = f"geom:frame-center-{name}"
                self._pose(pose, f"geom:frame-{stem}", centre, centre, own @ wall.frame)
                corners = [f"point-corner-{stem}-{k}" for k in range(4)]
                # In the frame of the space, although it says that the wall sees them.
                self._outline(stem, corners, list(own.apply_ring(wall.footprint)), stem)
            self._elements(plan, name, len(space.walls))
        spaces = [f"floorplan:space-{space.name}" for space in plan.spaces]
        whole = {"@id": f"floorplan:{plan.name}", "@type": "FloorPlan", "spaces": spaces}
        self.files["floorplan"].append(whole)

    def _frame(self, frame, point):
        origin = f"geom:{'world-origin' if frame == 'world' else f'point-{point}'}"
        id = "geom:world-frame" if frame == "world" else f"geom:frame-{frame}"
        self.files["skeleton"] += [
            {"@id": origin, "@type": "Point"},
            {"@id": id, "@type": "Frame", "origin": origin},
        ]

    def _earlier(self, frame):
        if frame == "world-frame" or "-wall-" in frame:
            stem = frame.removesuffix("-frame")
            return f"geom:{frame}" if frame == "world-frame" else f"geom:frame-{stem}"
        return f"geom:frame-center-{frame.removesuffix('-frame')}"

    def _pose(self, id, of, wrt, seen, pose):
        relation = {"@id": f"geor:{id}", "@type": "Pose", "of": of, "with-respect-to": wrt}
        numbers = {"theta": math.degrees(pose.yaw), "x": pose.x, "y": pose.y}
        types = ["PoseReference", "PoseCoordinate", "VectorXY"]
        coordinate = {"@id": f"coord:coord-{id}", "@type": types, "of-pose": f"geor:{id}"}
        coordinate |= {"as-seen-by": seen, "unit": ["M", "degrees"], **numbers}
        self.files["spatial_relations"].append(relation)
        self.files["coordinate"].append(coordinate)

    def _outline(self, name, points, ring, frame):
        ids = [f"geom:{point}" for point in points]
        polygon = {"@id": f"polytope:polygon-{name}", "@type": "Polygon", "points": ids}
        self.files["shape"].append(polygon)
        types = ["PositionReference", "PositionCoordinate", "VectorXY"]
        for point, (x, y) in zip(points, ring, strict=True):
            id = f"position-{point}"
            self.files["skeleton"].append({"@id": f"geom:{point}", "@type": "Point"})
            relation = {"@id": f"geor:{id}", "@type": "Position", "of": f"geom:{point}"}
            # Corners of walls are with respect to a frame, of spaces to a point.
            wrt = f"geom:frame-{frame}" if "wall" in frame else f"geom:point-{frame}"
            self.files["spatial_relations"].append(relation | {"with-respect-to": wrt})
            coordinate = {"@id": f"coord:coord-{id}", "@type": types, "of-position": f"geor:{id}"}
            coordinate |= {"with-respect-to": wrt, "as-seen-by": f"geom:frame-{frame}"}
            self.files["coordinate"].append(coordinate | {"unit": "M", "x": x, "y": y})

    def _elements(self, plan, name, walls):
        ids = [f"floorplan:space-{name}-wall-{k}" for k in range(walls)]
        features = [
            {
                "@id": f"floorplan:feature-{name}-{feature.name}",
                "@type": "Feature",
                "shape": f"polytope:polygon-{name}-feature-{feature.name}",
            }
            for feature in plan.features
            if feature.space == name
        ]
        self.files["floorplan"] += [
            {"@id": id, "@type": "Wall", "shape": f"polytope:polygon-{name}-wall-{k}"}
            for k, id in enumerate(ids)
        ]
        space = {"@id": f"floorplan:space-{name}", "@type": "Space", "walls": ids}
        space["shape"] = f"polytope:polygon-{name}"
        # Features have a shape whose corners no file places.
        if features:
            space["feature"] = [feature["@id"] for feature in features]
        for feature in features:
            points = [f"geom:point-feature-shape-{feature['@id']}-{k}" for k in range(4)]
            shape = {"@id": feature["shape"], "@type": "Polygon", "points": points}
            self.files["shape"].append(shape)
        self.files["floorplan"] += [*features, space]


def write_plan(plan, folder):
    """Write a plan as in December 2023."""
    folder.mkdir(parents=True)
    for name, nodes in _Plan(plan).files.items():
        text = json.dumps({"@context": CONTEXTS[name], "@graph": nodes})
        (folder / f"{name}.json").write_text(text)
    return folder
