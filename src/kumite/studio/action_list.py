"""The list of a library's actions on the panel: by clip and kind, and what the one played is.

A capture has hundreds of actions: they are listed in a dropdown that can be searched, for one clip
and one kind at a time.
"""

from __future__ import annotations

import html
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from kumite.annotate import DIRECTIONS, KINDS, NO_LIMB
from kumite.clip import LIMBS
from kumite.scene.actions import ActionPlayback

ALL_CLIPS, ALL_KINDS = "all clips", "all kinds"
PREVIOUS, NEXT = "Previous", "Next"


class Filter:
    """Which actions are listed: those of a clip and of a kind, or of all. Never none."""

    def __init__(self, stage: ActionPlayback) -> None:
        self._stage = stage
        self._clip = stage.actions.clip
        self._names = stage.library.clips.names
        self.clips: list[int | None] = [*np.unique(self._clip).tolist(), None]  # to choose from
        self.clip: int | None = int(self._clip[stage.action])
        self.kind: int | None = None

    @property
    def _of_clip(self) -> np.ndarray:
        return np.ones(len(self._clip), bool) if self.clip is None else self._clip == self.clip

    @property
    def kinds(self) -> list[int | None]:
        """The kinds that the clip has."""
        return [None, *np.unique(self._stage.actions.kind[self._of_clip]).tolist()]

    @property
    def actions(self) -> list[int]:
        """The actions listed, in order."""
        chosen = self._of_clip
        if self.kind is not None:
            chosen = chosen & (self._stage.actions.kind == self.kind)
        return np.flatnonzero(chosen).tolist()

    def set_clip(self, clip: int | None) -> None:
        """List another clip's; a kind that it has not is all kinds."""
        self.clip = clip
        if self.kind not in self.kinds:
            self.kind = None

    def beside(self, action: int, step: int) -> int:
        """The action ``step`` on in the list, round its ends."""
        listed = self.actions
        return listed[(listed.index(action) + step) % len(listed)]

    @property
    def clip_names(self) -> list[str]:
        """The clips as they are read, with how many actions each has."""
        return [
            f"{ALL_CLIPS} ({len(self._clip)})"
            if c is None
            else f"{self._names[c]} ({np.sum(self._clip == c)})"
            for c in self.clips
        ]

    @property
    def kind_names(self) -> list[str]:
        """The kinds as they are read, with how many actions of the clip are of each."""
        kind = self._stage.actions.kind[self._of_clip]
        return [
            f"{ALL_KINDS} ({len(kind)})" if k is None else f"{KINDS[k]} ({np.sum(kind == k)})"
            for k in self.kinds
        ]

    @property
    def action_names(self) -> list[str]:
        """The actions listed as they are read: number, label, kind, start–stop [s], clip."""
        return [self.action_name(a) for a in self.actions]

    def action_name(self, action: int) -> str:
        """``3 · left_hand_straight · attack · 0.77–2.03 s``, each its own by its number."""
        actions = self._stage.actions
        start, stop = seconds(self._stage, action)
        name = f"{action + 1} · {title(self._stage, action)}"
        kind = KINDS[actions.kind[action]]
        name += f" · {kind}" if kind != title(self._stage, action) else ""
        name += f" · {start:.2f}–{stop:.2f} s"
        return f"{name} · {self._names[self._clip[action]]}" if self.clip is None else name


def seconds(stage: ActionPlayback, action: int) -> tuple[float, float]:
    """When an action starts and stops [s] in its clip."""
    actions = stage.actions
    begin = actions.clip_start[actions.clip[action]]
    start, stop = actions.start[action] - begin, actions.stop[action] - begin
    return float(start / stage.fps), float(stop / stage.fps)


def title(stage: ActionPlayback, action: int) -> str:
    """An action's label, or its kind where it has none."""
    return stage.actions.label[action] or KINDS[stage.actions.kind[action]]


