"""The loop: steps the stage in time, draws what it shows, and lets the page interfere.

One thread steps and draws. The page's callbacks come from viser's threads; they touch the stage
under one lock and leave notes (``_redraw``, ``_rewound``) that the loop acts on.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import time
import webbrowser
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import viser

from kumite.body import body_mesh
from kumite.clip import forward_kinematics
from kumite.errors import KumiteError
from kumite.scene.events import Hit, Struck
from kumite.scene.stage import SceneObject, Stage, in_sight, offers_of
from kumite.studio import bodies, panel, props, ring
from kumite.studio.coming import Coming
from kumite.studio.doors import a_place, a_seed, within
from kumite.studio.pace import Pace
from kumite.studio.panel import FASTEST, SLOWEST
from kumite.studio.paths import Path, Paths, on_floor
from kumite.studio.server import close_server, is_loopback, open_server, url_of
from kumite.studio.viewer import Looks, Viewer
from kumite.studio.wording import EventLog, struck

MOST_DRAWN = 60.0  # pictures a second
PANEL_PERIOD = 0.2  # s between updates of what is read, not watched
IDLE_PERIOD = 0.25  # s between looks at a paused stage
LONGEST_TICK = 0.1  # s; fades and the follow do not jump after a hiccup


@dataclass
class _Picture:
    """What one drawing needs, copied from the stage under the lock."""

    frame: int
    root_position: np.ndarray  # [K, 3] m
    wxyz: np.ndarray  # [K, J, 4]
    objects: np.ndarray  # [O, 3] m
    radii: np.ndarray  # [O] m
    hits: list[Hit | Struck] = field(default_factory=list)
    note: str = ""  # behind the time
    paths: list[Path] = field(default_factory=list)  # of whom is sent along check points
    spheres: tuple[np.ndarray, np.ndarray] | None = None  # of whom balls may be thrown at
    looks: dict[int, Looks] = field(default_factory=dict)  # of each page


class Studio:
    """A stage in the browser. Make it, :meth:`run` it, :meth:`close` it.

    allowed: names besides ``host`` that the page may be asked for as (of a proxy or a tunnel).
    coming: what is prepared meanwhile, and shown in place of ``stage`` as soon as it is ready.
    Errors: no body can be laid on the skeleton; a host that is not this machine's; with
    ``strict_port`` a port that is taken (without, the next free one is used).
    """

    def __init__(
        self,
        stage: Stage,
        *,
        host: str = "127.0.0.1",
        port: int | None = 8080,
        strict_port: bool = False,
        allowed: Sequence[str] = (),
        coming: Coming | None = None,
    ) -> None:
        self._lock = threading.RLock()
        self._stop = threading.Event()
        self._wake = threading.Event()
        self._coming, self._follows = coming, True
        self._take(stage)
        mesh = body_mesh(stage.skeleton)
        self.server = open_server(host, port, stage.title, strict=strict_port, allowed=allowed)
        self.url = url_of(host, self.server.get_port())
        try:
            self._build(mesh)
            self.server.on_client_connect(lambda _: self.wake())
        except BaseException:
            self.close()
            raise

    def _take(self, stage: Stage) -> None:
        """Everything about a stage that is not shown yet."""
        self.stage = stage
        self._redraw = self._rewound = True
        self._playing = True
        self._ended = False
        self._hits: list[Hit | Struck] = []
        self._pace = Pace(stage.fps)
        self._offers = offers_of(stage)
        self._log = EventLog(stage.names, self._offers.counts)
        self.viewers: dict[int, Viewer] = {}  # by their pages

    def show(self, stage: Stage) -> None:
        """Show another stage in the same page, from now on. The thread that runs.

        Errors: no body can be laid on its skeleton; what is shown then stays.
        """
        mesh, server = body_mesh(stage.skeleton), self.server
        with self._lock, server.atomic():
            for viewer in self.viewers.values():
                if viewer.client is not None:
                    with viewer.client.atomic():
                        viewer.client.scene.remove_click_callback("all")
                        viewer.client.scene.reset()
                        viewer.client.gui.reset()
            server.scene.reset()
            server.gui.reset()
            self._take(stage)
            self._build(mesh)
        server.flush()

    def _build(self, mesh: bodies.BodyMesh) -> None:
        stage, server, offers = self.stage, self.server, self._offers
        self._mesh = mesh
        ring.build(server)
        panel.prepare(server.gui, stage.title)
        unarmed = getattr(stage, "unarmed", ())
        self._pose = forward_kinematics if offers.played is None else bodies.pose_uncompiled
        self._bodies = bodies.show_bodies(server, stage.skeleton, mesh, stage.names, unarmed)
        dragged = None if offers.led is None else self._drag_object
        self._targets = props.Targets(server, stage.objects, self.move_object, dragged)
        self._bursts = props.Bursts(server)
        self._targeted = np.array([not o.thrown for o in stage.objects], dtype=bool)
        self._paths = Paths(server, stage.names, self._move_check_point)
        picture = self._look()
        centre = self._midpoint(picture)
        if offers.seen == "before":
            ring.aim_at(server, picture.root_position, offers.yaw, centre)
        elif offers.seen == "behind":
            ring.aim_behind(server, self._in_view(picture), offers.yaw, centre)
        else:
            ring.aim(server, self._in_view(picture), centre)
        self._drawn_at = self._panel_at = time.perf_counter()
        with server.atomic():
            self._draw(picture, 0.0)

    def look_in(self, page: viser.ClientHandle | viser.ViserServer) -> Viewer:
        """Show the stage in another page, with a panel of its own; in tests in none, the server.
        The thread that runs."""
        with self._lock:
            centre = self._midpoint(self._look())
            viewer = Viewer(
                page,
                self,
                self.stage,
                self._offers,
                self._mesh,
                centre,
                self._coming,
                follows=self._follows,
            )
            self.viewers[viewer.id] = viewer
            self._redraw = True
        return viewer

    def _welcome(self) -> None:
        """Pages that have come get what belongs to them; of those that have gone nothing stays."""
        clients = self.server.get_clients()
        for page in [n for n, v in self.viewers.items() if v.client and n not in clients]:
            del self.viewers[page]
            self._targets.let_go(page)
            self._paths.let_go(page)
        for number, client in clients.items():
            if number not in self.viewers:
                with client.atomic():
                    self.look_in(client)

    # What the page asks for; any thread.

    def wake(self) -> None:
        """Draw anew, and look at what waits."""
        self._redraw = True
        self._wake.set()

    @property
    def playing(self) -> bool:
        """Whether the stage moves by itself."""
        return self._playing

    def toggle(self) -> None:
        """Play or pause; at the end, play again from the start."""
        with self._lock:
            if self._ended:
                self.restart()
                self._playing = True
            else:
                self._playing = not self._playing
            self._pace.restart()
        self.wake()

    def step_once(self) -> None:
        """Pause, and move on one frame."""
        with self._lock:
            self._playing = False
            self._step(1)
        self.wake()

    def restart(self, seed: int | None = None) -> None:
        """From the start, with ``seed`` or the stage's own."""
        seed = self.stage.seed if seed is None else a_seed(seed)
        with self._lock:
            self.stage.reset(seed)
            self._targets.renew(self.server, self.stage.objects)
            self._after_jump()
            self._rewound = True
        self.wake()

    def seek(self, frame: int) -> None:
        """Jump to a frame; a live stage cannot."""
        with self._lock:
            if self._offers.played is not None:
                self._offers.played.seek(frame)
                self._after_jump()
        self.wake()

    def choose(self, action: int) -> None:
        """Play an action of a library over and over; other stages have none."""
        with self._lock:
            listed = self._offers.listed
            if listed is not None:
                listed.choose(action)
                for viewer in self.viewers.values():
                    viewer.panel.set_length(len(listed.recording))
                self._after_jump()
                self._playing = self._rewound = True
        self.wake()

    def _after_jump(self) -> None:
        self._ended = False
        self._hits.clear()
        self._log.rewind()
        self._log.update(self.stage.events, self.stage.frame)
        self._pace.restart()

    @property
    def speed(self) -> float:
        """Seconds of the scene in a second of wall time."""
        return self._pace.speed

    def set_speed(self, speed: float) -> None:
        """Seconds of the scene in a second of wall time, 0.1 to 4."""
        with self._lock:
            self._pace.speed = within("speed", speed, SLOWEST, FASTEST)
        self._wake.set()

    def set_follow(self, on: bool) -> None:
        """Keep the fighters' midpoint in the middle of all pictures, or not: in pages that are open
        and those to come. Each page may switch it for itself."""
        with self._lock:
            self._follows = on
            for viewer in self.viewers.values():
                viewer.own.follow.on = on
        self.wake()

    def direct(self, act: Callable[[], Any]) -> Any:
        """Do something to the stage between two frames, and show it."""
        with self._lock:
            found = act()
        self.wake()
        return found

    def _move_check_point(
        self, page: int, who: int, index: int, eye: np.ndarray, way: np.ndarray
    ) -> None:
        """Put a check point where a ray of a page meets the floor."""
        place, directed = on_floor(self.viewers[page].on_stage(eye), way), self._offers.directed
        if place is not None and directed is not None:
            name = self.stage.names[who]
            with contextlib.suppress(KumiteError):  # its path may have been cleared meanwhile
                self.direct(lambda: directed.move_check_point(name, index, place))

    def _drag_object(self, page: int, name: str, eye: np.ndarray, way: np.ndarray) -> None:
        """Put an object where a ray of a page meets the level that it is at."""
        eye = self.viewers[page].on_stage(eye)
        level = next(o.position[1] for o in self.stage.objects if o.name == name)
        place = on_floor(eye - [0.0, level, 0.0], way)
        if place is not None:
            self.move_object(name, np.array([place[0], level, place[1]]))

    def move_object(self, name: str, position: np.ndarray) -> None:
        """Put an object at ``position`` [3] m. Errors: it is not finite, or far away."""
        position = a_place(name, position)
        with self._lock:
            self.stage.move_object(name, position)
        self.wake()

    def stop(self) -> None:
        """Let :meth:`run` return."""
        self._stop.set()
        self._wake.set()

    def close(self) -> None:
        """Stop, and free the port."""
        self.stop()
        close_server(self.server)

    # The loop; one thread.

    def run(self, seconds: float | None = None) -> None:
        """Play until :meth:`stop`, or for ``seconds`` of wall time; they count from when what is
        coming has come. Errors: those of its preparation.
        """
        end = None
        self._pace.restart()
        while not self._stop.is_set():
            if self._coming is not None:
                self._look_out_for(self._coming)
            elif end is None and seconds is not None:
                end = time.perf_counter() + seconds
            moving = self._tick()
            pause = self._pace.wait() if self._playing else IDLE_PERIOD
            pause = min(pause, 1 / 30) if moving else pause
            if end is not None:
                left = end - time.perf_counter()
                if left <= 0:
                    break
                pause = min(pause, left)
            self._wake.wait(pause)
            self._wake.clear()

    def _look_out_for(self, coming: Coming) -> None:
        """Show what is coming when it has come, and till then how far it is."""
        if coming.error is not None:
            raise coming.error
        if coming.stage is None:
            for viewer in self.viewers.values():
                self._redraw |= viewer.panel.look_out()
            return
        self._coming = None
        self.show(coming.stage)

    def _step(self, frames: int) -> None:
        for _ in range(frames):
            before = self.stage.frame
            if not self.stage.step():
                self._ended, self._playing = True, False
                break
            self._rewound |= self.stage.frame < before  # what is played over and over
        fresh = self._log.update(self.stage.events, self.stage.frame)
        self._hits += [e for e in fresh if isinstance(e, Hit | Struck)]
        self._redraw = True

    def _tick(self) -> bool:
        """Step what is due and draw it; True while something fades or slides on its own."""
        self._welcome()
        with self._lock:
            for viewer in self.viewers.values():
                viewer.act()
            if self._playing and (due := self._pace.take()):
                self._step(due)
            now = time.perf_counter()
            seconds = now - self._drawn_at
            if not self._redraw and not self._animating:
                return False
            if seconds < 1 / MOST_DRAWN:
                return True
            if not self.viewers:
                self._hits.clear()
                return False  # _redraw stays set: whoever comes is shown the latest
            self._redraw, rewound, self._rewound = False, self._rewound, False
            picture = self._look()
        with self.server.atomic():
            if rewound:
                self._bursts.clear()
            self._draw(picture, min(seconds, LONGEST_TICK), rewound=rewound)
        self.server.flush()
        self._drawn_at = now
        return self._animating

    def _look(self) -> _Picture:
        stage = self.stage
        throwing, listed = self._offers.throwing, self._offers.listed
        hits, self._hits = self._hits, []
        return _Picture(
            stage.frame,
            np.array(stage.root_position, dtype=np.float64),
            np.array(stage.wxyz, dtype=np.float64),
            np.array([o.position for o in stage.objects], dtype=np.float64).reshape(-1, 3),
            np.array([o.radius for o in stage.objects], dtype=np.float64),
            hits,
            "" if listed is None else f" · frame {listed.clip_frame} of its clip",
            self._routes(),
            None if throwing is None else throwing.bodies(),
            {page: viewer.look() for page, viewer in self.viewers.items()},
        )

    def _routes(self) -> list[Path]:
        """Every fighter's check points."""
        directed = self._offers.directed
        progress = () if directed is None else directed.progress
        return [Path(k, p.route, p.index) for k, p in enumerate(progress) if p is not None]

    def _draw(self, picture: _Picture, seconds: float, *, rewound: bool = False) -> None:
        position, world = self._pose(self.stage.skeleton, picture.root_position, picture.wxyz)
        for hit in picture.hits:
            self._show_hit(hit)
        self._bodies.draw(position, world, seconds)
        self._targets.draw(picture.objects, picture.radii, seconds)
        self._paths.draw(picture.paths)
        self._animating = self._bursts.draw(seconds)
        now = time.perf_counter()
        read = now - self._panel_at >= PANEL_PERIOD or seconds == 0.0 or not self._playing
        if read:
            self._panel_at = now
        middle = self._midpoint(picture)
        objects = [
            replace(o, position=at) for o, at in zip(self.stage.objects, picture.objects.copy())
        ]
        for page, looks in picture.looks.items():
            self._draw_for(self.viewers[page], looks, picture, middle, objects, seconds, rewound)
            if read:
                self._show_panel(self.viewers[page], picture)

    def _draw_for(
        self,
        viewer: Viewer,
        looks: Looks,
        picture: _Picture,
        middle: np.ndarray,
        objects: list[SceneObject],
        seconds: float,
        rewound: bool,
    ) -> None:
        """What of a picture is for one page only."""
        if viewer.client is not None and viewer.id not in self.server.get_clients():
            return  # it has just gone
        holds = self._targets.held(viewer.id) or self._paths.held(viewer.id)
        with contextlib.nullcontext() if viewer.client is None else viewer.client.atomic():
            viewer.draw(
                looks,
                middle,
                seconds,
                objects,
                picture.spheres,
                now=time.perf_counter(),
                jump=rewound,
                holds=holds,
            )
        if viewer.client is not None:
            viewer.client.flush()

    def _show_panel(self, viewer: Viewer, picture: _Picture) -> None:
        note = " · ended" if self._ended else "" if self._playing else " · paused"
        with self._lock:
            viewer.panel.playing(self._playing, self.speed, self.stage.seed)
            viewer.panel.show(self._log, picture.frame, picture.note + note)

    def _in_view(self, picture: _Picture) -> np.ndarray:
        """Points [N, 3] m that belong in the picture."""
        there = self._targeted & in_sight(picture.objects)
        return np.concatenate([picture.root_position, picture.objects[there]])

    def _midpoint(self, picture: _Picture) -> np.ndarray:
        """The middle [2] (x, z) of what goes on: of the fighters, or of one and the target; of who
        walks about."""
        if self._offers.seen == "behind" and self._offers.led is not None:
            return picture.root_position[list(self._offers.led.led)][:, [0, 2]].mean(axis=0)
        points = picture.root_position
        points = points if len(points) > 1 else self._in_view(picture)
        return points[:, [0, 2]].mean(axis=0)

    def _show_hit(self, hit: Hit | Struck) -> None:
        whom, names = struck(hit), self.stage.names
        if whom in names:
            self._bodies.flash(names.index(whom))
        else:
            self._targets.strike(whom)
        self._bursts.add(hit.place, hit.speed)


