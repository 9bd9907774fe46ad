"""A blow moves the body: a ragdoll that tries to go on with what its character was doing.

Shum et al. 2012, section VII, let a physics engine move a struck body for a moment. Here MuJoCo
moves it, one step every 2 ms or less, by three sorts of forces:

- *Muscles.* At every joint a spring and damper pull to the motion that would have been played, each
  as strong as what hangs from the joint is heavy to turn: kp = ω² I, kd = 2 ω I, with one rate ω
  [1/s] a region. Both act on the state at the end of the step (stable PD: Tan, Liu & Turk 2011),
  so no gain can blow up. What the motion itself needs (gravity, inertia) is added as inverse
  dynamics: without a blow the body follows the motion.
- *Support.* A person balances; springs at the joints do not. The wrench on the root that the motion
  and a spring of its own ask for is carried by the planted feet: each gets its share, through the
  torques of its leg. With no foot planted it acts on the root itself.
- *The blow*, an impulse spread over the time for which a fist is in contact.

Planted feet are welded to where they stand. Parts collide with the ground and with each other;
what overlaps in the motion already may go as deep as there, no deeper.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from kumite import rotation
from kumite.body import Body
from kumite.brief import brief
from kumite.checked import checked
from kumite.checks import freeze
from kumite.clip import SIDES, Skeleton, forward_kinematics
from kumite.errors import KumiteError
from kumite.kernels.overlap import deepest_overlaps
from kumite.synthesis import mjcf
from kumite.synthesis.moment import Moment
from kumite.synthesis.recoil import RECOIL, recoiling

# Olympic boxers' straight punches to a dummy's face: hand 9.14 ± 2.06 m/s, effective mass
# 2.9 ± 2.0 kg, 3427 N at the peak (Walilko, Viano & Bir, Br J Sports Med 39:710, 2005, abstract).
# For kicks no such figure is at hand: shin and foot by de Leva's shares, the least that arrives.
EFFECTIVE_MASS = {"hand": 2.9, "foot": 4.3}  # kg
CONTACT = 0.010  # s: with half a sine 26.5 N s peak at 4.2 kN, of the order measured there
GROUND = -1  # in the place of a part, of a pair that may collide
STEP = 0.002  # s, at most, of physics
FASTEST = 300.0  # m/s or rad/s at which a simulation has blown up; the hardest blows give half
HARDEST = 400.0  # m/s² or rad/s² that inverse dynamics follows: what is more is a jump, not motion
STRONGEST = 30.0  # m/s² likewise of the root: three times the weight is what legs give in a jump
SWIFTEST = 60.0  # rad/s likewise: capture turns a wrist over between two frames of 120 Hz
GIVEN = RECOIL / EFFECTIVE_MASS["hand"]  # m per N s that a struck segment gives without physics


@dataclass(frozen=True)
class Tone:
    """How stiffly each region follows: rates [1/s], 0 for limp."""

    root: float = 7.0
    trunk: float = 12.0
    neck: float = 10.0
    arm: float = 14.0
    leg: float = 22.0

    def of_joints(self, skeleton: Skeleton) -> np.ndarray:
        """Rates [J]; the root's is the support's."""
        region = {"neck": self.neck, "head": self.neck, "chest": self.trunk, "pelvis": self.trunk}
        for part in ("clavicle", "upper_arm", "forearm", "hand"):
            region[part] = self.arm
        for part in ("thigh", "shin", "foot", "toe"):
            region[part] = self.leg
        own = {joint: region[mjcf.kind_of(r)] for r, joint in skeleton.roles.items()
               if mjcf.kind_of(r) in region}  # fmt: skip
        out = np.full(len(skeleton), self.trunk)
        for j in range(len(skeleton)):
            limb = j and out[skeleton.parents[j]] in (self.arm, self.leg)
            out[j] = own.get(j, out[skeleton.parents[j]] if limb else self.trunk)
        out[0] = self.root
        return out


LIMP = Tone(0.0, 0.0, 0.0, 0.0, 0.0)


@checked
@brief
@dataclass(frozen=True)
class Pushed:
    """A motion of T frames after a blow, the first one frame after it."""

    root_position: np.ndarray  # [T, 3] m
    wxyz: np.ndarray  # [T, J, 4]
    deviation: np.ndarray  # [T] m, mean distance of the joints from where they would have been
    kinetic: np.ndarray  # [T] J, of the whole body
    end: Moment  # the last frame, and how it moves
    impulse: np.ndarray  # [3] N s that the body took of the blow
    slip: float  # m that the most moved planted foot is away from where it stood, at worst
    physical: bool  # False: the solver failed, the motion gives way kinematically instead
    why: str = ""  # it failed

    def __post_init__(self) -> None:
        frames, joints = self.wxyz.shape[:2]
        freeze(
            self,
            "pushed",
            root_position=(float, (frames, 3)),
            wxyz=(float, (frames, joints, 4)),
            deviation=(float, (frames,)),
            kinetic=(float, (frames,)),
            impulse=(float, (3,)),
        )


@checked
def blow_impulse(velocity: np.ndarray, limb: str = "hand") -> np.ndarray:
    """The impulse [3] N s of a limb that lands at a velocity [3] m/s relative to what it hits.

    Effective mass × speed, against a part as heavy as a head; a lighter one takes less of it, as
    :meth:`Ragdoll.push` sees to. limb is "hand" or "foot", with or without its side.
    """
    return EFFECTIVE_MASS[mjcf.kind_of(limb)] * np.asarray(velocity, dtype=np.float64)


def has_physics() -> bool:
    """Whether MuJoCo is installed."""
    try:
        _mujoco()
    except KumiteError:
        return False
    return True


def _mujoco() -> Any:
    try:
        import mujoco
    except ImportError:
        raise KumiteError(
            "physical reactions need MuJoCo, which is not installed; expected the extra: "
            "pip install 'kumite[physics]'"
        ) from None
    return mujoco


@checked
class Ragdoll:
    """One body that can be pushed. The same push gives the same bytes."""

    def __init__(
        self,
        skeleton: Skeleton,
        body: Body,
        fps: float,
        *,
        tone: Tone | None = None,
        gravity: float = 9.81,
    ) -> None:
        """fps: frames of motion a second. Errors: no MuJoCo; a body that is not the skeleton's."""
        self._mj = mj = _mujoco()
        if not (np.isfinite(fps) and fps > 0):
            raise KumiteError(f"ragdoll: {fps} frames a second, expected more than 0")
        if np.any(body.joint >= len(skeleton)):
            raise KumiteError("ragdoll: the body has parts on joints that the skeleton lacks")
        self.skeleton, self.body, self.fps = skeleton, body, float(fps)
        self.steps = int(np.ceil(1.0 / (fps * STEP) - 1e-9))  # of physics, a frame
        self.dt = 1.0 / (fps * self.steps)
        self.tone = tone or Tone()
        self._rate = self.tone.of_joints(skeleton)
        self._neutral = mjcf.neutral_pose(skeleton)
        self._model = mj.MjModel.from_xml_string(mjcf.mjcf(skeleton, body, self.dt, gravity))
        self._data = mj.MjData(self._model)
        # MuJoCo goes down each limb before the next; a skeleton need not.
        bodies = [
            mj.mj_name2id(self._model, mj.mjtObj.mjOBJ_BODY, f"j{j}") for j in range(len(skeleton))
        ]
        self._order = np.argsort(bodies)  # [J] the skeleton's joint, of each of MuJoCo's
        self._rate = self._rate[self._order]
        self._range = self._model.jnt_range[1:, 1].copy()
        # MuJoCo sorts pairs its own way.
        part = {
            mj.mj_name2id(self._model, mj.mjtObj.mjOBJ_GEOM, f"p{p}"): p for p in range(len(body))
        }
        ends = zip(self._model.pair_geom1.tolist(), self._model.pair_geom2.tolist())
        self._pairs = np.array([(part.get(a, GROUND), part.get(b, GROUND)) for a, b in ends]).T
        self._radius = 0.5 * (body.radius_start + body.radius_end)
        self._feet = [skeleton.roles.get(f"{side}_foot") for side in SIDES]
        self._pins = [f for f, foot in enumerate(self._feet) if foot is not None]

    def push(
        self,
        now: Moment,
        targets: tuple[np.ndarray, np.ndarray],
        planted: np.ndarray,
        joint: int,
        point: np.ndarray,
        impulse: np.ndarray,
        seconds: float,
        *,
        striking_mass: float = EFFECTIVE_MASS["hand"],
    ) -> Pushed:
        """What a blow does to a body, for some time.

        now: the pose struck. targets: roots [T, 3] and rotations [T, J, 4] that it would have shown
        in the frames that follow; the last is held if the time is longer. planted [2] bool: feet
        that stay where they are. joint: struck, at ``point`` [3] m of the world, by ``impulse``
        [3] N s. seconds: how long, a frame at the least. striking_mass: kg behind the impulse,
        which is cut so that the struck point leaves no faster than the blow came; 0 takes it as it
        is.

        Errors: shapes or numbers that make no push. A simulation that fails is no error: the answer
        then says so and gives way kinematically.
        """
        point, impulse = np.asarray(point, dtype=float), np.asarray(impulse, dtype=float)
        frames = max(1, round(seconds * self.fps))
        roots, turns = self._checked(now, targets, joint, point, impulse, frames)
        held = np.array([bool(planted[f]) for f in self._pins], dtype=bool)
        try:
            # Overflow on the way to a blow-up is seen by the test for it, not by a warning.
            with np.errstate(all="ignore"):
                self._set_up(now, roots, turns, held)
                impulse = impulse * self._share(joint, point, impulse, striking_mass)
                return self._simulate(now, roots, turns, held, joint, point, impulse)
        except _BlownUp as failure:
            return self._given_way(now, roots, turns, joint, point, impulse, str(failure))

    def _checked(self, now, targets, joint, point, impulse, frames) -> tuple[np.ndarray, ...]:
        """Targets [frames, …], the last one held."""
        joints = len(self.skeleton)
        roots, turns = (np.asarray(x, dtype=np.float64) for x in targets)
        if now.wxyz.shape != (joints, 4):
            raise KumiteError(f"ragdoll: a pose of {len(now.wxyz)} joints, expected {joints}")
        if len(roots) == 0 or roots.shape[1:] != (3,) or turns.shape != (len(roots), joints, 4):
            raise KumiteError(
                f"ragdoll: targets {list(roots.shape)} and {list(turns.shape)}, "
                f"expected [T, 3] and [T, {joints}, 4] with T > 0"
            )
        if not 0 <= joint < joints:
            raise KumiteError(f"ragdoll: joint {joint} is struck, expected 0 … {joints - 1}")
        if not all(np.all(np.isfinite(x)) for x in (roots, turns, point, impulse)):
            raise KumiteError("ragdoll: targets, point and impulse must be finite")
        at = np.minimum(np.arange(frames), len(roots) - 1)
        return roots[at], turns[at]

    # What is asked for -------------------------------------------------------------------------

    def _states(self, roots: np.ndarray, turns: np.ndarray) -> np.ndarray:
        """Poses as MuJoCo's qpos [N, nq]."""
        ball = rotation.multiply(rotation.conjugate(self._neutral), turns)
        return np.concatenate([roots, ball[:, self._order].reshape(len(roots), -1)], axis=1)

    def _wanted(self, now: Moment, roots: np.ndarray, turns: np.ndarray) -> tuple[np.ndarray, ...]:
        """Target states [S, nq], speeds [S, nv] and accelerations [S, nv] at every physics step.

        Cubic splines through the frames, from the pose struck and its velocity on.
        """
        frames = len(roots)
        q = rotation.continuous(np.concatenate([now.wxyz[None], turns]))
        turning = np.concatenate([np.zeros((len(q[0]), 1)), now.joint_velocity], axis=1)
        starts = (now.root_velocity, 0.5 * rotation.multiply(q[0], turning))
        at = np.arange(1, frames * self.steps + 1) / self.steps
        smooth = []
        for knots, start in zip((np.concatenate([now.root_position[None], roots]), q), starts):
            ends: Any = ((1, start / self.fps), (2, 0.0 * start))  # SciPy's stubs know names only
            smooth.append(CubicSpline(np.arange(frames + 1), knots, bc_type=ends)(at))
        states = self._states(smooth[0], rotation.normalize(smooth[1]))
        start = self._states(now.root_position[None], now.wxyz[None])[0]
        speeds = np.empty((len(at) + 1, self._model.nv))
        speeds[0] = np.concatenate([now.root_velocity, now.joint_velocity[self._order].ravel()])
        for s in range(len(at)):
            before = states[s - 1] if s else start
            self._mj.mj_differentiatePos(self._model, speeds[s + 1], self.dt, before, states[s])
        np.clip(speeds[:, 3:], -SWIFTEST, SWIFTEST, out=speeds[:, 3:])
        accelerations = np.clip(np.diff(speeds, axis=0) / self.dt, -HARDEST, HARDEST)
        np.clip(accelerations[:, :3], -STRONGEST, STRONGEST, out=accelerations[:, :3])
        return states, speeds[1:], accelerations

    def _set_up(self, now: Moment, roots: np.ndarray, turns: np.ndarray, held: np.ndarray) -> None:
        """The state struck; pins, limits and depths that suit it."""
        mj, m, d = self._mj, self._model, self._data
        mj.mj_resetData(m, d)
        all_roots = np.concatenate([now.root_position[None], roots])
        all_turns = np.concatenate([now.wxyz[None], turns])
        states = self._states(all_roots, all_turns)
        # A capture that bends further than people do is right, and the range is not.
        angles = rotation.angle(states[:, 7:].reshape(len(states), -1, 4), rotation.IDENTITY_WXYZ)
        m.jnt_range[1:, 1] = np.maximum(self._range, angles.max(axis=0, initial=0.0) + 0.05)
        d.qpos[:] = states[0]
        d.qvel[:3] = now.root_velocity
        d.qvel[3:] = np.clip(now.joint_velocity[self._order].ravel(), -SWIFTEST, SWIFTEST)
        m.dof_damping[:] = 0.0
        position, world = forward_kinematics(self.skeleton, all_roots, all_turns)
        self._stood = [position[0, self._feet[f]].copy() for f in self._pins]
        for i, f in enumerate(self._pins):
            d.mocap_pos[i] = position[0, self._feet[f]]
            d.mocap_quat[i] = world[0, self._feet[f]]
            d.eq_active[i] = held[i]
        m.pair_margin[:] = -self._depths(position, world, held)
        mj.mj_forward(m, d)  # last: the solver starts from what it finds here

    def _depths(self, position: np.ndarray, world: np.ndarray, held: np.ndarray) -> np.ndarray:
        """How deep [pairs] the motion itself puts parts into the ground and into each other [m]."""
        body = self.body
        start, end = (
            position[:, body.joint] + rotation.rotate(world[:, body.joint], x)
            for x in (body.start, body.end)
        )
        lowest = np.minimum(start[..., 1], end[..., 1]).min(axis=0) - self._radius
        ground = np.maximum(-lowest, 0.0)
        for i, f in enumerate(self._pins):
            if held[i]:  # the weld carries it; so it does what hangs from it, its toes
                ground[np.isin(body.joint, self._below(self._feet[f]))] = 1.0
        first, second = self._pairs
        among = (first != GROUND) & (second != GROUND)
        found = np.empty(int(among.sum()))
        deepest_overlaps(start, end, self._radius, first[among], second[among], found)
        out = ground[np.maximum(first, second)]
        out[among] = found
        return out

    def _below(self, joint: int | None) -> list[int]:
        found = [joint]
        for j in range(len(self.skeleton)):
            if self.skeleton.parents[j] in found:
                found.append(j)
        return [j for j in found if j is not None]

    def _inertia(self) -> np.ndarray:
        """What hangs from each joint, about each of its axes [nv - 6], kg m²."""
        unit, row = np.zeros(self._model.nv), np.empty(self._model.nv)
        out = np.empty(self._model.nv)
        for i in range(len(out)):
            unit[i] = 1.0
            self._mj.mj_mulM(self._model, self._data, row, unit)
            out[i], unit[i] = row[i], 0.0
        return out[6:]

    def _share(self, joint: int, point: np.ndarray, impulse: np.ndarray, striking: float) -> float:
        """How much (0..1) of an impulse the struck point takes before it flees as fast as the blow.

        A point of effective mass m (1/m = n J M⁻¹ Jᵀ n along the blow n) leaves at impulse / m.
        """
        size = float(np.linalg.norm(impulse))
        if size == 0.0 or striking <= 0.0:
            return 1.0
        mj, m, d = self._mj, self._model, self._data
        jacobian, easing = np.empty((3, m.nv)), np.empty((1, m.nv))
        body = mj.mj_name2id(m, mj.mjtObj.mjOBJ_BODY, f"j{joint}")
        mj.mj_jac(m, d, jacobian, None, point, body)
        along = (impulse / size) @ jacobian
        mj.mj_solveM(m, d, easing, along[None])
        return min(1.0, 1.0 / max(float(along @ easing[0]) * striking, 1e-12))

    # Moving ------------------------------------------------------------------------------------

    def _simulate(self, now, roots, turns, held, joint, point, impulse) -> Pushed:
        mj, m, d = self._mj, self._model, self._data
        states, speeds, accelerations = self._wanted(now, roots, turns)
        dt, nv, frames = self.dt, m.nv, len(roots)
        inertia = self._inertia()
        rate = np.repeat(self._rate[1:], 3)
        stiff = rate**2 * inertia
        damping = 2.0 * rate * inertia + dt * stiff
        m.dof_damping[6:] = damping  # MuJoCo takes it at the end of the step
        root_stiff, root_damping = self._rate[0] ** 2, 2.0 * self._rate[0]
        struck = mj.mj_name2id(m, mj.mjtObj.mjOBJ_BODY, f"j{joint}")
        pulse = np.sin(np.pi * (np.arange(n := max(1, round(CONTACT / dt))) + 0.5) / n)
        pulse /= pulse.sum() * dt
        in_joint = rotation.rotate(rotation.conjugate(d.xquat[struck]), point - d.xpos[struck])
        carried = [self._feet[f] for i, f in enumerate(self._pins) if held[i]]
        carrying = [mj.mj_name2id(m, mj.mjtObj.mjOBJ_BODY, f"j{j}") for j in carried]
        error, force, none = np.empty(nv), np.empty(nv), np.zeros(3)
        turn, about, where = np.empty(3), np.empty(3), np.empty(3)
        warnings = mj.mjtWarning
        bad = (warnings.mjWARN_BADQPOS, warnings.mjWARN_BADQVEL, warnings.mjWARN_BADQACC)
        out_root, out_wxyz = np.empty((frames, 3)), np.empty((frames, len(self.skeleton), 4))
        kinetic, slip = np.empty(frames), 0.0
        for s in range(frames * self.steps):
            mj.mj_step1(m, d)
            mj.mj_differentiatePos(m, error, 1.0, d.qpos, states[s])
            wanted = accelerations[s].copy()
            wanted[:6] += root_stiff * error[:6] + root_damping * (speeds[s, :6] - d.qvel[:6])
            mj.mj_mulM(m, d, force, wanted)
            force += d.qfrc_bias
            force[6:] += stiff * error[6:] + damping * speeds[s, 6:]
            if carrying:
                # The feet carry what the root is short of: the same wrench, taken about each foot,
                # acts on the ground; the root's own rows come to nothing.
                pull = force[:3] / len(carrying)
                mj.mju_rotVecQuat(turn, force[3:6], d.qpos[3:7])
                for foot in carrying:
                    mj.mju_cross(about, d.xpos[foot] - d.qpos[:3], pull)
                    about -= turn / len(carrying)
                    mj.mj_applyFT(m, d, -pull, about, d.xpos[foot], foot, force)
            if s < len(pulse):
                mj.mju_rotVecQuat(where, in_joint, d.xquat[struck])
                where += d.xpos[struck]
                mj.mj_applyFT(m, d, impulse * pulse[s], none, where, struck, force)
            if not np.all(np.isfinite(force)):
                raise _BlownUp(f"forces are not finite after {s * dt * 1000:.0f} ms")
            d.qfrc_applied[:] = force
            mj.mj_step2(m, d)
            fastest = float(np.abs(d.qvel).max())
            # Where MuJoCo itself has seen it, the state is the neutral pose again.
            if not fastest < FASTEST or any(d.warning[w].number for w in bad):
                raise _BlownUp(f"{fastest:.3g} m/s or rad/s after {(s + 1) * dt * 1000:.0f} ms")
            if (s + 1) % self.steps == 0:
                t = (s + 1) // self.steps - 1
                out_root[t] = d.qpos[:3]
                ball = rotation.normalize(d.qpos[3:].reshape(-1, 4))
                out_wxyz[t, self._order] = ball
                mj.mj_mulM(m, d, force, d.qvel)
                kinetic[t] = 0.5 * float(d.qvel @ force)
        out_wxyz = rotation.multiply(self._neutral, out_wxyz)
        position, _ = forward_kinematics(self.skeleton, out_root, out_wxyz)
        meant, _ = forward_kinematics(self.skeleton, roots, turns)
        for i, f in enumerate(self._pins):
            if held[i]:
                moved = position[:, self._feet[f]] - self._stood[i]
                slip = max(slip, float(np.linalg.norm(moved, axis=1).max()))
        deviation = np.linalg.norm(position - meant, axis=-1).mean(axis=-1)
        turning = np.empty((len(self.skeleton), 3))
        turning[self._order] = d.qvel[3:].reshape(-1, 3)
        end = Moment(out_root[-1], out_wxyz[-1], d.qvel[:3], turning)
        return Pushed(out_root, out_wxyz, deviation, kinetic, end, impulse, slip, True)

    def _given_way(self, now, roots, turns, joint, point, impulse, why: str) -> Pushed:
        """The kinematic answer: the motion goes on, and the joints below the blow give."""
        size = np.linalg.norm(impulse)
        most = 30.0 * EFFECTIVE_MASS["hand"]  # N s; beyond any blow, and the turns stay sane
        blow = GIVEN * impulse * min(1.0, most / max(float(size), 1e-12))
        out = recoiling(self.skeleton, roots, turns, joint, point, blow, self.fps)
        poses = np.concatenate([now.wxyz[None], out])[-2:]
        places = np.concatenate([now.root_position[None], roots])[-2:]
        end = Moment.between(places, poses, self.fps)
        position, _ = forward_kinematics(self.skeleton, roots, out)
        meant, _ = forward_kinematics(self.skeleton, roots, turns)
        deviation = np.linalg.norm(position - meant, axis=-1).mean(axis=-1)
        still = np.zeros(len(roots))
        return Pushed(roots, out, deviation, still, end, impulse, 0.0, False, why)


class _BlownUp(Exception):
    """The simulation has left what a body can do."""
