"""Recordings and clips leave Kumite: GLB, BVH, pictures."""
