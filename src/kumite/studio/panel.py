"""The panel at the side: what can be pressed, set and read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, Protocol, runtime_checkable

import viser

from kumite.scene.actions import ActionPlayback
from kumite.scene.world import World
from kumite.studio.action_list import ActionList
from kumite.studio.coming import Banner, Coming
from kumite.studio.direction import Direction, Director
from kumite.studio.dodging import Dodging, Thrower
from kumite.studio.doors import LARGEST_SEED, safely, within
from kumite.studio.leading import Leader
from kumite.studio.paths import Sketch
from kumite.studio.reference import Prepared
from kumite.studio.throwing import Throws
from kumite.studio.volumes import Volumes
from kumite.studio.walking import Walking
from kumite.studio.wording import EventLog, lines_html, score_html

SLOWEST, FASTEST = 0.1, 4.0
TIME_STEP = 0.01  # s
WIDTH = 330.0  # px


@runtime_checkable
class Control(Protocol):
    """Something of a stage that can be tuned while it runs."""

    name: str
    minimum: float
    maximum: float
    value: float

    def set(self, value: float) -> None:
        """Use ``value`` from the next frame on."""
        ...


class Desk(Director, Thrower, Protocol):
    """What the panel's buttons reach; every call is safe from any thread."""

    def toggle(self) -> None:
        """Play or pause."""
        ...

    def step_once(self) -> None:
        """Pause and move on one frame."""
        ...

    def restart(self, seed: int | None = None) -> None:
        """From the start, with another seed or the same."""
        ...

    def seek(self, frame: int) -> None:
        """Jump within a recording."""
        ...

    def choose(self, action: int) -> None:
        """Play an action of a library."""
        ...

    def set_speed(self, speed: float) -> None:
        """Seconds of the scene in a second."""
        ...

    def set_follow(self, on: bool) -> None:
        """Keep the fighters in the middle, or let them walk."""
        ...

    def show_decisions(self, on: bool) -> None:
        """List decisions among the events."""
        ...

    def tune(self, control: Control, value: float) -> None:
        """Set a control of the stage."""
        ...


