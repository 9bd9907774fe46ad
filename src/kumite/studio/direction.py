"""The panel's part that directs fighters of a game tree: weights, actions and paths, of one fighter
at a time.
"""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any, Protocol

import viser

from kumite.control.routes import through
from kumite.errors import KumiteError
from kumite.scene import World
from kumite.scene.controls import OrderControl, StyleControl
from kumite.studio.doors import Safely, a_place, a_way, within
from kumite.studio.paths import Sketch, on_floor

DRAW, FINISH, CLEAR = "Draw path", "Finish", "Clear"
LONGEST = 3600.0  # s that a drawn path may take
TICK = "✓ "
ORDER_NAMES = {
    "wanted": ("A⁺ wanted", "kinds and labels that score; choose one to add or take away"),
    "unwanted": ("A⁻ unwanted", "kinds and labels that cost; choose one to add or take away"),
    "only": ("May do", "nothing else is done where these are possible; none chosen: all"),
}
UNITS = {
    "preferred_distance": "m",
    "preferred_facing": "°",
    "preferred_heading": "°",
}


class Director(Protocol):
    """What the studio does for it; every call is safe from any thread."""

    def direct(self, act: Callable[[], Any]) -> Any:
        """Do something to the stage while it stands still, and show it."""
        ...

    def from_page(self, point: Any) -> Any:
        """Where a point [3] m of the page's world lies on the stage."""
        ...


