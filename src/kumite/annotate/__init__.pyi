from kumite.annotate.action_file import (
    Marked,
    read_actions,
    read_avoidance,
    read_marked,
    write_actions,
)
from kumite.annotate.actions import (
    Actions,
    ActionSettings,
    find_actions,
    shorter_rests,
)
from kumite.annotate.avoidance import (
    AvoidanceParts,
    AvoidanceSettings,
    find_avoidance,
    no_avoidance,
)
from kumite.annotate.balance import Balance, centre_of_mass, find_balance
from kumite.annotate.contacts import Contacts, find_contacts
from kumite.annotate.cycles import Cycles, CycleSettings, find_cycles, hand_cycles, labelled_frames
from kumite.annotate.likeness import Likeness, measure_likeness
from kumite.annotate.reference import Reference, find_mark, find_reference
from kumite.annotate.strikes import Strikes, find_strikes, only_blows
from kumite.annotate.vocabulary import DIRECTIONS, DIRECTIONS_OF, KINDS, NO_LIMB

__all__ = [
    "DIRECTIONS",
    "DIRECTIONS_OF",
    "KINDS",
    "NO_LIMB",
    "ActionSettings",
    "Actions",
    "AvoidanceParts",
    "AvoidanceSettings",
    "Balance",
    "Contacts",
    "CycleSettings",
    "Cycles",
    "Likeness",
    "Marked",
    "Reference",
    "Strikes",
    "centre_of_mass",
    "find_actions",
    "find_avoidance",
    "find_balance",
    "find_contacts",
    "find_cycles",
    "find_mark",
    "find_reference",
    "find_strikes",
    "hand_cycles",
    "labelled_frames",
    "measure_likeness",
    "no_avoidance",
    "only_blows",
    "read_actions",
    "read_avoidance",
    "read_marked",
    "shorter_rests",
    "write_actions",
]
