"""Meshes of walls: closed, with outward faces, of the right volume."""

import itertools
import math

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from grammars.floorplan import load_floorplan
from grammars.model.geometry import Pose2
from grammars.model.scene import Scene, Solid
from grammars.scenery.composition import compile_scene
from templates.mesh import glb_bytes, stl_bytes, wall_mesh
from tests.scene.templates.worlds import clockwise as box
from tests.scene.templates.worlds import two_rooms


def volume(scene):
    """Sum up the area that stands between neighbouring heights."""
    heights = sorted({z for s in scene.solids for z in (s.z_min, s.z_max)})
    total = 0.0
    for low, high in itertools.pairwise(heights):
        standing = [
            shapely.Polygon(s.polygon) for s in scene.solids if s.z_min <= low and s.z_max >= high
        ]
        total += shapely.union_all(standing, grid_size=1e-8).area * (high - low)
    return total


def scene_of(*solids):
    named = (Solid(f"s{i}", "wall", ring, a, b) for i, (ring, a, b) in enumerate(solids))
    return Scene("solids", (), (), tuple(named))


@pytest.mark.parametrize("yaw", [0.0, 0.6, -2.0])
def test_walls_are_one_closed_body_with_outward_faces(yaw):
    scene = two_rooms(Pose2(40.0, -30.0, yaw))
    mesh = wall_mesh(scene.solids)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(volume(scene), rel=1e-6)


def test_blocks_that_touch_stay_a_manifold_without_useless_faces():
    in_an_edge = scene_of((box(0, 0, 1, 1), 0.0, 1.0), (box(1, 1, 2, 2), 0.0, 1.0))
    body = wall_mesh(in_an_edge.solids)
    assert body.is_watertight
    assert body.volume == pytest.approx(2.0, rel=1e-6)
    in_a_face = scene_of((box(0, 0, 1, 1), 0.0, 1.0), (box(1, 0, 2, 1), 0.0, 1.0))
    assert len(wall_mesh(in_a_face.solids).faces) == 12


@given(
    st.lists(
        st.tuples(
            st.integers(0, 8), st.integers(0, 8), st.integers(1, 4), st.integers(1, 4),
            st.integers(0, 2), st.integers(1, 3),
        ),
        min_size=1,
        max_size=8,
    ),
    st.floats(-math.pi, math.pi),
)  # fmt: skip
def test_any_heap_of_blocks_has_the_volume_of_its_union(blocks, yaw):
    turn = Pose2(3.0, 4.0, yaw)
    scene = scene_of(
        *(
            (turn.apply_ring(box(x, y, x + w, y + d)), float(z), float(z + h))
            for x, y, w, d, z, h in blocks
        )
    )
    mesh = wall_mesh(scene.solids)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(volume(scene), rel=1e-5)


def test_building_c_stays_watertight_in_both_formats(campaigns, tmp_path):
    import trimesh

    scene = compile_scene(load_floorplan(campaigns / "ortega2024" / "building_c.fpm"))
    mesh = wall_mesh(scene.solids)
    stl, glb = tmp_path / "c.stl", tmp_path / "c.glb"
    stl.write_bytes(stl_bytes(mesh))
    glb.write_bytes(glb_bytes(mesh, name="c"))
    low, high = mesh.bounds
    for path in (stl, glb):
        body = trimesh.load(path, force="mesh")
        assert body.is_volume
        assert body.volume == pytest.approx(volume(scene), rel=1e-5)
    assert np.allclose(trimesh.load(stl).bounds, [low, high], atol=1e-4)
    # glTF looks along y where we look along z.
    upright = [[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]]
    assert np.allclose(trimesh.load(glb, force="mesh").bounds, upright, atol=1e-4)
