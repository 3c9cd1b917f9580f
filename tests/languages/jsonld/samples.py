"""JSON-LD as others write it: a door and a cupboard with a drawer, in the published vocabulary."""

ROB2B = "https://comp-rob2b.github.io/metamodels/"
SECORO = "https://secorolab.github.io/metamodels/"
CONTEXTS = [
    ROB2B + "geometry/structural-entities.json",
    ROB2B + "geometry/spatial-relations.json",
    ROB2B + "geometry/coordinates.json",
    ROB2B + "kinematic-chain/structural-entities.json",
    ROB2B + "kinematic-chain/state.json",
    ROB2B + "newtonian-rigid-body-dynamics.json",
    ROB2B + "qudt.json",
    SECORO + "geometry/coordinates.json",
    SECORO + "geometry/polytope.json",
    SECORO + "floorplan/object.json",
    SECORO + "floorplan/state.json",
    SECORO + "simulation/gazebo.json",
]
PLAN = "https://secorolab.github.io/models/floorplan/building_c/"
POSITION = ["JointReference", "JointPosition", "Quantity"]


def document(nodes):
    """Put nodes into a document with the published contexts."""
    prefixes = {"door": "https://example.org/objects/door/", "fpm": PLAN}
    return {"@context": [*CONTEXTS, prefixes], "@graph": nodes}


def frame(name, **vectors):
    """Return a frame, its origin and its axis vectors."""
    origin = f"door:{name}-origin"
    arrows = [
        {"@id": f"door:{vector}", "@type": ["Vector", "BoundVector", "UnitLength"], "start": origin}
        for vector in vectors.values()
    ]
    slots = {f"vector-{axis}": f"door:{vector}" for axis, vector in vectors.items()}
    node = {"@id": f"door:{name}", "@type": "Frame", "origin": origin, **slots}
    return [{"@id": origin, "@type": ["3D", "Euclidean", "Point"]}, *arrows, node]


def pose(of, wrt, x, y, z, **other):
    """Return a pose and its coordinates (identifiers with their prefix)."""
    id = f"{of}-placed"
    numbers = {"unit": ["M", "RAD"], "alpha": 0, "x": x, "y": y, "z": z} | other
    return [
        {"@id": id, "@type": "Pose", "of": of, "with-respect-to": wrt},
        {
            "@id": f"{id}-numbers",
            "@type": ["PoseReference", "PoseCoordinate", "VectorXYZ"],
            "of-pose": id,
            "as-seen-by": wrt,
            **numbers,
        },
    ]


def body(name, size, mass):
    """Return everything about a box-shaped link but its frames and members."""
    id = f"door:{name}"
    x, y, z = size
    views = {
        "visual": ["LinkWithPolytope", "LinkVisualRepresentation"],
        "collision": ["LinkWithPolytope", "LinkPhysicsRepresentation"],
    }
    return [
        {
            "@id": f"{id}-box",
            "@type": ["Polytope", "3DPolytope", "CuboidWithSize"],
            "unit": "M",
            "x-size": x,
            "y-size": y,
            "z-size": z,
        },
        {"@id": f"{id}-m", "@type": ["RigidBodyInertia", "Mass"], "of-body": id, "mass": mass},
        *(
            {"@id": f"{id}-{view}", "@type": types, "link": id, "polytope": f"{id}-box"}
            for view, types in views.items()
        ),
        {"@id": f"{id}-link", "@type": "ObjectLink", "link": id, "link-frame": f"{id}-frame"},
        {
            "@id": f"{id}-gazebo",
            "@type": "GazeboLinkRepresentation",
            **{view: f"{id}-{view}" for view in views},
            "inertia": f"{id}-m",
            "material": "Grey",
            "gz-link": f"{id}-link",
        },
    ]


def limit(name, joint, value, unit, *types):
    """Return a joint position."""
    numbers = {"of-joint": f"door:{joint}", "unit": unit, "value": value}
    return {"@id": f"door:{name}", "@type": [*POSITION, *types], **numbers}


