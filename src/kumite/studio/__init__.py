"""The studio: any stage, live or recorded, in the browser."""

from kumite.studio.studio import FIRST_RECORDING, Studio, serve

__all__ = ["FIRST_RECORDING", "Studio", "serve"]