class Direction:
    """Sliders, lists of actions and the drawing of a path, for the fighter chosen."""

    def __init__(
        self,
        server: viser.ViserServer,
        fight: World,
        sketch: Sketch,
        director: Director,
        safely: Safely,
    ) -> None:
        self._scene, self._fight, self._sketch, self._director = (
            server.scene,
            fight,
            sketch,
            director,
        )
        self._who = 0
        self._safely = safely
        self._on_floor: Any = None  # listens to clicks while a path is drawn
        gui = server.gui
        fighter = gui.add_dropdown("Fighter", fight.names, hint="whose controls are shown")
        fighter.on_update(safely(self._choose))
        with gui.add_folder("Path"):
            self._seconds = gui.add_number(
                "Seconds",
                0.0,
                min=0.0,
                max=LONGEST,
                step=1.0,
                hint="for a path that is drawn; 0: no times",
            )
            path = gui.add_button_group("", (DRAW, FINISH, CLEAR))
            path.on_click(safely(self._draw))
            self._text = gui.add_html("")
        with gui.add_folder("Actions", expand_by_default=False):
            self._orders = {f: self._add_order(gui, f) for f in ORDER_NAMES}
        with gui.add_folder("Weights", expand_by_default=False):
            everyone = [fight.controls_of(k) for k in range(len(fight.names))]
            self._sliders = [self._add_slider(gui, same) for same in zip(*everyone)]
        self.show()

    # Weights -------------------------------------------------------------------------------------

    def _add_slider(
        self, gui: viser.GuiApi, same: tuple[StyleControl, ...]
    ) -> viser.GuiSliderHandle[float]:
        """same: a control of every fighter, of one field."""
        control, field = same[0], same[0].field
        unit = f" [{UNITS[field]}]" if field in UNITS else ""
        slider = gui.add_slider(
            field.replace("_", " ") + unit,
            float(min(c.minimum for c in same)),
            float(max(c.maximum for c in same)),
            step=float(control.step),
            initial_value=control.value,
        )

        def tune(event: Any) -> None:
            if event.client is None:  # the panel writes to its sliders, too
                return
            value = within(field, event.target.value, event.target.min, event.target.max)
            self._director.direct(lambda: self._control(field).set(value))
            self._refresh(besides=slider)

        slider.on_update(self._safely(tune))
        return slider

    def _control(self, field: str) -> StyleControl:
        return next(c for c in self._fight.controls_of(self._who) if c.field == field)

    def _refresh(self, besides: Any = None) -> None:
        """Show the chosen fighter's values: one slider may have moved another."""
        for slider, control in zip(self._sliders, self._fight.controls_of(self._who)):
            if slider is not besides and slider.value != control.value:
                slider.value = control.value
        for order in self._fight.orders_of(self._who):
            self._list(order)
        self.show()

    def _choose(self, event: Any) -> None:
        self._who = self._fight.names.index(event.target.value)
        self._refresh()

    # Actions -------------------------------------------------------------------------------------

    def _add_order(self, gui: viser.GuiApi, field: str) -> viser.GuiDropdownHandle[str]:
        label, hint = ORDER_NAMES[field]
        dropdown = gui.add_dropdown(label, _options(self._order(field)), hint=hint)

        def toggle(event: Any) -> None:
            if event.client is None or event.target.value == event.target.options[0]:
                return
            name = event.target.value.removeprefix(TICK)
            try:
                self._director.direct(lambda: self._toggle(field, name))
            finally:
                self._refresh()

        dropdown.on_update(self._safely(toggle))
        return dropdown

    def _order(self, field: str) -> OrderControl:
        return next(o for o in self._fight.orders_of(self._who) if o.field == field)

    def _toggle(self, field: str, name: str) -> None:
        order = self._order(field)
        without = tuple(n for n in order.value if n != name)
        order.set(without if name in order.value else (*without, name))

    def _list(self, order: OrderControl) -> None:
        dropdown, options = self._orders[order.field], _options(order)
        if dropdown.options != options:
            dropdown.options = options
        dropdown.value = options[0]

    # Paths ---------------------------------------------------------------------------------------

    def _draw(self, event: Any) -> None:
        pressed = event.target.value
        if pressed == DRAW:
            self._director.direct(lambda: self._sketch.begin(self._who))
            self._listen(True)
        elif pressed == FINISH:
            self._finish(event)
        else:
            self._listen(False)
            self._director.direct(self._clear)
        self.show()

    def _listen(self, on: bool) -> None:
        """Take clicks on the floor, or leave them to others."""
        if on and self._on_floor is None:
            self._on_floor = self._scene.on_click()(self._safely(self._add_point))
        elif not on and self._on_floor is not None:
            self._scene.remove_click_callback(self._on_floor)
            self._on_floor = None

    def _add_point(self, event: Any) -> None:
        origin = self._director.from_page(a_place("click", event.ray_origin))
        place = on_floor(origin, a_way("click", event.ray_direction))
        if place is not None:
            self._director.direct(lambda: self._sketch.add(place))
            self.show()

    def _finish(self, event: Any) -> None:
        seconds = within("seconds", self._seconds.value, 0.0, LONGEST) or None
        self._director.direct(lambda: self._set_route(seconds))
        self._listen(False)
        self._refresh()

    def _set_route(self, seconds: float | None) -> None:
        """Errors: nothing has been drawn; the drawing goes on then."""
        fight, who = self._fight, self._sketch.who
        if who is None:
            raise KumiteError(f"no path is being drawn; expected {DRAW!r} first")
        x, _, z = fight.root_position[who]
        fight.set_route(
            fight.names[who], through(self._sketch.places, seconds, start=(float(x), float(z)))
        )
        self._sketch.end()

    def _clear(self) -> None:
        self._sketch.end()
        self._fight.set_route(self._fight.names[self._who], None)

    def show(self) -> None:
        """Say how far the fighter's path is, and what has no effect."""
        said = html.escape(self._state())
        content = f'<div style="padding:0 1em .5em;font-size:.85em;opacity:.75">{said}</div>'
        if self._text.content != content:
            self._text.content = content

    def _state(self) -> str:
        fight, who = self._fight, self._sketch.who
        if who is not None:
            return (
                f"{fight.names[who]}: click on the floor; {len(self._sketch.places)} check points"
            )
        progress = fight.progress[self._who]
        if progress is None:
            return "no path"
        count = len(progress.route)
        said = "all done" if progress.done else f"next {progress.index + 1}"
        return f"{count} check points, {said}; drag to move"


def _options(order: OrderControl) -> tuple[str, ...]:
    """What a list offers: first what holds now, then what is told already, then the others."""
    held = order.value
    now = f"{len(held)}: {', '.join(held)}" if held else "—"
    return (now, *(TICK + n for n in held), *(n for n in order.options if n not in held))
