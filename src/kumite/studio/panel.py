"""The panel at the side: what can be pressed, set and read."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

import viser

from kumite.scene.stage import Offers, Stage
from kumite.studio.action_list import ActionList
from kumite.studio.coming import Banner, Coming
from kumite.studio.direction import Direction
from kumite.studio.dodging import ThrowPanel, VolumesPanel
from kumite.studio.doors import LARGEST_SEED, safely, within
from kumite.studio.leading import Leader
from kumite.studio.paths import Sketch
from kumite.studio.reference import Prepared
from kumite.studio.ring import Follow
from kumite.studio.sliders import Director, Sliders
from kumite.studio.throwing import Throws
from kumite.studio.volumes import Volumes
from kumite.studio.walking import Walking
from kumite.studio.wording import EventLog, lines_html, score_html

SLOWEST, FASTEST = 0.1, 4.0
TIME_STEP = 0.01  # s
WIDTH = 330.0  # px
SENDS, THROWS = "sends", "throws"  # what a click does where it may do either


def prepare(gui: viser.GuiApi, title: str) -> None:
    """How the panels of all pages look."""
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


class Desk(Director, Protocol):
    """What the panel's buttons reach; every call is safe from any thread."""

    def wake(self) -> None:
        """Look at what waits, and draw anew."""
        ...

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

    @property
    def speed(self) -> float:
        """Seconds of the scene in a second."""
        ...

    def set_speed(self, speed: float) -> None:
        """Another speed."""
        ...


class Own:
    """What belongs to one page: what it follows, draws, throws, leads and looks at."""

    def __init__(
        self,
        follow: Follow,
        throws: Throws | None = None,
        volumes: Volumes | None = None,
        leader: Leader | None = None,
        prepared: Prepared | None = None,
    ) -> None:
        self.follow, self.sketch = follow, Sketch()
        self.throws, self.volumes = throws, volumes
        self.leader, self.prepared = leader, prepared
        self.sends = leader is not None  # a click sends somebody; otherwise it throws
        self.decisions = False  # listed among the events


