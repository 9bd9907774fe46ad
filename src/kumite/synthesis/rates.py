"""How fast clips may be played."""

SLOWEST, FASTEST = 0.25, 4.0  # library frames per shown frame
