"""A page and what belongs to it alone: its stage's frame, its panel, what it draws and clicks.

A click is meant for the picture in which it was made, and that may be some time old: a page that
draws slowly, or is far away, lags. So the studio numbers the pictures that it sends, and a page
says which one it has: by its camera's field of view, of which the last digits are that number. They
change the picture by less than a twentieth of a pixel, and a page reports its camera whenever the
field of view is set. What the studio knows of the last pictures is kept as :class:`Seen`.
"""

from __future__ import annotations

from collections import deque
from typing import Any, NamedTuple, cast

import numpy as np
import viser
from viser import _messages

from kumite.body import BodyMesh
from kumite.errors import KumiteError
from kumite.scene.stage import Offers, SceneObject, Stage
from kumite.studio import ring
from kumite.studio.coming import Coming
from kumite.studio.doors import a_place, a_way
from kumite.studio.leading import Leader
from kumite.studio.panel import Desk, Own, Panel
from kumite.studio.paths import Drawn, on_floor
from kumite.studio.reference import Prepared, PreparedPicture
from kumite.studio.throwing import Throws
from kumite.studio.volumes import VolumePicture, Volumes

DIGIT = 1e-7  # rad of the field of view that a picture's number is counted in …
NUMBERS = 1024  # … up to which; then from 0 again
MOST_SEEN = 400  # pictures that are remembered: 7 s
NUMBERED = 0.04  # s between pictures with numbers of their own
MOST_CLICKS = 64  # that wait
NOBODY = -1  # the number of a page that is none: of a studio without a browser


class Seen(NamedTuple):
    """What was where in a picture."""

    number: int
    centre: np.ndarray  # [2] m, the point of the stage at the page's origin
    objects: list[SceneObject]
    bodies: tuple[np.ndarray, np.ndarray] | None  # of whom balls may be thrown at


class Click(NamedTuple):
    """A ray of the stage that was clicked, and the picture in which."""

    eye: np.ndarray  # [3] m
    way: np.ndarray  # [3], of length 1
    seen: Seen


class Looks(NamedTuple):
    """What one drawing needs for one page, copied under the lock."""

    volumes: VolumePicture | None
    prepared: PreparedPicture | None