class Panel:
    """Controls, score and events on the right of a page; a part for each thing a stage offers."""

    def __init__(
        self,
        gui: viser.GuiApi,
        desk: Desk,
        own: Own,
        stage: Stage,
        offers: Offers,
        coming: Coming | None,
        eye: Callable[[Any], Any],
    ) -> None:
        """own: the page's. eye: where the camera [3] of an event's page is on the stage."""
        self._fps, self._own = stage.fps, own
        self._shown: dict[str, Any] = {}
        self._banner = None if coming is None else Banner(gui, coming, stage.title)
        self._play = gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE, hint="space")
        self._play.on_click(safely(lambda _: desk.toggle()))
        more = gui.add_button_group("", ("Step", "Restart"), hint="N: one frame on · R: restart")
        more.on_click(
            safely(lambda e: desk.step_once() if e.target.value == "Step" else desk.restart())
        )
        self._speed = gui.add_slider("Speed", SLOWEST, FASTEST, step=0.1, initial_value=desk.speed)
        self._speed.on_update(safely(lambda e: _by_hand(e, desk.set_speed)))
        self._timeline: viser.GuiSliderHandle[float] | None = None
        self._seed: viser.GuiNumberHandle[int] | None = None
        if offers.played is None:
            most = max(stage.seed, LARGEST_SEED)
            self._seed = gui.add_number(
                "Seed", stage.seed, min=0, max=most, step=1, hint="restarts"
            )
            self._seed.on_update(safely(lambda e: _by_hand(e, lambda n: desk.restart(int(n)))))
        else:
            last = _last(len(offers.played.recording), stage.fps)
            self._timeline = gui.add_slider("Time", 0.0, last, step=TIME_STEP, initial_value=0.0)
            self._timeline.on_update(safely(lambda e: _seek(desk, e, stage.fps)))
        follow = gui.add_checkbox("Follow", own.follow.on, hint="keep the fighters in the middle")
        follow.on_update(safely(lambda e: desk.direct(lambda: _set(own.follow, "on", e))))
        self._clock = gui.add_html("")
        self._throwing = self._volumes = self._walking = self._direction = self._sliders = None
        # A panel for each thing that the stage offers.
        some = _named(stage, offers)
        if len(some) > 1:
            who = gui.add_dropdown("Character", some, hint="who is directed, and shown below")
            who.on_update(safely(lambda e: self._choose(e.target.value, stage)))
        if own.leader is not None and own.throws is not None:
            click = gui.add_dropdown("A click", (SENDS, THROWS), hint="into the picture")
            click.on_update(safely(lambda e: setattr(own, "sends", e.target.value == SENDS)))
        if own.throws is not None:
            self._throwing = ThrowPanel(gui, own.throws, desk, safely)
        if own.volumes is not None:
            self._volumes = VolumesPanel(gui, own.volumes, desk, safely)
        if own.leader is not None and own.prepared is not None:
            self._walking = Walking(gui, own.leader, own.prepared, desk, safely, eye)
        if offers.directed is not None:
            self._direction = Direction(gui, stage, offers.directed, own.sketch, desk, safely)
        if offers.tunables:
            self._sliders = Sliders(gui, lambda: offers.tunables, desk, safely)
        if some:
            self._choose(some[0], stage)
        self._score = None
        if offers.listed is not None:
            with gui.add_folder("Actions"):
                listed = ActionList(gui, offers.listed, desk.choose)
                listed.listen(safely)
            _add_keys(gui, _moves(listed))
        else:
            with gui.add_folder("Score"):
                self._score = gui.add_html("")
        with gui.add_folder("Events"):
            self._lines = gui.add_html("")
            if offers.listed is None:
                decisions = gui.add_checkbox("Decisions", False, hint="list every decision as well")
                decisions.on_update(
                    safely(lambda e: desk.direct(lambda: _set(own, "decisions", e)))
                )
        _add_keys(gui, _runs(desk))

    def _choose(self, name: str, stage: Stage) -> None:
        k = stage.names.index(name)
        for part in (self._direction, self._walking, self._volumes):
            if part is not None:
                part.choose(k)
        if self._sliders is not None:
            self._sliders.show_of(name)

    def look_out(self) -> bool:
        """Say how far what is coming is; whether that has changed."""
        return self._banner is not None and self._banner.show()

    def set_length(self, frames: int) -> None:
        """Another recording is played, from its start."""
        if self._timeline is not None:
            self._shown["frame"] = 0
            self._timeline.value = 0.0
            self._timeline.max = _last(frames, self._fps)

    def playing(self, playing: bool, speed: float, seed: int) -> None:
        """Label the button for what it does next; other pages may have set the speed and seed."""
        # Only what has changed: what a hand has just moved is not taken back before it is heard.
        if self._shown.get("speed") != speed:
            self._shown["speed"] = self._speed.value = speed
        if self._seed is not None and self._shown.get("seed") != seed:
            self._shown["seed"] = self._seed.value = seed
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
        if self._throwing is not None:
            self._throwing.show()
        if self._sliders is not None:
            self._sliders.refresh()
        if self._walking is not None:
            self._walking.show()
        for name, handle, content in (
            ("clock", self._clock, clock),
            ("score", self._score, score_html(log)),
            ("lines", self._lines, lines_html(log, self._fps, self._own.decisions)),
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


def _by_hand(event: Any, act: Callable[[float], Any]) -> None:
    """The panel sets its controls, too; only a person's move is a wish."""
    if event.client is not None:
        act(event.target.value)


def _set(holder: Any, name: str, event: Any) -> None:
    setattr(holder, name, bool(event.target.value))


def _named(stage: Stage, offers: Offers) -> tuple[str, ...]:
    """Those of whom something can be chosen."""
    found = {t.who for t in offers.tunables if t.who}
    some = [] if offers.directed is None else [*offers.directed.directed]
    some += [] if offers.led is None else [*offers.led.led]
    some += [] if offers.avoiding is None else [*offers.avoiding.avoiding]
    found |= {stage.names[k] for k in some}
    return tuple(name for name in stage.names if name in found)


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