def serve(
    stage: Stage,
    *,
    host: str = "127.0.0.1",
    port: int | None = 8080,
    open_browser: bool = True,
    seconds: float | None = None,
    strict_port: bool = False,
    allowed: Sequence[str] = (),
    announce: Callable[[str], None] = print,
    coming: Coming | None = None,
) -> None:
    """Show a stage in the browser until Ctrl-C, or for ``seconds``.

    coming: is prepared while ``stage`` is shown, then shown in its place; from then on ``seconds``
    count.

    A taken port moves on to the next free one, and that is said; with ``strict_port`` it is an
    error. ``port`` 0 or None takes any. Errors: as :class:`Studio`.
    """
    if seconds is not None and not seconds > 0:
        raise KumiteError(f"{seconds} seconds of studio; expected more than 0")
    studio = Studio(
        stage, host=host, port=port, strict_port=strict_port, allowed=allowed, coming=coming
    )
    try:
        found = studio.server.get_port()
        if port and found != port:
            announce(f"port {port} is taken; using {found}")
        if not is_loopback(host):
            announce(f"listening on {host}: others on the network can watch and interfere")
        announce(f"studio: {studio.url}  (Ctrl-C ends)")
        if coming is not None:
            announce(
                f"a recorded fight is shown; live {coming.name} is being prepared, only this once"
            )
            coming.start()
        if open_browser:
            _open_page(studio.url)
        studio.run(seconds)
    except KeyboardInterrupt:
        announce("studio closed")
    finally:
        if coming is not None:
            coming.stop()
        studio.close()


def _open_page(url: str) -> None:
    """In the user's browser, if there is a screen; a text browser would take the terminal."""
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        return
    threading.Thread(target=webbrowser.open, args=(url,), daemon=True).start()
