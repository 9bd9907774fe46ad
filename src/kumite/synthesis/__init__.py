"""From choices to poses: joins, foot lock, reactions."""

from kumite.lazy import names_of

__getattr__, __dir__ = names_of(__name__, __file__)
