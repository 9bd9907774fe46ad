"""Controllers: given what a character sees, choose its next action."""

from kumite.lazy import names_of

__getattr__, __dir__ = names_of(__name__, __file__)