class Panel:
    """Controls, score and events on the right of the page."""

    def __init__(
        self,
        server: viser.ViserServer,
        desk: Desk,
        *,
        title: str,
        seed: int,
        frames: int | None,
        fps: float,
        controls: Sequence[Control],
        actions: ActionPlayback | None = None,
        fight: World | None = None,
        sketch: Sketch | None = None,
        throws: Throws | None = None,
        volumes: Volumes | None = None,
        leader: Leader | None = None,
        prepared: Prepared | None = None,
        coming: Coming | None = None,
    ) -> None:
        self._fps = fps
        self._shown: dict[str, Any] = {}
        gui = server.gui
        gui.configure_theme(
            dark_mode=True,
            show_logo=False,
            show_share_button=False,
            brand_color=(214, 48, 49),
            control_width="medium",
        )
        gui.set_panel_label(f"Kumite · {title}")
        gui.main_panel.dock_right()
        gui.main_panel.set_width(WIDTH)

        self._banner = None if coming is None else Banner(gui, coming, title)
        self._play = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE, hint="space")
        self._play.on_click(safely(lambda _: desk.toggle()))
        more = gui.add_button_group("", ("Step", "Restart"), hint="N: one frame on · R: restart")
        more.on_click(
            safely(lambda e: desk.step_once() if e.target.value == "Step" else desk.restart())
        )
        speed = gui.add_slider("Speed", SLOWEST, FASTEST, step=0.1, initial_value=1.0)
        speed.on_update(safely(lambda e: desk.set_speed(e.target.value)))
        self._timeline: viser.GuiSliderHandle[float] | None = None
        if frames is None:
            number = gui.add_number(
                "Seed", seed, min=0, max=max(seed, LARGEST_SEED), step=1, hint="restarts"
            )
            number.on_update(safely(lambda e: desk.restart(int(e.target.value))))
        else:
            last = _last(frames, fps)
            self._timeline = gui.add_slider("Time", 0.0, last, step=TIME_STEP, initial_value=0.0)
            self._timeline.on_update(safely(lambda e: _seek(desk, e, fps)))
        follow = gui.add_checkbox("Follow", True, hint="keep the fighters in the middle")
        follow.on_update(safely(lambda e: desk.set_follow(e.target.value)))
        self._clock = gui.add_html("")
        self._dodging: Dodging | None = None
        if throws is not None and volumes is not None:
            self._dodging = Dodging(server, throws, volumes, desk, safely)
        self._walking: Walking | None = None
        if leader is not None and prepared is not None:
            self._walking = Walking(server, leader, prepared, desk, safely)
        self._direction: Direction | None = None
        if fight is not None and sketch is not None:
            with gui.add_folder("Direction"):
                self._direction = Direction(server, fight, sketch, desk, safely)
        elif controls:
            with gui.add_folder("Parameters", expand_by_default=throws is None):
                for control in controls:
                    _add_control(gui, desk, control)
        self._score = None
        if actions is not None:
            with gui.add_folder("Actions"):
                listed = ActionList(gui, actions, desk.choose)
                listed.listen(safely)
            _add_keys(gui, _moves(listed))
        else:
            with gui.add_folder("Score"):
                self._score = gui.add_html("")
        with gui.add_folder("Events"):
            self._lines = gui.add_html("")
            if actions is None:
                decisions = gui.add_checkbox("Decisions", False, hint="list every decision as well")
                decisions.on_update(safely(lambda e: desk.show_decisions(e.target.value)))
        _add_keys(gui, _runs(desk))

    def look_out(self) -> bool:
        """Say how far what is coming is; whether that has changed."""
        return self._banner is not None and self._banner.show()

    def set_length(self, frames: int) -> None:
        """Another recording is played, from its start."""
        if self._timeline is not None:
            self._shown["frame"] = 0
            self._timeline.value = 0.0
            self._timeline.max = _last(frames, self._fps)

    def playing(self, playing: bool) -> None:
        """Label the button for what it does next."""
        if self._shown.get("playing") != playing:
            self._shown["playing"] = playing
            self._play.label = "Pause" if playing else "Play"
            self._play.icon = viser.Icon.PLAYER_PAUSE if playing else viser.Icon.PLAYER_PLAY

    def show(self, log: EventLog, frame: int, note: str) -> None:
        """Bring time, score and events up to date; what has not changed is not sent."""
        if self._timeline is not None and self._shown.get("frame") != frame:
            self._shown["frame"] = frame
            self._timeline.value = min(round(frame / self._fps, 2), self._timeline.max)
        clock = (
            '<div style="padding:0 1em .5em;font-size:.85em;opacity:.75">'
            f"{frame / self._fps:.1f} s{note}</div>"
        )
        if self._direction is not None:
            self._direction.show()
        if self._dodging is not None:
            self._dodging.show()
        if self._walking is not None:
            self._walking.show()
        for name, handle, content in (
            ("clock", self._clock, clock),
            ("score", self._score, score_html(log)),
            ("lines", self._lines, lines_html(log, self._fps)),
        ):
            if handle is not None and self._shown.get(name) != content:
                self._shown[name] = content
                handle.content = content


def _last(frames: int, fps: float) -> float:
    """The end [s] of a slider over frames: never its start."""
    return max(round((frames - 1) / fps, 2), TIME_STEP)


def _seek(desk: Desk, event: Any, fps: float) -> None:
    # The studio moves the slider too; only a person's move is a wish.
    if event.client is not None:
        desk.seek(round(within("time", event.target.value, 0.0, event.target.max) * fps))


def _add_control(gui: viser.GuiApi, desk: Desk, control: Control) -> None:
    span = control.maximum - control.minimum
    slider = gui.add_slider(
        control.name,
        control.minimum,
        control.maximum,
        step=getattr(control, "step", span / 100 if span > 0 else 1.0),
        initial_value=control.value,
    )
    slider.on_update(safely(lambda e: desk.tune(control, float(e.target.value))))


Keys = tuple[tuple[str, Any, Callable[[], None]], ...]


def _runs(desk: Desk) -> Keys:
    return (
        ("Play or pause", "space", desk.toggle),
        ("One frame on", "N", desk.step_once),
        ("Restart", "R", desk.restart),
    )


def _moves(listed: ActionList) -> Keys:
    return (
        ("Next action", "F", lambda: listed.move(1)),
        ("Previous action", "B", lambda: listed.move(-1)),
    )


def _add_keys(gui: viser.GuiApi, keys: Keys) -> None:
    for label, key, act in keys:
        gui.add_command(label, hotkey=key).on_trigger(safely(lambda _, act=act: act()))
