"""What happens in the clips: foot contacts, effective hits, actions and avoidance parts, found
without hand work; and how like a person they move.
"""

from kumite.lazy import names_of

__getattr__, __dir__ = names_of(__name__, __file__)
