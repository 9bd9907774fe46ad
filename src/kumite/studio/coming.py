"""A stage that is being prepared while a recorded fight is shown.

Preparing takes a minute where nothing is compiled yet; a recording needs nothing compiled and is
seen within seconds. Both are shown in the same page, one after the other.
"""

from __future__ import annotations

import html
import os
import signal
import subprocess
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import viser

from kumite.scene.recording import load_recording
from kumite.scene.stage import Playback, Stage

RECORDING = Path(__file__).with_name("sparring.rec")  # 'make recording' renews it
SOONEST_GUESS = 3.0  # s of work, and share of it, before the time left is guessed
LEAST_SHARE = 0.05
GOODBYE = 2.0  # s that a process that is stopped has to end


class Interlude(Playback):
    """The recorded fight, over and over."""

    def __init__(self) -> None:
        super().__init__(load_recording(RECORDING))

    def step(self) -> bool:
        if not super().step():
            self.seek(0)
        return True


class Coming:
    """What is prepared behind the interlude, and how far it is.

    name: of the scene. make: prepares it; it is given this, to :meth:`tell` how far it is and to
    :meth:`own` the processes that work for it.
    """

    def __init__(self, name: str, make: Callable[[Coming], Stage]) -> None:
        self.name = name
        self.stage: Stage | None = None
        self.error: BaseException | None = None
        self._make = make
        self._lock = threading.Lock()
        self._doing, self._share, self._begun = "starting", 0.0, time.monotonic()
        self._owned: list[subprocess.Popen[Any]] = []
        self._stopped = False
        self._thread = threading.Thread(target=self._work, name="preparing", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def _work(self) -> None:
        try:
            self.stage = self._make(self)
        except BaseException as error:  # told by the thread that shows
            self.error = error

    def tell(self, doing: str, share: float | None = None) -> None:
        """What is done now, and how much of all work is, if that is known. Any thread."""
        with self._lock:
            self._doing = doing
            if share is not None:
                self._share = share

    @property
    def share(self) -> float:
        """How much of the work is done, 0 to 1."""
        with self._lock:
            return self._share

    def line(self) -> str:
        """``compiling 34 of 133, some 20 s left``."""
        with self._lock:
            doing, share, spent = self._doing, self._share, time.monotonic() - self._begun
        if share < LEAST_SHARE or spent < SOONEST_GUESS:
            return doing
        left = spent * (1.0 - share) / share
        return f"{doing}, some {max(5 * round(left / 5), 5)} s left"

    def own(self, process: subprocess.Popen[Any]) -> None:
        """End a process, with those that it has started, when this is stopped.

        It must lead a session of its own (``start_new_session``).
        """
        with self._lock:
            self._owned.append(process)
            stopped = self._stopped
        if stopped:
            _end(process)

    def stop(self) -> None:
        """End what still works for it."""
        with self._lock:
            self._stopped, owned = True, [*self._owned]
        for process in owned:
            _end(process)
        if self._owned and self._thread.is_alive():
            self._thread.join(GOODBYE)


def _end(process: subprocess.Popen[Any]) -> None:
    if process.poll() is not None:
        return
    if hasattr(os, "killpg"):
        try:
            os.killpg(process.pid, signal.SIGTERM)
        except ProcessLookupError:
            return
    else:
        process.terminate()
    try:
        process.wait(GOODBYE)
    except subprocess.TimeoutExpired:
        process.kill()


class Banner:
    """The panel's part that says what is shown meanwhile, and what comes."""

    def __init__(self, gui: viser.GuiApi, coming: Coming, shown: str) -> None:
        self._coming, self._shown = coming, shown
        self._said = ""
        self._text = gui.add_html("")
        self._bar = gui.add_progress_bar(0.0, animated=True, color=(246, 196, 60))
        self.show()

    def show(self) -> bool:
        """Bring it up to date; whether anything has changed."""
        said = self._coming.line()
        if said == self._said:
            return False
        self._said = said
        what = f"Live {self._coming.name}" if self._coming.name != self._shown else "The live one"
        self._text.content = (
            '<div style="padding:.2em 1em .4em;font-size:.9em;line-height:1.4">'
            f'<div style="color:#f6c43c;font-weight:700">A recorded fight '
            f"({html.escape(self._shown)})</div>"
            f"<div>{html.escape(what)} is being prepared and follows by itself; "
            "only this once.</div>"
            f'<div style="opacity:.75">{html.escape(said)}</div></div>'
        )
        self._bar.value = 100.0 * self._coming.share
        return True
