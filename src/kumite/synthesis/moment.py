"""A pose and how it moves: what passes between a played character, the solver and a response."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite import rotation
from kumite.brief import brief
from kumite.checks import freeze
from kumite.clip import Skeleton, forward_kinematics


@brief
@dataclass(frozen=True)
class Moment:
    """One body at one time, in the scene."""

    root_position: np.ndarray  # [3] m
    wxyz: np.ndarray  # [J, 4] from the parent's axes; the root's from the world's
    root_velocity: np.ndarray  # [3] m/s
    joint_velocity: np.ndarray  # [J, 3] rad/s, in each joint's own axes

    def __post_init__(self) -> None:
        freeze(
            self,
            "moment",
            root_position=(float, (3,)),
            wxyz=(float, ("J", 4)),
            root_velocity=(float, (3,)),
            joint_velocity=(float, ("J", 3)),
        )

    @staticmethod
    def between(root_position: np.ndarray, wxyz: np.ndarray, fps: float) -> Moment:
        """The later of two poses ([2, 3], [2, J, 4]) a frame apart, moving as it came there."""
        return Moment(
            root_position[1],
            wxyz[1],
            (root_position[1] - root_position[0]) * fps,
            rotation.log(rotation.multiply(rotation.conjugate(wxyz[0]), wxyz[1])) * fps,
        )

    def after(self, seconds: float) -> tuple[np.ndarray, np.ndarray]:
        """Root [3] and rotations [J, 4] if nothing changed for so long (before now if negative)."""
        turn = rotation.exp(seconds * self.joint_velocity)
        return self.root_position + seconds * self.root_velocity, rotation.multiply(self.wxyz, turn)

    def joints(self, skeleton: Skeleton) -> tuple[np.ndarray, np.ndarray]:
        """Positions [J, 3] m and velocities [J, 3] m/s of the joints."""
        dt = 1e-4
        poses = [self.after(-dt), self.after(dt), self.after(0.0)]
        roots, turns = (np.array(x) for x in zip(*poses))
        position, _ = forward_kinematics(skeleton, roots, turns)
        return position[2], (position[1] - position[0]) / (2.0 * dt)
