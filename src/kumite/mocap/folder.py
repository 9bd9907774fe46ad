"""Mocap files, a folder of them or a list, loaded as clips in our conventions.

Whatever a file does not say is inferred from the body (:mod:`kumite.mocap.infer`), and every such
thing is kept as a readable fact. What the caller gives beats ``kumite.toml`` beside the files,
which beats what the file states, which beats inference.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import numpy as np

from kumite.brief import brief
from kumite.checked import checked
from kumite.clip import Clip, ClipSet, concatenate, resample
from kumite.errors import KumiteError
from kumite.mocap import infer
from kumite.mocap.asfamc import AsfSkeleton, read_amc, read_asf
from kumite.mocap.bvh import read_bvh
from kumite.mocap.raw import RawMotion, to_clip
from kumite.mocap.rigid import fixed_bones
from kumite.mocap.roles import find_roles
from kumite.mocap.settings import SettingsTree
from kumite.mocap.sources import Source, check_options, find_files
from kumite.mocap.trim import without_apart

How = Literal["given", "settings", "stated", "inferred", "assumed"]
MOST_STRETCH = 0.03  # m; bones of one length may take a joint so far from where the file has it
_MOST_PROBLEMS = 20  # shown of a folder that cannot be read


@dataclass(frozen=True)
class Fact:
    """One thing about a clip and how it is known."""

    what: str
    value: str
    how: How
    why: str = ""
    doubt: str = ""  # what may be otherwise, and how to say it; empty where there is none

    def __str__(self) -> str:
        doubt = f"; in doubt: {self.doubt}" if self.doubt else ""
        return f"{self.what}: {self.value} ({self.how}{': ' if self.why else ''}{self.why}{doubt})"


@dataclass(frozen=True)
class BadFile:
    """A file that cannot be read, and why."""

    source: Path
    reason: str  # all that is wrong, without the file's name where the line is not known

    def __str__(self) -> str:
        return (
            self.reason
            if self.reason.startswith(str(self.source))
            else f"{self.source}: {self.reason}"
        )


@dataclass(frozen=True)
class ClipInfo:
    """Where a clip comes from and what was done to it on the way in."""

    name: str
    source: Path
    skeleton_source: Path | None  # the ASF of an AMC
    frames: int  # in the file
    file_fps: float
    metres_per_unit: float
    up_axis: str
    ground_height: float  # m; the height in the file that is y = 0 in the clip
    roles: Mapping[str, str]  # role -> joint name
    facts: tuple[Fact, ...]  # everything above that the file does not simply hold


@brief
@dataclass(frozen=True)
class Loaded:
    """Clips in metres, Y up, the ground at y = 0; and what is known about each."""

    clips: tuple[Clip, ...]
    info: tuple[ClipInfo, ...]  # one a clip
    bad: tuple[BadFile, ...] = ()  # with skip_bad: files that were gone on without

    def clip_set(self, fps: float | None = None) -> ClipSet:
        """All clips end to end at ``fps`` (their lowest rate by default).

        Errors: two skeletons, named with the first joint that differs.
        """
        return concatenate(self.clips, fps)

    def by_skeleton(self) -> list[list[Clip]]:
        """The clips in groups of one skeleton each, in order."""
        groups: list[list[Clip]] = []
        for clip in self.clips:
            for group in groups:
                if group[0].skeleton.same_as(clip.skeleton):
                    group.append(clip)
                    break
            else:
                groups.append([clip])
        return groups

    def report(self) -> list[str]:
        """Every fact once, with the clips that it holds for: what was inferred is never silent."""
        return self._told(lambda fact: True)

    def doubts(self) -> list[str]:
        """The facts that may be otherwise, each with the option that settles it."""
        return self._told(lambda fact: bool(fact.doubt))

    def _told(self, wanted: Callable[[Fact], bool]) -> list[str]:
        holders: dict[str, list[str]] = {}
        for info in self.info:
            for fact in filter(wanted, info.facts):
                holders.setdefault(str(fact), []).append(info.name)
        out = []
        for fact, names in holders.items():
            if len(names) == len(self.info):
                who = "every clip" if len(names) > 1 else names[0]
            else:
                who = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if names[3:] else "")
            out.append(f"{who}: {fact}")
        return out


@dataclass
class _Take:
    """One file on its way to a clip."""

    path: Path
    said: Mapping[str, Any]  # by kumite.toml
    raw: RawMotion
    roles: Mapping[str, int]  # role -> joint of ``raw``
    roles_how: Mapping[str, str]
    given_fps: How | None
    keep_stretch: bool  # whether the user said what becomes of position channels
    facts: list[Fact] = field(default_factory=list)


@checked
def load(
    source: Source,
    *,
    fps: float | None = None,
    file_fps: float | None = None,
    metres_per_unit: float | None = None,
    up_axis: str | None = None,
    ground: float | None = None,
    roles: Mapping[str, str] | None = None,
    names: Mapping[str, str] | None = None,
    encoding: str | None = None,
    joint_positions: str | None = None,
    keep_t_pose: bool | None = None,
    skip_bad: bool = False,
) -> Loaded:
    """Clips from a file, a folder (searched below too), a glob, or a list of these.

    Args:
        source: ``.bvh`` files, or ``.amc`` files with their ``.asf`` beside them.
        fps: resample every clip to this rate.
        file_fps: the files' own rate, where they do not state it or state a wrong one.
        metres_per_unit: length of one unit of the files [m].
        up_axis: ``'Y'``, ``'Z'``, ``'X'``, or one of these with a minus.
        ground: height of the floor in the files, Y up [m].
        roles: joint names by role, for joints whose names and place say too little.
        names: clip names by file name; otherwise a file's stem.
        encoding: of joint names, where it is not UTF-8; else guessed.
        joint_positions: what position channels below the hips count for: ``'channels'``, they are
            followed, within what bones of one length allow (else the file is refused);
            ``'offsets'``, nothing.
        keep_t_pose: keep frames at a take's ends that stand apart from it, too.
        skip_bad: go on without files that cannot be read; :attr:`Loaded.bad` names them.

    Errors: nothing to load, and everything that is wrong with any of the files, at once.
    """
    check_options(
        fps=fps,
        file_fps=file_fps,
        metres_per_unit=metres_per_unit,
        up_axis=up_axis,
        ground=ground,
        roles=roles,
        joint_positions=joint_positions,
    )
    given = {
        "fps": fps,
        "file_fps": file_fps,
        "metres_per_unit": metres_per_unit,
        "up_axis": None if up_axis is None else up_axis.upper(),
        "ground_height": ground,
        "encoding": encoding,
        "joint_positions": joint_positions,
        "keep_t_pose": keep_t_pose,
    }
    given = {k: v for k, v in given.items() if v is not None}
    files = find_files(source)
    settings = SettingsTree()
    said: dict[Path, Mapping[str, Any]] = {}
    wrong: dict[str, None] = {}  # in the settings: never gone on without
    for path, top in files:
        try:
            said[path] = settings.of(path, top)
        except KumiteError as error:
            wrong[str(error)] = None
    if wrong:
        raise KumiteError("\n".join(wrong))
    skeletons: dict[tuple[Path, str | None], AsfSkeleton] = {}
    takes: list[_Take] = []
    bad: dict[Path, str] = {}
    for path, _ in files:
        try:
            takes.append(_read(path, said[path], given, roles or {}, skeletons))
        except KumiteError as error:
            bad[path] = str(error)
    clip_names = _unique_names(takes, names or {}, [p for p, _ in files])
    clips: dict[Path, Clip] = {}
    info: dict[Path, ClipInfo] = {}
    for session in _sessions(takes):
        for take, scale, up, floor in _inferred(session, given, bad):
            clip = to_clip(
                take.raw,
                clip_names[take.path],
                metres_per_unit=scale,
                up_axis=up,
                ground_height=floor,
                roles=take.roles,
            )
            if not given.get("keep_t_pose", take.said.get("keep_t_pose", False)):
                clip, notes = without_apart(clip)
                take.facts += [Fact("repair", note, "inferred") for note in notes]
            rate = given.get("fps", take.said.get("fps"))
            try:
                clips[take.path] = resample(clip, rate) if rate else clip
            except KumiteError as error:
                bad[take.path] = str(error)
                continue
            info[take.path] = ClipInfo(
                clip_names[take.path],
                take.path,
                take.raw.skeleton_source,
                len(take.raw),
                take.raw.fps,
                scale,
                up,
                floor,
                {r: take.raw.skeleton.names[j] for r, j in take.roles.items()},
                tuple(take.facts),
            )
    bad_files = tuple(BadFile(p, bad[p]) for p, _ in files if p in bad)
    if bad_files and not (skip_bad and clips):
        _raise(bad_files, some_good=bool(clips))
    good = [t.path for t in takes if t.path in clips]
    return Loaded(tuple(clips[p] for p in good), tuple(info[p] for p in good), bad_files)


def _raise(bad: Sequence[BadFile], *, some_good: bool) -> None:
    """Every bad file with its reason; one reason of many files once."""
    reasons: dict[str, list[BadFile]] = {}
    for one in bad:
        reasons.setdefault(one.reason, []).append(one)
    lines = [
        f"{same[0]}" + (f" (and {len(same) - 1} more files like this)" if len(same) > 1 else "")
        for same in reasons.values()
    ]
    more = len(lines) - _MOST_PROBLEMS
    rest = [f"and {more} more problems"] if more > 0 else []
    hint = ["say --skip-bad (skip_bad=True) to go on without these files"] if some_good else []
    raise KumiteError("\n".join([*lines[:_MOST_PROBLEMS], *rest, *hint]))


# Finding -----------------------------------------------------------------------------------------


def find_asf(amc: Path) -> Path:
    """The skeleton of an AMC: ``02.asf`` for ``02_01.amc``, or the only ASF beside it.

    Errors: none, or several of which none has the AMC's name.
    """
    try:
        beside = sorted(
            p for p in amc.parent.iterdir() if p.suffix.lower() == ".asf" and p.is_file()
        )
    except OSError as error:
        raise KumiteError(f"{amc.parent}: cannot be read ({error.strerror})") from None
    stem = amc.stem.lower()
    mine = [
        p
        for p in beside
        if stem == p.stem.lower()
        or (stem.startswith(p.stem.lower()) and not stem[len(p.stem)].isalnum())
    ]
    if mine:
        return max(mine, key=lambda p: len(p.stem))
    if len(beside) == 1:
        return beside[0]
    there = ", ".join(p.name for p in beside) or "none there"
    raise KumiteError(
        f"{amc}: AMC without its ASF; expected {amc.stem.split('_')[0]}.asf, or only one ASF, "
        f"beside it ({there})"
    )


# Reading -----------------------------------------------------------------------------------------


def _read(
    path: Path,
    said: Mapping[str, Any],
    given: Mapping[str, Any],
    roles: Mapping[str, str],
    skeletons: dict[tuple[Path, str | None], AsfSkeleton],
) -> _Take:
    how: How | None = "given" if "file_fps" in given else "settings" if "file_fps" in said else None
    fps = given.get("file_fps", said.get("file_fps"))
    fps = None if fps is None else float(fps)
    encoding = given.get("encoding", said.get("encoding"))
    if path.suffix.lower() == ".amc":
        asf = find_asf(path)
        if (asf, encoding) not in skeletons:
            skeletons[asf, encoding] = read_asf(asf, encoding=encoding)
        raw = read_amc(path, skeletons[asf, encoding], fps=fps, encoding=encoding)
    else:
        raw = read_bvh(path, fps=fps, encoding=encoding)
    try:
        found = find_roles(raw.skeleton, {**said.get("roles", {}), **roles})
    except KumiteError as error:
        raise KumiteError(f"{raw.skeleton_source or path}: {error}") from None
    positions = given.get("joint_positions", said.get("joint_positions"))
    raw, joints = fixed_bones(raw, found.joints, follow=positions != "offsets")
    return _Take(path, said, raw, joints, found.how, how, positions == "offsets")


def _sessions(takes: Iterable[_Take]) -> list[list[_Take]]:
    """Takes of one skeleton in one folder, which share scale, up axis and floor."""
    groups: dict[tuple[Any, ...], list[_Take]] = {}
    for take in takes:
        skeleton = take.raw.skeleton
        key = (
            take.path.parent,
            skeleton.names,
            skeleton.parents.tobytes(),
            np.round(skeleton.offsets[1:], 3).tobytes(),
            tuple(take.roles.items()),
        )
        groups.setdefault(key, []).append(take)
    return list(groups.values())


def _inferred(
    session: list[_Take], given: Mapping[str, Any], bad: dict[Path, str]
) -> list[tuple[_Take, float, str, float]]:
    """Scale, up axis and floor of each take that has them; facts are added to the takes."""
    out = []
    shared: dict[Any, Any] = {}

    def settle(take: _Take, key: str, unit: str, guess: Any, among: tuple[Any, ...] = ()) -> Any:
        sources: tuple[tuple[How, Mapping[str, Any]], ...]
        sources = (("given", given), ("settings", take.said))
        for how, source in sources:
            if key in source:
                value = float(source[key]) if key != "up_axis" else source[key]
                take.facts.append(Fact(key, f"{_short(value)}{unit}", how))
                return value
        if (key, *among) not in shared:
            try:
                shared[(key, *among)] = guess(*among)
            except KumiteError as error:
                shared[(key, *among)] = error
        inferred = shared[(key, *among)]
        if isinstance(inferred, KumiteError):
            raise inferred
        known: How = "stated" if inferred.stated else "inferred"
        value = f"{_short(inferred.value)}{unit}"
        take.facts.append(Fact(key, value, known, inferred.why, inferred.doubt))
        return inferred.value

    first = session[0]
    raws = [t.raw for t in session]
    joints = first.roles
    for take in session:
        take.facts.append(_rate_fact(take))
        if take.raw.skeleton_source is not None:
            take.facts.append(
                Fact("skeleton", take.raw.skeleton_source.name, "inferred", "its name")
            )
        try:
            scale = settle(
                take, "metres_per_unit", "", lambda: infer.metres_per_unit(first.raw, joints)
            )
            up = settle(take, "up_axis", "", lambda: infer.up_axis(raws, joints))
            _refuse_stretch(take, scale)
        except KumiteError as error:
            bad[take.path] = str(error)
            continue
        floor = settle(
            take,
            "ground_height",
            " m",
            lambda scale, up: infer.ground_height(raws, joints, scale, up),
            (scale, up),
        )
        take.facts += _role_facts(take)
        take.facts += [Fact("repair", note, "inferred") for note in take.raw.notes]
        out.append((take, scale, up, floor))
    return out


def _refuse_stretch(take: _Take, scale: float) -> None:
    """Errors: joints that bones of one length take too far from where the file has them."""
    stretch = take.raw.stretch
    if stretch is None or take.keep_stretch or stretch.distance * scale <= MOST_STRETCH:
        return
    raise KumiteError(
        f"position channels move joint {stretch.joint!r} against its parent: with bones of one "
        f"length joints lie up to {stretch.distance * scale:.2f} m from where the file has them; "
        f"expected at most {MOST_STRETCH:g} m: say --joint-positions offsets (joint_positions = "
        '"offsets" in kumite.toml) for the bones of OFFSET'
    )


def _short(value: float | str) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def _rate_fact(take: _Take) -> Fact:
    how: How = take.given_fps or ("stated" if take.raw.fps_stated else "assumed")
    why = "" if how != "assumed" else "the file does not say; usual of CMU's AMC files"
    return Fact("file_fps", f"{take.raw.fps:.6g}", how, why)


def _role_facts(take: _Take) -> list[Fact]:
    names = take.raw.skeleton.names
    sources: tuple[tuple[str, How, str], ...] = (
        ("given", "given", ""),
        ("name", "inferred", "joint names"),
        ("tree", "inferred", "the tree's shape"),
    )
    facts = []
    for source, how, why in sources:
        pairs = [f"{r}={names[j]}" for r, j in take.roles.items() if take.roles_how[r] == source]
        if pairs:
            facts.append(Fact("roles", ", ".join(pairs), how, why))
    return facts


# Names -------------------------------------------------------------------------------------------


def _unique_names(
    takes: Sequence[_Take], given: Mapping[str, str], files: Sequence[Path]
) -> dict[Path, str]:
    """Clip names: given, from the settings, or the stem; told apart by their folders when equal.

    Errors: a given name for a file that is not there; a given name used twice.
    """
    keys = {k for p in files for k in (p.stem, p.name, p.as_posix())}
    for key in given:
        if key not in keys:
            raise KumiteError(f"a name for {key!r}, which is not among the files")
    chosen: dict[Path, str] = {}
    for take in takes:
        for key in (take.path.as_posix(), take.path.name, take.path.stem):
            if key in given:
                chosen[take.path] = given[key]
                break
        else:
            if "name" in take.said:
                chosen[take.path] = take.said["name"]
    twice = sorted({n for n in chosen.values() if list(chosen.values()).count(n) > 1})
    if twice:
        raise KumiteError(f"clip names given twice: {', '.join(twice)}")
    rest = [t.path for t in takes if t.path not in chosen]
    deepest = max((len(p.parts) for p in rest), default=1)
    names = {p: p.stem for p in rest}
    for depth in range(2, deepest + 2):
        all_names = [*chosen.values(), *names.values()]
        same = {n for n in all_names if all_names.count(n) > 1}
        for path in [p for p in rest if names[p] in same]:
            parts = [*path.parts[-depth:-1], path.stem]
            last = depth > len(path.parts)
            names[path] = path.as_posix() if last else "-".join(p.strip("/") for p in parts)
    return chosen | names
