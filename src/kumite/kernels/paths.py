"""Paths through the motion graph that lead to an avoidance in time (Oshita & Masaoka 2011, 3)."""

from __future__ import annotations

import numpy as np

from kumite.kernels.avoid import DEPTH, gap, lay, middle, put_body, time_path, time_scale
from kumite.kernels.cells import look_up
from kumite.kernels.jit import kernel, lean_kernel
from kumite.kernels.weighing import weigh_all


@kernel
def soonest(action_start, stretch, first, last, target, part_of, middle, out):
    """Frames [N] from each state to the middle of a part at least; infinite where there is none.

    middle [A]: library frames. Every way is tried until none is shorter (Bellman and Ford).
    """
    out[:] = np.inf
    changed = True
    while changed:
        changed = False
        for n in range(action_start.shape[0] - 1):
            for a in range(action_start[n], action_start[n + 1]):
                s = stretch[a]
                t = out[target[s]] + (last[s] - first[s] + 1)
                for p in range(part_of[s], part_of[s + 1]):
                    t = min(t, middle[p] - (first[s] - 1))
                if t < out[n]:
                    out[n] = t
                    changed = True


@lean_kernel
def enumerate_paths(state, ahead, low, high, earlier, graph, node, way, gone, path, length, part):
    """Paths [C, D] from a state whose last edge avoids between ``low`` and ``high`` frames from now
    (exclusive), ``ahead`` of which pass before the state. Of the other edges at most
    ``earlier`` avoid, too. Depth first, actions in order.

    length [C], part [C]: edges of each, and the part. node, way, gone [D]: room to work in. Returns
    how many there are, C + 1 where there are more than there is room for; those of more than D
    edges are left out.
    """
    count, room = 0, length.shape[0]
    d = 0
    node[0], gone[0], way[0] = state, ahead, graph.action_start[state]
    if ahead + graph.soonest[state] >= high:
        return 0
    while d >= 0:
        a = way[d]
        if a == graph.action_start[node[d] + 1]:
            d -= 1
            continue
        way[d] = a + 1
        s = graph.stretch[a]
        before = graph.first[s] - 1
        for p in range(graph.part_of[s], graph.part_of[s + 1]):
            middle = gone[d] + 0.5 * (graph.begins[p] + graph.ends[p]) - before
            if low < middle < high:
                if count == room:
                    return count + 1
                for k in range(d):
                    path[count, k] = graph.stretch[way[k] - 1]
                path[count, d] = s
                length[count] = d + 1
                part[count] = p
                count += 1
        after = gone[d] + graph.last[s] - before
        to = graph.target[s]
        if graph.part_of[s] < graph.part_of[s + 1]:
            left = earlier - 1
            for k in range(d):
                other = graph.stretch[way[k] - 1]
                if graph.part_of[other] < graph.part_of[other + 1]:
                    left -= 1
            if left < 0:
                continue
        if d + 1 < DEPTH and after + graph.soonest[to] < high:
            d += 1
            node[d], gone[d], way[d] = to, after, graph.action_start[to]
    return count


@lean_kernel
def foresee(main, now, graph, volumes, attacks, scratch, gaps):
    """Distances [T] of an attack's samples to the body if the present edge just goes on and then
    stays as it ends.
    """
    lay(scratch.none, 0, now, graph, scratch)
    for n in range(attacks.sample[main], attacks.sample[main + 1]):
        x = min(max(attacks.when[n], 0.0) * graph.fps / now.slowness, scratch.upto[0])
        row = min(int(now.phase + x), now.stop)
        share, after = now.phase + x - row, min(row + 1, now.stop)
        everyone = volumes.radius.shape[0]
        put_body(volumes, 0, everyone, row, share, after, scratch.anchor[0], scratch.body)
        gaps[n] = np.inf
        for i in range(attacks.count[main]):
            px, py, pz = attacks.centre[n, i, 0], attacks.centre[n, i, 1], attacks.centre[n, i, 2]
            r = attacks.radius[main, i]
            gaps[n] = min(gaps[n], gap(px, py, pz, r, scratch.body, volumes.radius, 0, everyone))


@kernel
def find(
    state, facing, main, aim, window, use_index, stamp, now, graph, volumes, attacks, weighing,
    masks, index, room,
):  # fmt: skip
    """The best path for an attack: by the index where it knows one, else by trying all.

    Returns (candidates, best or -1, whether it leaves where the attack comes, by the index).
    Candidates are left in the room's arrays; more than fit there are counted only.
    """
    ahead = now.stop - now.phase
    low, high = (aim - 0.5 * window) * graph.fps, (aim + 0.5 * window) * graph.fps
    path, length, part = room.path, room.length, room.part
    present = 0
    if now.stretch >= 0:  # what is under way may do, with its timing mended
        for p in range(graph.part_of[now.stretch], graph.part_of[now.stretch + 1]):
            middle = 0.5 * (graph.begins[p] + graph.ends[p]) - now.phase
            if low < middle < high and middle > 0.0:
                length[present], part[present] = 0, p
                present += 1
    if use_index and state >= 0:
        count = look_up(
            state, facing, ahead, low, high, attacks, main, weighing.widest, index, stamp,
            room.turn, room.seen, room.seen_path, room.found,
            path[present:], length[present:], part[present:],
        )  # fmt: skip
        count += present
        if count <= length.shape[0]:
            best, avoids = weigh_all(
                count, path, length, part, main, aim, now, graph, volumes, attacks, weighing,
                masks, room.scratch, room.outcome, room.scores,
            )  # fmt: skip
            if avoids:
                return count, best, True, True
    count, best, avoids = 0, -1, False
    # Who avoids once for nothing, to avoid again, moves more than need be: only if all else fails.
    for earlier in range(2):
        count = present
        if state >= 0:
            count += enumerate_paths(
                state, ahead, low, high, earlier, graph, room.node, room.way, room.gone,
                path[present:], length[present:], part[present:],
            )  # fmt: skip
        best, avoids = weigh_all(
            min(count, length.shape[0]), path, length, part, main, aim, now, graph, volumes,
            attacks, weighing, masks, room.scratch, room.outcome, room.scores,
        )  # fmt: skip
        if avoids:
            break
    return count, best, avoids, False


@kernel
def timing(path, count, part, aim, now, graph, weighing, scratch):
    """A path's frames and times, into scratch.at and scratch.when. Returns how many.

    What cannot be timed is played as it was captured, or with the farthest scale allowed.
    """
    scale, _ = time_scale(path, count, part, aim, now, graph, weighing, scratch)
    scale = min(max(scale, 1.0 / weighing.most), weighing.most)
    lay(path, count, now, graph, scratch)
    frames, _ = time_path(path, count, part, aim, scale, now, graph, weighing, scratch)
    return frames


@kernel
def middles(count, path, length, part, now, graph):
    """Frames [C] from now to the middle of each path's avoidance."""
    out = np.empty(count)
    for c in range(count):
        out[c] = middle(path[c], length[c], part[c], now, graph)
    return out