def action_html(stage: ActionPlayback) -> str:
    """What the action played is: label; kind, limb, direction; where it is; what follows it."""
    actions, k = stage.actions, stage.action
    start, stop = seconds(stage, k)
    begin = int(actions.clip_start[actions.clip[k]])
    what = [KINDS[actions.kind[k]]]
    if actions.limb[k] != NO_LIMB:
        what.append(LIMBS[actions.limb[k]].replace("_", " "))
    if DIRECTIONS[actions.direction[k]] != "none":
        what.append(DIRECTIONS[actions.direction[k]])
    ways = int(stage.ways_on[k])
    clip = html.escape(stage.library.clips.names[actions.clip[k]])
    frames = f"frames {actions.start[k] - begin}–{actions.stop[k] - 1 - begin}"
    after = f"{ways} actions may follow" if ways else "not part of the graph"
    return (
        '<div style="padding:0 1em .5em;font-size:.85em;line-height:1.4">'
        f'<div style="font-size:1.25em;font-weight:700">{html.escape(title(stage, k))}</div>'
        f"<div>{' · '.join(what)}</div>"
        f'<div style="opacity:.75">{clip} · {start:.2f}–{stop:.2f} s · {frames}</div>'
        f'<div style="opacity:.75">{k + 1} of {len(actions)} · {after}</div></div>'
    )


class ActionList:
    """The panel's part that lists actions. choose: plays one."""

    def __init__(
        self, gui: viser.GuiApi, stage: ActionPlayback, choose: Callable[[int], None]
    ) -> None:
        self._stage, self._choose = stage, choose
        self._lock = threading.RLock()  # quick clicks come from several threads
        self._filter = Filter(stage)
        f = self._filter
        self._text = gui.add_html("")
        self._action = gui.add_dropdown("Action", f.action_names, hint="type to search")
        self._beside = gui.add_button_group("", (PREVIOUS, NEXT), hint="B and F")
        self._clip = gui.add_dropdown("Clip", f.clip_names, hint="list this clip's actions")
        self._kind = gui.add_dropdown("Kind", f.kind_names, hint="list actions of this kind")
        self._show()

    def listen(self, safely: Callable[[Callable[[Any], None]], Callable[[Any], None]]) -> None:
        """Follow what a person chooses. safely: wraps a callback of the page."""
        self._action.on_update(safely(self._on_action))
        self._clip.on_update(safely(self._on_clip))
        self._kind.on_update(safely(self._on_kind))
        self._beside.on_click(
            safely(lambda e: self.move(1 if e.target.value == NEXT else -1)),
        )

    def move(self, step: int) -> None:
        """Play the action ``step`` on in the list."""
        with self._lock:
            self._play(self._filter.beside(self._stage.action, step))

    def _on_action(self, event: Any) -> None:
        with self._lock:
            k = _place(event, self._filter.action_names)
            if k is not None:
                self._play(self._filter.actions[k])

    def _on_clip(self, event: Any) -> None:
        with self._lock:
            k = _place(event, self._filter.clip_names)
            if k is not None:
                self._filter.set_clip(self._filter.clips[k])
                self._relist()

    def _on_kind(self, event: Any) -> None:
        with self._lock:
            k = _place(event, self._filter.kind_names)
            if k is not None:
                self._filter.kind = self._filter.kinds[k]
                self._relist()

    def _relist(self) -> None:
        listed = self._filter.actions
        self._play(self._stage.action if self._stage.action in listed else listed[0])

    def _play(self, action: int) -> None:
        if action != self._stage.action:
            self._choose(action)
        self._show()

    def _show(self) -> None:
        """Bring lists and text up to date."""
        f = self._filter
        for dropdown, names, value in (
            (self._clip, f.clip_names, f.clip_names[f.clips.index(f.clip)]),
            (self._kind, f.kind_names, f.kind_names[f.kinds.index(f.kind)]),
            (self._action, f.action_names, f.action_name(self._stage.action)),
        ):
            if dropdown.options != tuple(names):
                dropdown.options = names
            dropdown.value = value
        self._text.content = action_html(self._stage)


def _place(event: Any, names: list[str]) -> int | None:
    """The choice that a person has made; None of one that is no longer there, or not a person's:
    the list writes to its own widgets too."""
    chosen = event.target.value
    return names.index(chosen) if event.client is not None and chosen in names else None