class Viewer:
    """One page."""

    def __init__(
        self,
        page: viser.ClientHandle | viser.ViserServer,
        desk: Desk,
        stage: Stage,
        offers: Offers,
        mesh: BodyMesh,
        centre: np.ndarray,
        coming: Coming | None,
        *,
        follows: bool = True,
    ) -> None:
        """page: a browser's, or the server itself for a studio that nobody looks at. centre [2] m:
        the point of the stage that is in the middle at first.
        """
        self.client = page if isinstance(page, viser.ClientHandle) else None
        self.id = NOBODY if self.client is None else self.client.client_id
        self._stage, self._offers = stage, offers
        scene = page.scene
        follow = ring.Follow(scene.add_frame(ring.STAGE, show_axes=False))
        follow.jump(centre)
        follow.on = follows
        throwing, avoiding, led = offers.throwing, offers.avoiding, offers.led
        self.own = Own(
            follow,
            None if throwing is None else Throws(throwing),
            None if avoiding is None else Volumes(scene, avoiding),
            None if led is None else Leader(led, stage.names),
            None if led is None else Prepared(scene, led, stage.skeleton, mesh, stage.names),
        )
        self._drawn = Drawn(scene, stage.names) if offers.directed is not None else None
        self._clicks: deque[Click] = deque(maxlen=MOST_CLICKS)
        self._pictures: list[Seen] = []  # put anew, not changed: clicks come at any moment
        self._numbered_at = -np.inf
        self._number = 0
        self.wake = desk.wake
        self.panel = Panel(page.gui, desk, self.own, stage, offers, coming, self._eye)
        if offers.directed is not None or offers.throwing is not None or led is not None:
            # Not in a thread of its own: clicks stay in their order, and each knows its picture.
            scene.on_click()(cast(Any, self._clicked))

    # What the page does; viser's thread.

    async def _clicked(self, event: viser.SceneClickEvent) -> None:
        try:
            eye, way = a_place("click", event.ray_origin), a_way("click", event.ray_direction)
        except KumiteError:
            return
        self.click(eye, way)

    def click(self, eye: np.ndarray, way: np.ndarray) -> None:
        """A ray [3], [3] of the page's world was clicked in the picture that it shows now."""
        seen = self.seen
        if seen is not None:
            self._clicks.append(Click(self.on_stage(eye, seen), way, seen))
            self.wake()

    @property
    def seen(self) -> Seen | None:
        """The picture that the page shows, as far as it has told; None: none yet."""
        pictures = self._pictures
        if not pictures:
            return None
        if self.client is not None:
            told = round((float(self.client.camera.fov) - ring.FOV) / DIGIT)
            for seen in reversed(pictures):
                if seen.number == told:
                    return seen
        return pictures[-1]

    def on_stage(self, point: np.ndarray, seen: Seen | None = None) -> np.ndarray:
        """Where a point [3] m of the page's world lies on the stage, as seen or as it is now."""
        seen = seen or self.seen
        x, z = self.own.follow.centre if seen is None else seen.centre
        return np.asarray(point, dtype=np.float64) + np.array([x, 0.0, z])

    def seen_at(self, point: np.ndarray) -> np.ndarray:
        """Where a point [3] m of the stage lies in the page's world, as sent last."""
        x, z = self.own.follow.centre
        return np.asarray(point, dtype=np.float64) - np.array([x, 0.0, z])

    def _eye(self, event: Any) -> np.ndarray:
        return self.on_stage(a_place("camera", event.client.camera.position))

    # The thread that steps; under the lock.

    def act(self) -> None:
        """Do what was clicked, in the order of the clicks."""
        while self._clicks:
            click = self._clicks.popleft()
            try:
                self._act(click)
            except KumiteError as error:
                if self.client is not None:
                    self.client.add_notification("Not possible", str(error), color="red")

    def _act(self, click: Click) -> None:
        own = self.own
        if own.sketch.who is not None:
            place = on_floor(click.eye, click.way)
            if place is not None:
                own.sketch.add(place)
        elif own.leader is not None and (own.sends or own.throws is None):
            own.leader.point(click.eye, click.way, click.seen.objects)
        elif own.throws is not None:
            own.throws.along(click.eye, click.way, click.seen.bodies)

    def look(self) -> Looks:
        """What it asks to see, as it is now."""
        own = self.own
        return Looks(
            None if own.volumes is None else own.volumes.look(),
            None if own.prepared is None else own.prepared.look(),
        )

    # The thread that draws.

    def draw(
        self,
        looks: Looks,
        midpoint: np.ndarray,
        seconds: float,
        objects: list[SceneObject],
        bodies: tuple[np.ndarray, np.ndarray] | None,
        *,
        now: float,
        jump: bool,
        holds: bool,
    ) -> None:
        """A picture for this page. now [s]: of a clock. jump: the scene has been wound. holds: it
        drags something: the ground must not slide away under the pointer."""
        own = self.own
        if jump:
            own.follow.jump(midpoint)
        elif not (holds or own.sketch.who is not None):
            own.follow.update(midpoint, seconds)
        if own.volumes is not None and looks.volumes is not None:
            own.volumes.draw(looks.volumes)
        if own.prepared is not None and looks.prepared is not None:
            own.prepared.draw(looks.prepared)
        if self._drawn is not None:
            self._drawn.draw(own.sketch)
        fresh = now - self._numbered_at >= NUMBERED
        if fresh:
            self._numbered_at, self._number = now, (self._number + 1) % NUMBERS
        seen = Seen(self._number, own.follow.centre.copy(), objects, bodies)
        if not fresh and self._pictures:
            return  # the one with this number was sent first, and is what the page will tell of
        self._pictures = [*self._pictures[1 - MOST_SEEN :], seen]
        if self.client is not None:
            # Not by the camera's handle, which takes so small a change for none.
            self.client._websock_connection.queue_message(
                _messages.SetCameraFovMessage(ring.FOV + DIGIT * self._number)
            )
