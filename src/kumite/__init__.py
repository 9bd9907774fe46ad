"""Kumite: motion capture of one person at a time, turned into characters that spar.

The pipeline, one import a stage:

    mocap.load → build_frames → World → record → measure / write_glb / write_bvh / studio.serve
"""

from kumite.lazy import names_of

__version__ = "0.1.0"

__getattr__, __dir__ = names_of(__name__, __file__)
