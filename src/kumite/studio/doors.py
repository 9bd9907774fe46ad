"""The doors between the page and the stage: what comes in is finite and within bounds, and what
cannot be done is told to the page instead of the terminal.
"""

from __future__ import annotations

import logging
import math
import traceback
from collections.abc import Callable
from typing import Any

import numpy as np

from kumite.errors import KumiteError

REACH = 1000.0  # m from the middle of the floor that anything is put or pointed at
LARGEST_SEED = 2**53  # that a page's numbers hold exactly

Act = Callable[[Any], None]
Safely = Callable[[Act], Act]
log = logging.getLogger("kumite.studio")
_told: set[tuple[str, int]] = set()  # where in our code something has gone wrong


def within(what: str, value: Any, low: float, high: float) -> float:
    """A finite number, brought to ``low`` to ``high``. Errors: it is none."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise KumiteError(f"{what}: expected a finite number")
    return float(min(max(value, low), high))


def a_seed(value: Any) -> int:
    """A whole number from 0 on. Errors: it is none."""
    if isinstance(value, bool) or not isinstance(value, int) or not value >= 0:
        raise KumiteError("seed: expected a whole number from 0 on")
    return value


def a_place(what: str, point: Any) -> np.ndarray:
    """A point [3] m in reach. Errors: it is none."""
    place = np.asarray(point, dtype=np.float64)
    if place.shape != (3,) or not np.all(np.abs(place) <= REACH):  # NaN is not within it, either
        raise KumiteError(f"{what}: expected three numbers of at most {REACH:.0f} m")
    return place


def a_way(what: str, direction: Any) -> np.ndarray:
    """A direction [3] of length 1. Errors: it is none."""
    way = np.asarray(direction, dtype=np.float64)
    length = float(np.linalg.norm(way)) if way.shape == (3,) else 0.0
    if not 1e-9 < length < math.inf:
        raise KumiteError(f"{what}: expected a direction of three numbers")
    return way / length


def safely(act: Act) -> Act:
    """Tell the page what could not be done. A fault of ours is logged once, not at every click."""

    def callback(event: Any) -> None:
        try:
            act(event)
        except KumiteError as error:
            client = getattr(event, "client", None)
            if client is not None:
                client.add_notification("Not possible", str(error), color="red")
        except Exception as error:
            last = traceback.extract_tb(error.__traceback__)[-1]
            where = last.filename, last.lineno or 0
            if where not in _told:
                _told.add(where)
                log.exception("studio: a control of the page failed")

    return callback
