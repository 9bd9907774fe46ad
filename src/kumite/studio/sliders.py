"""The panel's part with a slider for every number that may be tuned: of one character at a time, by
controller. What others set, in another page or from Python, is shown as well.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import viser

from kumite.control.tuning import Tunable
from kumite.studio.doors import Safely, within

STEPS = 200  # of a slider
EVERYONE = "all"  # whose numbers are those that are nobody's own
TITLES = {
    "tree": "Game tree",
    "policy": "Policies",
    "avoid": "Avoiding",
    "prepare": "Preparing",
    "world": "World",
}


class Director(Protocol):
    """What the studio does for it; every call is safe from any thread."""

    def direct(self, act: Callable[[], Any]) -> Any:
        """Do something to the stage while it stands still, and show it."""
        ...


class Sliders:
    """Sliders of those tunables that are everybody's and of those of one character."""

    def __init__(
        self,
        gui: viser.GuiApi,
        tunables: Callable[[], Sequence[Tunable]],
        director: Director,
        safely: Safely,
    ) -> None:
        """tunables: as they are now; the same names every time."""
        self._gui, self._director, self._safely = gui, director, safely
        self._tunables = tunables
        self.tunables = {t.name: t for t in tunables()}
        self._folders: list[viser.GuiFolderHandle] = []
        self.handles: dict[str, viser.GuiSliderHandle[float]] = {}
        self._box = gui.add_folder("Parameters", expand_by_default=False)
        self.show_of(next((t.who for t in self.tunables.values() if t.who), ""))

    def show_of(self, who: str) -> None:
        """Show one character's, and everybody's."""
        for folder in self._folders:
            folder.remove()
        self._folders, self.handles = [], {}
        groups: dict[tuple[str, str], list[Tunable]] = {}
        for t in self.tunables.values():
            if t.who in ("", who):
                groups.setdefault((t.who, t.controller), []).append(t)
        with self._box:
            for (whose, controller), some in groups.items():
                title = TITLES.get(controller, controller)
                title = f"{title} · {whose}" if whose else title
                folder = self._gui.add_folder(title, expand_by_default=False)
                self._folders.append(folder)
                with folder:
                    for t in some:
                        self.handles[t.name] = self._add(t)

    def _add(self, t: Tunable) -> viser.GuiSliderHandle[float]:
        log = t.scale == "log"
        low, high = (0.0, 1.0) if log else (t.minimum, t.maximum)
        slider = self._gui.add_slider(
            said(t),
            low,
            high,
            step=1.0 if t.whole else (high - low) / STEPS,
            initial_value=_place(t),
            hint=f"{t.help} ({t.key})",
        )

        def tune(event: Any) -> None:
            if event.client is None:  # the panel writes to its sliders, too
                return
            share = within(t.name, event.target.value, low, high)
            value = t.at(share if log else (share - low) / (high - low))
            try:
                self._director.direct(lambda: t.set(value))
            finally:
                self.refresh(besides=slider)

        slider.on_update(self._safely(tune))
        return slider

    def refresh(self, besides: Any = None) -> None:
        """Show what holds now: one may have moved another, or somebody else has."""
        for name, slider in self.handles.items():
            t = self.tunables[name]
            place, label = _place(t), said(t)
            if slider is not besides and abs(slider.value - place) > 1e-6 * (1.0 + abs(place)):
                slider.value = place
            if slider.label != label:
                slider.label = label


def said(t: Tunable) -> str:
    """A tunable with its value and unit: ``taken: 100,000 points/(m/s)``."""
    return f"{t.label}: {round(t.value, 3):,.6g} {t.unit}".rstrip()


def _place(t: Tunable) -> float:
    """Where its slider is: at its value, or at the share of a logarithmic scale."""
    return round(t.share(t.value), 6) if t.scale == "log" else t.value
