"""Things that target motions are done at: balls that roll, bars and hurdles that stay."""

from __future__ import annotations

import numpy as np

from kumite.body import Body
from kumite.control.rules import GRAVITY
from kumite.errors import KumiteError
from kumite.graph.kinds import LYING, Suited
from kumite.graph.preparing import KINDS, Preparing
from kumite.scene.balls import BOUNCE, REST, ROLLING
from kumite.scene.doors import a_place
from kumite.scene.settings_prepare import TargetSettings
from kumite.scene.stage import SceneObject

STRIKE, UNDER, OVER = range(len(KINDS))
BAR = 0.06  # m, thickness of bars, hurdles and posts
SPARE = {UNDER: 0.02, OVER: -0.02}  # m by which an obstacle is easier than the motion could do
MASS_RATIO = 1.2  # speed of a ball over that of the foot that kicks it
LIFT = 0.25  # of its speed over the ground that a kicked ball gets upwards, at least
FRICTION = 0.9  # 1/s, of a ball that rolls in grass
AT_REST = 0.15  # m/s: a ball that is slower lies
SAMPLES = np.linspace(0.0, 1.0, 5)  # of a capsule, where it is tried against an obstacle


def fitting(settings: TargetSettings, suited: Suited) -> np.ndarray:
    """The target motions [N] that suit a thing, the best first.

    Errors: a word that is no kind and no label; a size that none of them clears or strikes at.
    """
    s = settings
    which = suited.meant(s.kind, f"kind of {s.name}")
    for t in which.tolist():
        if suited.about[t] != STRIKE and not suited.kinds_of(t):
            raise KumiteError(
                f"kind of {s.name}: {suited.label[t]} gets lower or higher where it stands, past "
                "nothing; expected a motion that gets past a bar or a hurdle"
            )
    found = suited.fit(which, s.height, s.radius)
    if len(which) and not len(found) and s.height is not None:
        t = int(which[np.argmax(suited.spare(which, s.height))])
        does = ("strikes at", "passes under", "clears")[suited.about[t]]
        high = (suited.high if suited.about[t] == STRIKE else suited.clear)[t]
        raise KumiteError(
            f"height of {s.name}: {s.height:g} m, but {suited.label[t]} {does} {high:.2f} m, the "
            "nearest that this library has; expected that, or no height"
        )
    return found


