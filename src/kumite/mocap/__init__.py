"""Motion capture files in: BVH, ASF/AMC, whole folders; units, axes and joint roles found."""

from kumite.lazy import names_of

__getattr__, __dir__ = names_of(__name__, __file__)
