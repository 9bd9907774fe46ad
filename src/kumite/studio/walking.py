"""The panel's part for people who prepare: who is led, by what, and what is seen of it."""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any, cast

import numpy as np
import viser

from kumite.scene.stage import Preparation
from kumite.studio.doors import Safely, a_place, a_way
from kumite.studio.leading import DOWN, LEFT, RIGHT, UP, Leader
from kumite.studio.reference import Prepared
from kumite.studio.sliders import Director

DIGITS = "123456789"  # hot keys of target motions
BY_ITSELF = "B"
KEYS = {UP: ("arrowup", "I"), LEFT: ("arrowleft", "J"), DOWN: ("arrowdown", "K")} | {
    RIGHT: ("arrowright", "L")
}
WORDS = {UP: "up", LEFT: "left", DOWN: "down", RIGHT: "right"}
# The viewer turns its camera by the arrow keys as well, and cannot be told not to. It listens at
# the document, hot keys one node below: there an event that has been heard is stopped. And a box
# that was ticked keeps all keys to itself until it is left.
KEYS_ARE_OURS = (
    '<img src="data:," hidden onerror="'
    "if(!window.kumiteKeys){window.kumiteKeys=true;var root=document.documentElement;"
    "root.addEventListener('keydown',function(e)"
    "{if(e.code.indexOf('Arrow')===0)e.stopPropagation()});"
    "root.addEventListener('change',function(e)"
    "{if(e.target.type==='checkbox')e.target.blur()})}"
    '">'
)


class Walking:
    """Clicks and keys that send somebody, motions that it does, switches for what it prepares."""

    def __init__(
        self,
        gui: viser.GuiApi,
        leader: Leader,
        prepared: Prepared,
        director: Director,
        safely: Safely,
        eye: Callable[[Any], np.ndarray],
    ) -> None:
        """eye: where the camera [3] of an event's page is on the stage."""
        self._leader, self._prepared, self._director = leader, prepared, director
        self._eye, walk = eye, leader.walk
        self._walk = gui.add_folder("Walk")
        with self._walk:
            gui.add_html(
                '<div style="padding:0 1em .5em;font-size:.85em;opacity:.75">click the floor or '
                f"a thing; arrows or I J K L{KEYS_ARE_OURS}</div>"
            )
            ways = gui.add_button_group("", tuple(KEYS), hint="a few steps, as seen from here")
            ways.on_click(safely(lambda e: self._press(e, e.target.value)))
            keyed = {_keyed(n, m): m for n, m in enumerate(walk.motions)}
            motions = gui.add_button_group("Do", tuple(keyed), hint="and hot keys 1 to 9")
            motions.on_click(safely(lambda e: self._do(e, keyed[e.target.value])))
            self._automatic = gui.add_checkbox(
                "By itself",
                walk.automatic,
                hint="goes, and begins its motions, without you; where you send it, it goes first",
            )
            self._automatic.on_update(safely(self._set_automatic))
        self._preparation = gui.add_folder("Preparation")
        with self._preparation:
            self._text = gui.add_html("")
            for field, label, hint in (
                ("goal", "Goal", "where it goes"),
                ("posture", "Reference posture", "what it prepares for, where that is begun"),
                ("support", "Support and balance", "of that posture, with its centre of mass"),
            ):
                switch = gui.add_checkbox(label, getattr(prepared.asked, field), hint=hint)
                switch.on_update(
                    safely(lambda e, field=field: self._ask(**{field: e.target.value}))
                )
        self._add_keys(gui, safely)

    def _add_keys(self, gui: viser.GuiApi, safely: Safely) -> None:
        def command(label: str, key: str, act: Callable[[Any], None]) -> None:
            gui.add_command(label, hotkey=cast(Any, key)).on_trigger(safely(act))

        for way, keys in KEYS.items():
            for key in keys:
                command(f"Walk {WORDS[way]} ({key})", key, lambda e, way=way: self._press(e, way))
        for digit, motion in zip(DIGITS, self._leader.walk.motions):
            command(_words(motion), digit, lambda e, motion=motion: self._do(e, motion))
        command("By itself or by hand", BY_ITSELF, lambda _: self._turn_automatic())

    def choose(self, who: int) -> None:
        """Lead another character."""
        led = self._leader.walk.led
        self._walk.visible = self._preparation.visible = who in led
        if who in led:

            def lead() -> None:
                self._leader.who = self._prepared.asked.who = led.index(who)

            self._director.direct(lead)

    def _ask(self, **switches: bool) -> None:
        def ask() -> None:
            for name, value in switches.items():
                setattr(self._prepared.asked, name, value)

        self._director.direct(ask)

    def _press(self, event: Any, way: str) -> None:
        if event.client is None:
            return
        camera, eye = event.client.camera, self._eye(event)
        at = eye + a_place("camera", camera.look_at) - a_place("camera", camera.position)
        up = a_way("camera", camera.up_direction)
        self._director.direct(lambda: self._leader.press(eye, at, up, way))

    def _do(self, event: Any, motion: str) -> None:
        busy = self._director.direct(lambda: self._leader.trigger(motion))
        if busy is not None and event.client is not None:
            said = f"{self._leader.name} does {_words(busy)}; then it can be told to do another"
            event.client.add_notification("Busy", said, auto_close_seconds=2.0)

    def _set_automatic(self, event: Any) -> None:
        if event.client is not None:  # the panel switches it, too
            value = bool(event.target.value)
            self._director.direct(lambda: setattr(self._leader.walk, "automatic", value))

    def _turn_automatic(self) -> None:
        walk = self._leader.walk
        self._director.direct(lambda: setattr(walk, "automatic", not walk.automatic))

    def show(self) -> None:
        """Under the lock: how far it is prepared, and for what."""
        if self._automatic.value != self._leader.walk.automatic:
            self._automatic.value = self._leader.walk.automatic
        content = self._state_html(self._prepared.state())
        if self._text.content != content:
            self._text.content = content

    def _state_html(self, state: Preparation) -> str:
        hand = " (sent by you)" if self._leader.led else ""
        if state.does is not None:
            said = f"{self._leader.name} does {_words(state.does)}"
        elif state.away is not None:
            said = f"{self._leader.name} goes {state.away:.1f} m{hand}"
        else:
            said = f"{self._leader.name} stays"
        what = "nothing"
        if state.prepares is not None:
            about = self._leader.walk.reference(state.prepares).about
            what = f"{_words(state.prepares)}: {about}"
        lines = "".join(f"<div>{html.escape(x)}</div>" for x in (said, f"prepares for {what}"))
        bars = _bar("level", state.shown) + _bar("chosen", state.chosen)
        return f'<div style="padding:0 1em .5em;font-size:.85em">{lines}{bars}</div>'


def _bar(label: str, level: float) -> str:
    return (
        '<div style="display:flex;align-items:center;gap:.5em">'
        f'<span style="width:4em;opacity:.75">{label}</span>'
        '<span style="flex:1;height:.6em;border-radius:.3em;background:rgba(128,128,128,.3)">'
        f'<span style="display:block;height:100%;width:{100 * level:.0f}%;border-radius:.3em;'
        f'background:#4da3ff"></span></span><span>{level:.2f}</span></div>'
    )


def _words(label: str) -> str:
    return label.replace("_", " ")


def _keyed(n: int, motion: str) -> str:
    """A motion with its hot key, if it has one."""
    return f"{DIGITS[n]} {_words(motion)}" if n < len(DIGITS) else _words(motion)
