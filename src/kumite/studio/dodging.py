"""The panel's parts for balls that are thrown, and for what is seen of avoiding them."""

from __future__ import annotations

from typing import Any

import viser

from kumite.studio.doors import Safely
from kumite.studio.sliders import Director
from kumite.studio.throwing import FASTEST, LARGEST, SLOWEST, SMALLEST, Throws
from kumite.studio.volumes import Volumes


class ThrowPanel:
    """How balls are thrown, and whether they come by themselves."""

    def __init__(
        self, gui: viser.GuiApi, throws: Throws, director: Director, safely: Safely
    ) -> None:
        self._throws, self._director = throws, director
        with gui.add_folder("Throw"):
            gui.add_html(
                '<div style="padding:0 1em .5em;font-size:.85em;opacity:.75">'
                "click into the picture to throw a ball there</div>"
            )
            speed = gui.add_slider(
                "Ball speed [m/s]", SLOWEST, FASTEST, step=0.5, initial_value=throws.speed
            )
            speed.on_update(safely(lambda e: throws.set_speed(e.target.value)))
            radius = gui.add_slider(
                "Ball radius [m]", SMALLEST, LARGEST, step=0.01, initial_value=throws.radius
            )
            radius.on_update(safely(lambda e: throws.set_radius(e.target.value)))
            one = gui.add_button("Throw one by itself", hint="from before somebody, at a body part")
            one.on_click(safely(lambda _: director.direct(throws.one)))
            self._stream = gui.add_checkbox(
                "Stream",
                throws.at.streams,
                hint="balls that come by themselves, one after the other",
            )
            self._stream.on_update(safely(self._set_stream))

    def _set_stream(self, event: Any) -> None:
        if event.client is not None:  # the panel switches it, too
            on = bool(event.target.value)
            self._director.direct(lambda: setattr(self._throws.at, "streams", on))

    def show(self) -> None:
        """A stream that has run dry is off."""
        if self._stream.value != self._throws.at.streams:
            self._stream.value = self._throws.at.streams


class VolumesPanel:
    """Switches for the volumes of the character chosen."""

    def __init__(
        self, gui: viser.GuiApi, volumes: Volumes, director: Director, safely: Safely
    ) -> None:
        self._volumes, self._director = volumes, director
        self.folder = gui.add_folder("Volumes", expand_by_default=False)
        with self.folder:
            for field, label, hint in (
                ("body", "Body volume", "the spheres that stand for the body"),
                ("attacks", "Attack volume", "attacks under way, all along their paths"),
                ("left", "Avoidance volume", "what the body is about to leave, or has left"),
            ):
                switch = gui.add_checkbox(label, getattr(volumes.shown, field), hint=hint)
                switch.on_update(
                    safely(lambda e, field=field: self._show(**{field: e.target.value}))
                )

    def choose(self, who: int) -> None:
        """Show another character's."""
        self.folder.visible = who in self._volumes.avoiding.avoiding
        self._show(who=who)

    def _show(self, **switches: Any) -> None:
        def switch() -> None:
            for name, value in switches.items():
                setattr(self._volumes.shown, name, value)

        self._director.direct(switch)
