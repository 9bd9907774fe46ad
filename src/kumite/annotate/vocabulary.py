"""What actions are called: their kinds, and the ways of each."""

from __future__ import annotations

KINDS = ("attack", "defence", "transition", "reaction", "idle")
NO_LIMB = -1
"""The limb of an action in which none strikes. A sword strikes with the hand that holds it: its
direction is slash or thrust."""
DIRECTIONS_OF = {
    "attack": ("straight", "hook", "uppercut", "kick", "slash", "thrust"),
    "defence": ("duck", "slip", "sway", "block", "jump back"),
    "transition": ("forward", "back", "left", "right", "turn left", "turn right", "up"),
    "reaction": ("hit", "fall"),
    "idle": ("none",),
}
"""The ways of each kind."""
DIRECTIONS = tuple(way for ways in DIRECTIONS_OF.values() for way in ways)
