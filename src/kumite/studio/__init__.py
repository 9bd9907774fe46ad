"""The studio: any stage, live or recorded, in the browser."""

from kumite.studio.coming import Coming, Interlude
from kumite.studio.studio import Studio, serve

__all__ = ["Coming", "Interlude", "Studio", "serve"]
