"""The body laid on a skeleton: capsules that can be hit and weighed, and a skin that is seen."""

from kumite.body.apart import Apart, keep_out
from kumite.body.mesh import ROLES, BodyMesh, body_mesh, skin_vertices
from kumite.body.palette import RGB, Palette, main_colours, mix, palettes
from kumite.body.segments import ARMS, PARTS, Body, lay_body
from kumite.body.spheres import (
    Spheres,
    lay_spheres,
    limb_spheres,
    load_spheres,
    save_spheres,
    strikes_with,
)

__all__ = [
    "ARMS",
    "PARTS",
    "RGB",
    "ROLES",
    "Apart",
    "Body",
    "BodyMesh",
    "Palette",
    "Spheres",
    "body_mesh",
    "keep_out",
    "lay_body",
    "lay_spheres",
    "limb_spheres",
    "load_spheres",
    "main_colours",
    "mix",
    "palettes",
    "save_spheres",
    "skin_vertices",
    "strikes_with",
]
