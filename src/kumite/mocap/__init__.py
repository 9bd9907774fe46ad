"""Motion capture files in: BVH, ASF/AMC, whole folders; units, axes and joint roles found."""

from kumite.mocap.folder import BadFile, ClipInfo, Fact, Loaded, load

__all__ = ["BadFile", "ClipInfo", "Fact", "Loaded", "load"]
