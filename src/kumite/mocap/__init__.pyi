from kumite.mocap.folder import BadFile, ClipInfo, Fact, Loaded, load

__all__ = ["BadFile", "ClipInfo", "Fact", "Loaded", "load"]
