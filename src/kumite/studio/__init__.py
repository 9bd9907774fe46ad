"""The studio: any stage, live or recorded, in the browser."""

from kumite.studio.studio import Studio, serve

__all__ = ["Studio", "serve"]