def hinged_door():
    """A leaf of 0.04 x 0.90 x 2.00 m on a post of 0.06 x 0.06 x 2.02 m, one instance."""
    corridor = "fpm:left_long_corridor-wall-1-frame"
    return [
        *frame("base"),
        *frame("post-frame"),
        *frame("leaf-frame"),
        *frame("hinge-on-post", z="hinge-on-post-z"),
        *frame("hinge-on-leaf", z="hinge-on-leaf-z"),
        *pose("door:post-frame", "door:base", 0, 0, 1.01),
        *pose("door:hinge-on-post", "door:post-frame", 0, 0.03, 0),
        *pose("door:hinge-on-leaf", "door:hinge-on-post", 0, 0, 0),
        *pose("door:leaf-frame", "door:hinge-on-leaf", 0, 0.45, 0),
        {
            "@id": "door:post",
            "@type": ["SimplicialComplex", "RigidBody"],
            "simplices": ["door:post-frame", "door:hinge-on-post", "door:hinge-on-post-z"],
        },
        {
            "@id": "door:leaf",
            "@type": ["SimplicialComplex", "RigidBody"],
            "simplices": ["door:hinge-on-leaf", "door:hinge-on-leaf-z", "door:leaf-frame"],
        },
        {
            "@id": "door:axis",
            "@type": "LineCollinearity",
            "lines": ["door:hinge-on-post-z", "door:hinge-on-leaf-z"],
        },
        {
            "@id": "door:hinge",
            "@type": ["Joint", "RevoluteJoint"],
            "between-attachments": ["door:post", "door:leaf"],
            "common-axis": "door:axis",
        },
        {
            "@id": "door:tree",
            "@type": "JointWithTree",
            "joint-without-tree": "door:hinge",
            "parent": "door:post",
            "children": ["door:leaf"],
        },
        {"@id": "door:chain", "@type": "KinematicChain", "joints": ["door:hinge"]},
        limit("least", "hinge", 0.0, "RAD", "JointLowerLimit"),
        limit("most", "hinge", 1.9, "RAD", "JointUpperLimit"),
        *body("post", (0.06, 0.06, 2.02), 100),
        *body("leaf", (0.04, 0.9, 2.0), 20),
        {
            "@id": "door:door",
            "@type": ["Object", "ObjectWithKinematicChain"],
            "kinematic-chain": "door:chain",
            "object-frame": "door:base",
            "object-links": ["door:post-link", "door:leaf-link"],
        },
        {"@id": "door:ajar", "@type": "State"},
        limit("ajar-angle", "hinge", 0.6, "RAD"),
        {
            "@id": "door:ajar-hinge",
            "@type": "JointState",
            "joint": "door:hinge",
            "pose": "door:ajar-angle",
            "state": "door:ajar",
        },
        *frame("here"),
        *pose("door:here", corridor, 20.5, 0.1, 0, unit=["M", "DEG"], alpha=-90),
        {
            "@id": "door:door-instance-1",
            "@type": "ObjectInstance",
            "frame": "door:here",
            "of-object": "door:door",
            "world": "fpm:building_c",
            "start-state": "door:ajar",
        },
    ]


def two_leaves():
    """A rail on the wall with two panels that slide apart along x, as in front of a lift."""
    nodes = [*frame("base"), *frame("rail-frame"), *pose("door:rail-frame", "door:base", 0, 0, 2)]
    members = ["door:rail-frame"]
    bounds = {"left": (-1.0, 0.0), "right": (0.0, 1.0)}
    for side, (least, most) in bounds.items():
        rail, panel = f"{side}-on-rail", f"{side}-on-panel"
        x = 0.5 if side == "right" else -0.5
        members += [f"door:{rail}", f"door:{rail}-x"]
        nodes += [
            *frame(rail, x=f"{rail}-x"),
            *frame(panel, x=f"{panel}-x"),
            *frame(f"{side}-frame"),
            *pose(f"door:{rail}", "door:rail-frame", x, 0, -0.025),
            *pose(f"door:{panel}", f"door:{rail}", 0, 0, 0),
            *pose(f"door:{side}-frame", f"door:{panel}", 0, 0, -0.97),
            {
                "@id": f"door:{side}",
                "@type": ["SimplicialComplex", "RigidBody"],
                "simplices": [f"door:{panel}", f"door:{panel}-x", f"door:{side}-frame"],
            },
            {
                "@id": f"door:{side}-axis",
                "@type": "LineCollinearity",
                "lines": [f"door:{panel}-x", f"door:{rail}-x"],
            },
            {
                "@id": f"door:{side}-joint",
                "@type": ["Joint", "PrismaticJoint"],
                "between-attachments": [f"door:{side}", "door:rail"],
                "common-axis": f"door:{side}-axis",
            },
            limit(f"{side}-least", f"{side}-joint", least, "M", "JointLowerLimit"),
            limit(f"{side}-most", f"{side}-joint", most, "M", "JointUpperLimit"),
            *body(side, (1.0, 0.05, 1.94), 10),
        ]
    rail_body = {"@id": "door:rail", "@type": ["SimplicialComplex", "RigidBody"]}
    return [
        *nodes,
        {**rail_body, "simplices": members},
        *body("rail", (4.0, 0.05, 0.05), 1),
        {
            "@id": "door:chain",
            "@type": "KinematicChain",
            "joints": ["door:left-joint", "door:right-joint"],
        },
        {
            "@id": "door:lift",
            "@type": ["Object", "ObjectWithKinematicChain"],
            "kinematic-chain": "door:chain",
            "object-frame": "door:base",
            "object-links": ["door:rail-link", "door:left-link", "door:right-link"],
        },
    ]


def table():
    """A top with one leg, joined by a joint of a type no context knows to move."""
    return [
        *frame("base"),
        *frame("top-frame"),
        *frame("leg-frame", z="leg-z"),
        *pose("door:top-frame", "door:base", 0, 0, 0.785),
        *pose("door:leg-frame", "door:top-frame", 0.35, 0.75, -0.3925),
        {
            "@id": "door:top",
            "@type": ["SimplicialComplex", "RigidBody"],
            "simplices": ["door:top-frame"],
        },
        {
            "@id": "door:leg",
            "@type": ["SimplicialComplex", "RigidBody"],
            "simplices": ["door:leg-frame", "door:leg-z"],
        },
        {"@id": "door:axis", "@type": "LineCollinearity", "lines": ["door:leg-z"]},
        {
            "@id": "door:screw",
            "@type": ["Joint", "FixedJoint"],
            "between-attachments": ["door:top", "door:leg"],
            "common-axis": "door:axis",
        },
        {"@id": "door:chain", "@type": "KinematicChain", "joints": ["door:screw"]},
        *body("top", (0.8, 1.6, 0.03), 5),
        *body("leg", (0.02, 0.02, 0.785), 1),
        {
            "@id": "door:table",
            "@type": ["Object", "ObjectWithKinematicChain"],
            "kinematic-chain": "door:chain",
            "object-frame": "door:base",
            "object-links": ["door:top-link", "door:leg-link"],
        },
    ]
