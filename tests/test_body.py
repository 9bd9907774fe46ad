"""The body laid on skeletons: capsules, masses and skin, on ours and on real ones."""

from __future__ import annotations

import numpy as np
import pytest

from kumite import body as bodies
from kumite import mocap as mocap_files
from kumite import performer
from kumite.body.stance import stand
from kumite.clip import Skeleton, forward_kinematics
from kumite.errors import KumiteError
from kumite.rotation import conjugate, exp, multiply
from tests import toys


@pytest.fixture(params=["toy", "performer", "boxer", "cmu"])
def skeleton(request) -> Skeleton:
    if request.param == "toy":
        return toys.skeleton()
    if request.param == "performer":
        return performer.skeleton()
    mocap = request.getfixturevalue("mocap")
    take = {"boxer": "boxer/uppercut_left.bvh", "cmu": "cmu/02/02_01.amc"}[request.param]
    return mocap_files.load(mocap / take).clips[0].skeleton


def test_every_part_lies_on_its_bone(skeleton: Skeleton):
    body = bodies.lay_body(skeleton)
    assert body.parts == bodies.PARTS
    assert body.mass.sum() == pytest.approx(75.0)
    for left in (p for p in body.parts if p.startswith("left_")):
        a, b = body.part(left), body.part(left.replace("left_", "right_"))
        assert body.mass[a] == pytest.approx(body.mass[b])
        assert body.radius_start[a] == pytest.approx(body.radius_start[b])
    for part in ("upper_arm", "forearm", "thigh", "shin"):
        k = body.part(f"left_{part}")
        assert body.joint[k] == skeleton.joint(f"left_{part}")
        assert np.allclose(body.start[k], 0, atol=1e-6)
    head = body.part("head")
    assert body.joint[head] == skeleton.joint("head")
    assert 0.06 < body.radius_start[head] < 0.12


