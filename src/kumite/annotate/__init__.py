"""What happens in the clips: foot contacts and effective hits, found without hand work; and how
like a person they move.
"""

from kumite.annotate.contacts import Contacts, find_contacts
from kumite.annotate.likeness import Likeness, measure_likeness
from kumite.annotate.strikes import Strikes, find_strikes

__all__ = [
    "Contacts",
    "Likeness",
    "Strikes",
    "find_contacts",
    "find_strikes",
    "measure_likeness",
]
