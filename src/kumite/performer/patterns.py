"""Step patterns that the tables share: which foot goes first, and when."""

from __future__ import annotations

from kumite.performer.moves import Step

LEAD = (Step("left", 0.04, 0.28), Step("right", 0.34, 0.58, 0.055))  # the rear foot follows
FORWARD = (Step("left", 0.05, 0.32), Step("right", 0.32, 0.58, 0.06))
BACK = (Step("right", 0.05, 0.33, 0.06), Step("left", 0.30, 0.59, 0.07))
LEFTWARD = (Step("left", 0.05, 0.32), Step("right", 0.33, 0.60, 0.06))
RIGHTWARD = (Step("right", 0.05, 0.31, 0.07), Step("left", 0.30, 0.58))
PIVOT = (Step("left", 0.04, 0.26, 0.075), Step("right", 0.24, 0.53, 0.06))
SHUFFLE = (Step("left", 0.04, 0.24, 0.075),)  # on the spot: weight off the lead foot for a moment
