"""The body laid on a skeleton: capsules that can be hit and weighed, and a skin that is seen."""

from kumite.body.mesh import ROLES, BodyMesh, body_mesh, skin_vertices
from kumite.body.segments import PARTS, Body, lay_body

__all__ = ["PARTS", "ROLES", "Body", "BodyMesh", "body_mesh", "lay_body", "skin_vertices"]