class Things:
    """N things, as arrays."""

    def __init__(
        self, settings: tuple[TargetSettings, ...], preparing: Preparing, motion: np.ndarray
    ) -> None:
        """motion [N]: the target motion that is done at each, see :func:`fitting`."""
        self.settings = settings
        self.names = tuple(s.name for s in settings)
        self.motion = motion
        self.kind = preparing.kind[motion].astype(np.int64)
        self.yaw = np.radians([s.yaw_deg for s in settings])
        self.width = np.array([s.width for s in settings])
        self.radius = np.array([s.radius for s in settings])
        self.height = np.zeros(len(settings))
        for n, s in enumerate(settings):
            kind, clear = int(self.kind[n]), float(preparing.clear[motion[n]])
            if kind != STRIKE:
                self.height[n] = clear + SPARE[kind] if s.height is None else s.height
        self.home = np.array([[s.position[0], 0.0, s.position[1]] for s in settings]).reshape(-1, 3)
        strikes = self.kind == STRIKE
        high = preparing.place[self.motion][:, 1]
        # A low blow is at a ball that lies, a high one at one that hangs there.
        told = [s.height is not None for s in settings]
        high = np.where(told, [s.height or 0.0 for s in settings], high)
        self.lies = strikes & (high < np.where(told, 2.0 * self.radius, LYING))
        self.home[:, 1] = np.where(strikes, np.where(self.lies, self.radius, high), 0.0)
        self.reset()

    def __len__(self) -> int:
        return len(self.settings)

    def reset(self) -> None:
        self.position = self.home.copy()  # [N, 3] m; of obstacles on the ground
        self.velocity = np.zeros_like(self.position)
        self.objects: list[SceneObject] = []
        for n in range(len(self)):
            self.objects += self._objects(n)
        self._object_of = [i for i, o in enumerate(self.objects) if o.name in self.names]

    def _objects(self, n: int) -> list[SceneObject]:
        """What is seen of a thing: the first object has its name."""
        name, kind, at, yaw = self.names[n], int(self.kind[n]), self.home[n], float(self.yaw[n])
        if kind == STRIKE:
            return [SceneObject(name, at.copy(), float(self.radius[n]), draggable=True)]
        high, wide = float(self.height[n]), float(self.width[n])
        side = np.array([np.cos(yaw), 0.0, -np.sin(yaw)]) * 0.5 * (wide + BAR)
        tall = high + BAR if kind == UNDER else high
        middle = high + 0.5 * BAR if kind == UNDER else high - 0.5 * BAR
        bar = at + np.array([0.0, middle, 0.0])
        post = (BAR, tall, BAR)
        return [
            SceneObject(name, bar, BAR, size=(wide, BAR, BAR), yaw=yaw),
            SceneObject(f"{name}, left", at + side + [0, 0.5 * tall, 0], BAR, size=post, yaw=yaw),
            SceneObject(f"{name}, right", at - side + [0, 0.5 * tall, 0], BAR, size=post, yaw=yaw),
        ]

    @property
    def lie(self) -> np.ndarray:
        """Which do not move now [N] bool."""
        return np.linalg.norm(self.velocity, axis=1) < AT_REST

    def gates(self, here: np.ndarray, which: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Where [K, 3] who is at ``here`` [K, 3] goes through things [K], and which way [K]: across
        an obstacle, not close to a post; NaN where any way will do."""
        place, yaw = self.position[which].copy(), self.yaw[which]
        way = here[:, :2] - place[:, [0, 2]]
        c, s = np.cos(yaw), np.sin(yaw)
        aside, before = c * way[:, 0] - s * way[:, 1], s * way[:, 0] + c * way[:, 1]
        room = 0.5 * self.width[which] - 0.5
        aside = np.clip(aside, -np.maximum(room, 0.0), np.maximum(room, 0.0))
        solid = self.kind[which] != STRIKE
        place[:, 0] += np.where(solid, c * aside, 0.0)
        place[:, 2] += np.where(solid, -s * aside, 0.0)
        through = np.where(before > 0, yaw + np.pi, yaw)
        return place, np.where(solid, through, np.nan)

    def inside(self, place: np.ndarray, margin: float = 0.3) -> int | None:
        """The obstacle that a place [2] m of the ground lies in, if any."""
        for n in np.flatnonzero(self.kind != STRIKE).tolist():
            c, s = np.cos(self.yaw[n]), np.sin(self.yaw[n])
            x, z = place - self.position[n, [0, 2]]
            aside, along = c * x - s * z, s * x + c * z
            if abs(along) < margin and abs(aside) < 0.5 * self.width[n] + margin:
                return n
        return None

    def kick(self, n: int, velocity: np.ndarray) -> None:
        """A foot that moves at ``velocity`` [3] m/s has met a ball."""
        v = MASS_RATIO * velocity
        v[1] = max(v[1], LIFT * float(np.hypot(v[0], v[2])))
        self.velocity[n] = v

    def step(self, dt: float) -> None:
        """Balls roll and bounce; what hangs swings back to where it belongs."""
        moving = np.linalg.norm(self.velocity, axis=1) > 0.0
        moving |= np.any(self.position != self.home, axis=1) & ~self.lies
        moving &= self.kind == STRIKE
        self._swing(np.flatnonzero(moving & ~self.lies), dt)
        self._roll(np.flatnonzero(moving & self.lies), dt)
        for n in np.flatnonzero(moving).tolist():
            self.objects[self._object_of[n]].position = self.position[n].copy()

    def _swing(self, which: np.ndarray, dt: float) -> None:
        p, v = self.position[which], self.velocity[which]
        v += dt * (49.0 * (self.home[which] - p) - 3.5 * v)
        self.position[which], self.velocity[which] = p + dt * v, v

    def _roll(self, which: np.ndarray, dt: float) -> None:
        p, v, r = self.position[which], self.velocity[which], self.radius[which]
        v[:, 1] -= GRAVITY * dt
        p += dt * v
        below = p[:, 1] < r
        bounces = below & (v[:, 1] < -REST)
        p[below, 1] = r[below]
        v[bounces] *= [0.8, -BOUNCE, 0.8]
        v[below & ~bounces, 1] = 0.0
        rolls = p[:, 1] <= r + 1e-3
        v[rolls] *= np.exp(-(ROLLING + FRICTION) * dt)
        v[rolls & (np.linalg.norm(v, axis=1) < AT_REST)] = 0.0
        self.position[which], self.velocity[which] = p, v

    def move(self, name: str, position: np.ndarray) -> None:
        """Put a ball somewhere."""
        if name not in self.names or self.kind[n := self.names.index(name)] != STRIKE:
            return
        place = a_place(position, name)
        if self.lies[n]:
            place[1] = max(place[1], self.radius[n])
        self.position[n], self.velocity[n] = place, 0.0
        if not self.lies[n]:
            self.home[n] = place
        self.objects[self._object_of[n]].position = place.copy()

    def depth(self, n: int, capsules: np.ndarray, body: Body) -> tuple[float, int]:
        """How deep [m] a body of capsule ends [2, P, 3] is in obstacle n, and with what part:
        below 0 it keeps clear of it."""
        a, b = capsules
        u = SAMPLES[:, None, None]
        points = (1 - u) * a + u * b  # [S, P, 3]
        radius = (1 - SAMPLES[:, None]) * body.radius_start + SAMPLES[:, None] * body.radius_end
        high = self.height[n]
        middle = high + 0.5 * BAR if self.kind[n] == UNDER else high - 0.5 * BAR
        yaw = self.yaw[n]
        c, s = np.cos(yaw), np.sin(yaw)
        at = points - self.position[n] - [0.0, middle, 0.0]
        aside, along = c * at[..., 0] - s * at[..., 2], s * at[..., 0] + c * at[..., 2]
        if self.kind[n] == OVER:  # a hurdle is open below, but nobody gets through there
            at[..., 1] = np.maximum(at[..., 1], 0.0)
        off = np.stack([aside, at[..., 1], along], axis=-1)
        half = np.array([0.5 * self.width[n], 0.5 * BAR, 0.5 * BAR])
        outside = np.linalg.norm(np.maximum(np.abs(off) - half, 0.0), axis=-1)
        depth = radius - outside
        part = int(np.argmax(depth.max(axis=0)))
        return float(depth.max()), part
