"""The panel's part for scenes in which balls are thrown: by hand or not, and what is seen of it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import viser

from kumite.studio.doors import Safely, a_place, a_way
from kumite.studio.throwing import FASTEST, LARGEST, SLOWEST, SMALLEST, Throws
from kumite.studio.volumes import Volumes


class Thrower(Protocol):
    """What the studio does for it; every call is safe from any thread."""

    def direct(self, act: Callable[[], Any]) -> Any:
        """Do something to the stage between two frames, and show it."""
        ...

    def wake(self) -> None:
        """Look at what was asked for."""
        ...

    def from_page(self, point: Any) -> Any:
        """Where a point [3] m of the page's world lies on the stage."""
        ...


class Dodging:
    """Clicks that throw, how they do, and switches for the volumes."""

    def __init__(
        self,
        server: viser.ViserServer,
        throws: Throws,
        volumes: Volumes,
        studio: Thrower,
        safely: Safely,
    ) -> None:
        self._scene, self._throws, self._shown = throws.scene, throws, volumes.shown
        self._studio, scene, shown = studio, throws.scene, volumes.shown
        gui = server.gui
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
            one.on_click(safely(self._one))
            self._stream = gui.add_checkbox(
                "Stream", scene.streams, hint="balls that come by themselves, one after the other"
            )
            self._stream.on_update(safely(self._set_stream))
        with gui.add_folder("Volumes"):
            if len(scene.names) > 1:
                whose = gui.add_dropdown("Of", scene.names, hint="whose volumes are shown")
                whose.on_update(safely(lambda e: self._show(who=scene.names.index(e.target.value))))
            for field, label, hint in (
                ("body", "Body volume", "the spheres that stand for the body"),
                ("attacks", "Attack volume", "attacks under way, all along their paths"),
                ("left", "Avoidance volume", "what the body is about to leave, or has left"),
            ):
                switch = gui.add_checkbox(label, getattr(shown, field), hint=hint)
                switch.on_update(
                    safely(lambda e, field=field: self._show(**{field: e.target.value}))
                )
        server.scene.on_click()(safely(self._click))

    def _click(self, event: viser.SceneClickEvent) -> None:
        way = a_way("click", event.ray_direction)  # the page's world is not turned
        self._throws.click(self._studio.from_page(a_place("click", event.ray_origin)), way)
        self._studio.wake()

    def _one(self, event: Any) -> None:
        self._throws.one()
        self._studio.wake()

    def _set_stream(self, event: Any) -> None:
        if event.client is not None:  # the panel switches it, too
            self._studio.direct(lambda: setattr(self._scene, "streams", bool(event.target.value)))

    def _show(self, **switches: Any) -> None:
        for name, value in switches.items():
            setattr(self._shown, name, value)
        self._studio.wake()

    def show(self) -> None:
        """A stream that has run dry is off."""
        if self._stream.value != self._scene.streams:
            self._stream.value = self._scene.streams
