"""Motion capture files in: BVH, ASF/AMC, whole folders; units, axes and joint roles found."""

from kumite.mocap.folder import ClipInfo, Fact, Loaded, load

__all__ = ["ClipInfo", "Fact", "Loaded", "load"]
