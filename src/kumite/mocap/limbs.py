"""Two legs, two arms and a head found by a skeleton's shape alone, for names that say nothing.

A limb is a branch with a twin: two children of one joint with the same count of joints and the
same bone lengths. The pair nearest the root are the legs, the next pair the arms; toes, then head
and up tell left from right. Nothing is guessed when the shape is not that of a person.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kumite.clip import NO_PARENT, Skeleton

_LIKE = 0.12  # twins' bone lengths may differ by this part
_MOST_BRANCHES = 16  # of three joints or more on one joint: a hand has five
_MOST_IN_ROW = 40  # joints of a limb
_SHORT = 1e-6  # of the longest bone: shorter bones are helpers


@dataclass(frozen=True)
class Limbs:
    """Chains of joints, left and right, from the trunk outwards."""

    legs: tuple[list[int], list[int]]  # thigh, shin, foot and maybe toe
    arms: tuple[list[int], list[int]]  # maybe clavicle, then upper arm, forearm, hand
    head: int | None


def find_limbs(skeleton: Skeleton) -> Limbs | None:
    """The limbs of a person, or None where the shape does not settle them."""
    lengths = np.linalg.norm(skeleton.offsets, axis=1)
    lengths[0] = 0.0
    if not lengths.any():
        return None
    size = _branch_sizes(skeleton, lengths)
    pairs: list[tuple[int, list[int], list[int]]] = []
    children: list[list[int]] = [[] for _ in skeleton.names]
    for j in range(1, len(skeleton)):
        children[int(skeleton.parents[j])].append(j)
    shortest = _SHORT * float(lengths.max())
    for joint, below in enumerate(children):
        if len(below) < 2:
            continue
        chains = [_main_chain(c, children, lengths, size, shortest) for c in below]
        chains = [c for c in chains if len(c) >= 3]
        if len(chains) > _MOST_BRANCHES:
            continue
        for a in range(len(chains)):
            for b in range(a + 1, len(chains)):
                if _twins(chains[a], chains[b], lengths):
                    pairs.append((joint, chains[a], chains[b]))
    depth = _depths(skeleton)
    # Fingers are twins too, but below a hand: keep pairs whose joint lies in no other pair's chain.
    inside = {j for _, a, b in pairs for j in (*a, *b)}
    pairs = sorted((p for p in pairs if p[0] not in inside), key=lambda p: depth[p[0]])
    if len(pairs) != 2 or pairs[0][0] == pairs[1][0]:
        return None
    (hips, *legs), (chest, *arms) = pairs
    legs = [_from_longest(leg, lengths, before=0, after=2) for leg in legs]
    arms = [_from_longest(arm, lengths, before=1, after=1) for arm in arms]
    rest = skeleton.rest_positions
    up = rest[chest] - rest[hips]
    toes = [_forward(skeleton, leg, rest) for leg in legs]
    lateral = np.cross(up, toes[0] + toes[1])
    if np.linalg.norm(lateral) < 1e-9:
        return None
    if _side(rest, legs, lateral) is None or _side(rest, arms, lateral) is None:
        return None
    left_leg, right_leg = legs if _side(rest, legs, lateral) else legs[::-1]
    left_arm, right_arm = arms if _side(rest, arms, lateral) else arms[::-1]
    in_arms = {j for a in arms for j in a}
    necks = [c for c in children[chest] if c not in in_arms and size[c] > 0]
    head = necks[0] if len(necks) == 1 else None
    while head is not None and len(children[head]) == 1:
        head = children[head][0]
    return Limbs((left_leg, right_leg), (left_arm, right_arm), head)


def _from_longest(chain: list[int], lengths: np.ndarray, before: int, after: int) -> list[int]:
    """The joints around a limb's two longest bones in a row: they meet at the knee or elbow.

    With a clavicle nearly as long as the forearm this takes the shoulder for the elbow; names or
    a mapping beat it.
    """
    bend = max(range(1, len(chain) - 1), key=lambda k: lengths[chain[k]] + lengths[chain[k + 1]])
    return chain[max(bend - 1 - before, 0) : bend + 1 + after]


def _side(rest: np.ndarray, pair: list[list[int]], lateral: np.ndarray) -> bool | None:
    """Whether the first of a pair is the left one; None if both lie in the middle."""
    gap = float((rest[pair[0][-1]] - rest[pair[1][-1]]) @ lateral)
    return None if abs(gap) < 1e-9 else gap > 0


def _forward(skeleton: Skeleton, leg: list[int], rest: np.ndarray) -> np.ndarray:
    """From the ankle to the end of the foot, in the rest pose."""
    ends = [rest[p] + o for p, o in zip(skeleton.tip_parents, skeleton.tip_offsets) if p in leg]
    end = ends[-1] if ends else rest[leg[-1]]
    return end - rest[leg[2]]


def _depths(skeleton: Skeleton) -> np.ndarray:
    depth = np.zeros(len(skeleton), dtype=np.int64)
    for j in range(1, len(skeleton)):
        depth[j] = depth[skeleton.parents[j]] + 1
    return depth


def _branch_sizes(skeleton: Skeleton, lengths: np.ndarray) -> np.ndarray:
    """The longest way [J] from above each joint down to a leaf, along the bones."""
    size = lengths.copy()
    for j in range(len(skeleton) - 1, 0, -1):
        parent = int(skeleton.parents[j])
        if parent != NO_PARENT:
            size[parent] = max(size[parent], lengths[parent] + size[j])
    return size


def _main_chain(
    joint: int, children: list[list[int]], lengths: np.ndarray, size: np.ndarray, shortest: float
) -> list[int]:
    """From a joint down its longest branch, without joints that lie where their parent does."""
    chain = [joint]
    while children[chain[-1]] and len(chain) < _MOST_IN_ROW:
        chain.append(max(children[chain[-1]], key=lambda c: size[c]))
    # Of joints in one place the last turns the bone below.
    return [
        j
        for j, after in zip(chain, [*chain[1:], None])
        if after is None or lengths[after] > shortest
    ]


def _twins(a: list[int], b: list[int], lengths: np.ndarray) -> bool:
    if len(a) != len(b):
        return False
    la, lb = lengths[a], lengths[b]
    return bool(np.all(np.abs(la - lb) <= _LIKE * np.maximum(np.maximum(la, lb), 1e-12) + 1e-9))