def test_the_skin_is_closed_weighted_and_man_sized(skeleton: Skeleton):
    mesh = bodies.body_mesh(skeleton)
    assert 1500 < len(mesh) < 6000
    assert np.allclose(mesh.weights.sum(axis=1), 1, atol=1e-6)
    assert mesh.joints.max() < len(skeleton) and mesh.faces.max() < len(mesh)
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-4)
    assert set(np.unique(mesh.role)) == set(range(len(bodies.ROLES)))
    assert np.all(np.diff(mesh.role.astype(int)) >= 0)
    # Every edge of a closed surface is shared by two faces, once in each direction.
    edges = np.concatenate([mesh.faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    forward = {tuple(e) for e in edges.tolist()}
    assert len(forward) == len(edges)
    assert all((b, a) in forward for a, b in forward)


def test_rest_pose_skinning_changes_nothing_and_skin_follows_bones(skeleton: Skeleton):
    mesh = bodies.body_mesh(skeleton)
    identity = np.zeros((1, len(skeleton), 4))
    identity[..., 0] = 1
    position, world = forward_kinematics(skeleton, np.zeros((1, 3)), identity)
    vertices, _ = bodies.skin_vertices(mesh, skeleton, position[0], world[0])
    assert np.allclose(vertices, mesh.vertices, atol=1e-5)
    turned = exp(np.random.default_rng(0).normal(0, 0.2, (1, len(skeleton), 3)))
    position, world = forward_kinematics(skeleton, np.ones((1, 3)), turned)
    vertices, normals = bodies.skin_vertices(mesh, skeleton, position[0], world[0])
    assert np.allclose(np.linalg.norm(normals, axis=1), 1)
    # Nobody's skin is far from the bones that carry it.
    carrier = position[0][mesh.joints[:, 0]]
    assert np.linalg.norm(vertices - carrier, axis=1).max() < 0.75


def test_standing_feet_are_flat_on_the_floor(skeleton: Skeleton):
    """In the standing pose the soles' lowest points lie level, a stature below the crown."""
    stance = stand(skeleton)
    mesh = bodies.body_mesh(skeleton)
    vertices, _ = bodies.skin_vertices(mesh, skeleton, stance.position, stance.wxyz)
    height = vertices[:, 1] - stance.ground
    left = vertices[:, 0] > np.median(vertices[:, 0])
    assert height.min() == pytest.approx(0, abs=0.005)
    assert height[left].min() == pytest.approx(height[~left].min(), abs=0.015)
    assert height.max() == pytest.approx(stance.stature, rel=0.15)
    sole = mesh.role == bodies.ROLES.index("soles")
    assert height[sole].max() < 0.04
    # The face looks ahead: the nose is what stands out furthest from the head in front.
    skull = np.flatnonzero(
        (mesh.joints[:, 0] == skeleton.joint("head")) & (mesh.weights[:, 0] > 0.99)
    )
    assert mesh.role[skull[np.argmax(vertices[skull, 2])]] == bodies.ROLES.index("skin")


@pytest.mark.parametrize("role", ["left_forearm", "right_shin"])
def test_bent_joints_keep_their_girth(skeleton: Skeleton, role: str):
    """No edge of the skin tears or collapses when an elbow or a knee bends a right angle."""
    mesh = bodies.body_mesh(skeleton)
    stance = stand(skeleton)
    joint = skeleton.joint(role)
    turned = stance.wxyz.copy()
    bend = exp(np.array([np.pi / 2 if role.endswith("shin") else 0.0, 0, 0]))
    if role.endswith("forearm"):
        bend = exp(np.array([0, 0, np.pi / 2]))
    local = [turned[0]]
    for j in range(1, len(skeleton)):
        own = multiply(conjugate(turned[skeleton.parents[j]]), turned[j])
        if j == joint:
            up = turned[skeleton.parents[j]]
            own = multiply(multiply(conjugate(up), multiply(bend, up)), own)
        local.append(own)
    root = np.zeros((1, 3))
    position, world = forward_kinematics(skeleton, root, np.array(local)[None])
    bent, _ = bodies.skin_vertices(mesh, skeleton, position[0], world[0])
    straight, _ = bodies.skin_vertices(mesh, skeleton, stance.position, stance.wxyz)
    edges = np.concatenate([mesh.faces[:, [a, b]] for a, b in ((0, 1), (1, 2), (2, 0))])
    before = np.linalg.norm(straight[edges[:, 0]] - straight[edges[:, 1]], axis=1)
    after = np.linalg.norm(bent[edges[:, 0]] - bent[edges[:, 1]], axis=1)
    assert np.max(after - before) < 0.07
    carried = mesh.joints[:, 0] == joint
    assert carried.sum() > 50
    # Rings around the joint keep more than a third of their width: nothing folds flat.
    near = np.linalg.norm(straight - stance.position[joint], axis=1) < 0.06
    reach = np.linalg.norm(bent[near] - position[0, joint], axis=1)
    assert reach.min() > 0.012


def test_palettes_colour_every_role():
    mesh = bodies.body_mesh(toys.skeleton())
    for palette in bodies.palettes(["red", "anna"]):
        colours = mesh.colours(palette)
        assert colours.shape == (len(mesh), 3) and colours.min() >= 0 and 0.5 < colours.max() <= 1


def test_colours_go_by_name():
    red, blue = bodies.main_colours(["red", "blue"])
    assert red[0] > 2 * max(red[1:]) and blue[2] > 2 * blue[0]
    assert bodies.main_colours(["blue", "red"]) == [blue, red]  # as in slip
    assert bodies.main_colours(["anna", "Red 2", "blue"])[1:] == [red, blue]
    # The same alone and among others, and nobody like another.
    assert (
        bodies.main_colours(["walker 7"])
        == bodies.main_colours([f"walker {n + 1}" for n in range(9)])[6:7]
    )
    found = []
    for others in (["red", "amber", "blue"], ["anna", "bert"], []):
        found = bodies.main_colours([*others, *(f"boxer {n + 1}" for n in range(1000)), "zoe"])
        assert len(set(found)) == len(found)
    apart = [np.linalg.norm(np.subtract(a, b)) for i, a in enumerate(found[:8]) for b in found[:i]]
    assert min(apart) > 50


def test_bodies_that_cannot_be_laid():
    s = toys.skeleton()
    without = {r: j for r, j in s.roles.items() if r != "left_foot"}
    with pytest.raises(KumiteError, match="left_foot"):
        bodies.lay_body(Skeleton(s.names, s.parents, s.offsets, without))
    with pytest.raises(KumiteError, match="mass"):
        bodies.lay_body(s, total_mass=0)
    with pytest.raises(KumiteError, match="body part 'tail'"):
        bodies.lay_body(s).part("tail")
