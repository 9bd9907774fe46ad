"""What happens in the clips: foot contacts, effective hits and actions, found without hand work;
and how like a person they move.
"""

from kumite.annotate.action_file import read_actions, write_actions
from kumite.annotate.actions import (
    DIRECTIONS,
    DIRECTIONS_OF,
    KINDS,
    NO_LIMB,
    Actions,
    ActionSettings,
    find_actions,
)
from kumite.annotate.contacts import Contacts, find_contacts
from kumite.annotate.likeness import Likeness, measure_likeness
from kumite.annotate.strikes import Strikes, find_strikes

__all__ = [
    "DIRECTIONS",
    "DIRECTIONS_OF",
    "KINDS",
    "NO_LIMB",
    "ActionSettings",
    "Actions",
    "Contacts",
    "Likeness",
    "Strikes",
    "find_actions",
    "find_contacts",
    "find_strikes",
    "measure_likeness",
    "read_actions",
    "write_actions",
]
