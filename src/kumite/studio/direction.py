"""The panel's part that directs fighters: by paths that are drawn, and actions that are told."""

from __future__ import annotations

import html
from typing import Any

import viser

from kumite.control.routes import through
from kumite.errors import KumiteError
from kumite.scene.stage import Directed, Order, Stage
from kumite.studio.doors import Safely, within
from kumite.studio.paths import Sketch
from kumite.studio.sliders import Director

DRAW, FINISH, CLEAR = "Draw path", "Finish", "Clear"
LONGEST = 3600.0  # s that a drawn path may take
TICK = "✓ "
ORDER_NAMES = {
    "wanted": ("A⁺ wanted", "kinds and labels that score; choose one to add or take away"),
    "unwanted": ("A⁻ unwanted", "kinds and labels that cost; choose one to add or take away"),
    "only": ("May do", "nothing else is done where these are possible; none chosen: all"),
}


class Direction:
    """The drawing of a path and lists of actions, for the fighter chosen."""

    def __init__(
        self,
        gui: viser.GuiApi,
        stage: Stage,
        directed: Directed,
        sketch: Sketch,
        director: Director,
        safely: Safely,
    ) -> None:
        """sketch: the page's own path in the making."""
        self._stage, self._directed, self._sketch = stage, directed, sketch
        self._director, self._safely = director, safely
        self._who = directed.directed[0]
        self.folder = gui.add_folder("Direction")
        with self.folder:
            self._seconds = gui.add_number(
                "Seconds",
                0.0,
                min=0.0,
                max=LONGEST,
                step=1.0,
                hint="for a path that is drawn; 0: no times",
            )
            path = gui.add_button_group("Path", (DRAW, FINISH, CLEAR))
            path.on_click(safely(self._draw))
            self._text = gui.add_html("")
            with gui.add_folder("Actions", expand_by_default=False):
                self._orders = {f: self._add_order(gui, f) for f in ORDER_NAMES}
        self.show()

    def choose(self, who: int) -> None:
        """Direct another character."""
        self.folder.visible = who in self._directed.directed
        if self.folder.visible:
            self._who = who
            self._refresh()

    def _refresh(self) -> None:
        for order in self._directed.orders_of(self._who):
            self._list(order)
        self.show()

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

    def _order(self, field: str) -> Order:
        return next(o for o in self._directed.orders_of(self._who) if o.field == field)

    def _toggle(self, field: str, name: str) -> None:
        order = self._order(field)
        without = tuple(n for n in order.value if n != name)
        order.set(without if name in order.value else (*without, name))

    def _list(self, order: Order) -> None:
        dropdown, options = self._orders[order.field], _options(order)
        if dropdown.options != options:
            dropdown.options = options
        dropdown.value = options[0]

    # Paths ---------------------------------------------------------------------------------------

    def _draw(self, event: Any) -> None:
        pressed = event.target.value
        if pressed == DRAW:
            self._director.direct(lambda: self._sketch.begin(self._who))
        elif pressed == FINISH:
            seconds = within("seconds", self._seconds.value, 0.0, LONGEST) or None
            self._director.direct(lambda: self._set_route(seconds))
        else:
            self._director.direct(self._clear)
        self.show()

    def _set_route(self, seconds: float | None) -> None:
        """Errors: nothing has been drawn; the drawing goes on then."""
        stage, who = self._stage, self._sketch.who
        if who is None:
            raise KumiteError(f"no path is being drawn; expected {DRAW!r} first")
        x, _, z = stage.root_position[who]
        route = through(self._sketch.places, seconds, start=(float(x), float(z)))
        self._directed.set_route(stage.names[who], route)
        self._sketch.end()

    def _clear(self) -> None:
        self._sketch.end()
        self._directed.set_route(self._stage.names[self._who], None)

    def show(self) -> None:
        """Say how far the fighter's path is, and what has no effect."""
        said = html.escape(self._state())
        content = f'<div style="padding:0 1em .5em;font-size:.85em;opacity:.75">{said}</div>'
        if self._text.content != content:
            self._text.content = content

    def _state(self) -> str:
        who = self._sketch.who
        if who is not None:
            name, count = self._stage.names[who], len(self._sketch.places)
            return f"{name}: click on the floor; {count} check points"
        progress = self._directed.progress[self._who]
        if progress is None:
            return "no path"
        count = len(progress.route)
        said = "all done" if progress.done else f"next {progress.index + 1}"
        return f"{count} check points, {said}; drag to move"


def _options(order: Order) -> tuple[str, ...]:
    """What a list offers: first what holds now, then what is told already, then the others."""
    held = order.value
    now = f"{len(held)}: {', '.join(held)}" if held else "—"
    return (now, *(TICK + n for n in held), *(n for n in order.options if n not in held))
