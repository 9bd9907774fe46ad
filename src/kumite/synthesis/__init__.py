"""From choices to poses: joins, foot lock, reactions."""

from kumite.synthesis.cast import Cast

__all__ = ["Cast"]
