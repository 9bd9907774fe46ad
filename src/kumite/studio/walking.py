"""The panel's part for people who prepare: who is led, by what, and what is seen of it."""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any, cast

import viser

from kumite.studio.dodging import Thrower
from kumite.studio.doors import Safely, a_place, a_way
from kumite.studio.leading import DOWN, LEFT, RIGHT, UP, Leader
from kumite.studio.reference import Prepared, State

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
        server: viser.ViserServer,
        leader: Leader,
        prepared: Prepared,
        studio: Thrower,
        safely: Safely,
    ) -> None:
        self._leader, self._prepared, self._studio = leader, prepared, studio
        scene, gui = leader.scene, server.gui
        with gui.add_folder("Walk"):
            gui.add_html(
                '<div style="padding:0 1em .5em;font-size:.85em;opacity:.75">click on the floor or '
                f"on a thing; arrow keys or I J K L{KEYS_ARE_OURS}</div>"
            )
            if scene.users > 1:
                names = scene.names[: scene.users]
                who = gui.add_dropdown("Walker", names, hint="who is led, and shown below")
                who.on_update(safely(lambda e: self._choose(names.index(e.target.value))))
            ways = gui.add_button_group("", tuple(KEYS), hint="a few steps, as seen from here")
            ways.on_click(safely(lambda e: self._press(e, e.target.value)))
            keyed = {_keyed(n, m): m for n, m in enumerate(scene.motions)}
            motions = gui.add_button_group("Do", tuple(keyed), hint="and hot keys 1 to 9")
            motions.on_click(safely(lambda e: self._do(e, keyed[e.target.value])))
            self._automatic = gui.add_checkbox(
                "By itself",
                scene.automatic,
                hint="goes, and begins its motions, without you; where you send it, it goes first",
            )
            self._automatic.on_update(safely(self._set_automatic))
        with gui.add_folder("Preparation"):
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
        server.scene.on_click()(safely(self._click))

    def _add_keys(self, gui: viser.GuiApi, safely: Safely) -> None:
        def command(label: str, key: str, act: Callable[[Any], None]) -> None:
            gui.add_command(label, hotkey=cast(Any, key)).on_trigger(safely(act))

        for way, keys in KEYS.items():
            for key in keys:
                command(f"Walk {WORDS[way]} ({key})", key, lambda e, way=way: self._press(e, way))
        for digit, motion in zip(DIGITS, self._leader.scene.motions):
            command(_words(motion), digit, lambda e, motion=motion: self._do(e, motion))
        command("By itself or by hand", BY_ITSELF, lambda _: self._turn_automatic())

    def _choose(self, who: int) -> None:
        self._leader.who = self._prepared.asked.who = who
        self._studio.wake()

    def _ask(self, **switches: bool) -> None:
        for name, value in switches.items():
            setattr(self._prepared.asked, name, value)
        self._studio.wake()

    def _click(self, event: viser.SceneClickEvent) -> None:
        eye = self._studio.from_page(a_place("click", event.ray_origin))
        way = a_way("click", event.ray_direction)
        self._studio.direct(lambda: self._leader.point(eye, way))

    def _press(self, event: Any, way: str) -> None:
        if event.client is None:
            return
        camera = event.client.camera
        eye, at = (a_place("camera", x) for x in (camera.position, camera.look_at))
        up = a_way("camera", camera.up_direction)
        self._studio.direct(lambda: self._leader.press(eye, at, up, way))

    def _do(self, event: Any, motion: str) -> None:
        busy = self._studio.direct(lambda: self._leader.trigger(motion))
        if busy is not None and event.client is not None:
            said = f"{self._leader.name} does {_words(busy)}; then it can be told to do another"
            event.client.add_notification("Busy", said, auto_close_seconds=2.0)

    def _set_automatic(self, event: Any) -> None:
        if event.client is not None:  # the panel switches it, too
            value = bool(event.target.value)
            self._studio.direct(lambda: setattr(self._leader.scene, "automatic", value))

    def _turn_automatic(self) -> None:
        scene = self._leader.scene
        self._studio.direct(lambda: setattr(scene, "automatic", not scene.automatic))

    def show(self) -> None:
        """Under the lock: how far it is prepared, and for what."""
        if self._automatic.value != self._leader.scene.automatic:
            self._automatic.value = self._leader.scene.automatic
        content = self._state_html(self._prepared.state())
        if self._text.content != content:
            self._text.content = content

    def _state_html(self, state: State) -> str:
        hand = " (sent by you)" if self._leader.led else ""
        if state.does is not None:
            said = f"{self._leader.name} does {_words(state.does)}"
        elif state.away is not None:
            said = f"{self._leader.name} goes {state.away:.1f} m{hand}"
        else:
            said = f"{self._leader.name} stays"
        what = "nothing"
        if state.prepares is not None:
            what = f"{_words(state.prepares)}: {self._prepared.about(state.prepares)}"
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
