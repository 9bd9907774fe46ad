"""Options that say how motion capture is read, the same of every command that reads it."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from kumite.cli.app import err
from kumite.cli.progress import Stages, progress
from kumite.errors import KumiteError

if TYPE_CHECKING:
    from kumite.mocap import Loaded

Source = Annotated[
    list[str], typer.Argument(help="Mocap: a folder, a glob, .bvh files, .amc files.")
]
FpsOption = Annotated[float | None, typer.Option(help="Resample to this rate, frames a second.")]
SkipBad = Annotated[
    bool, typer.Option("--skip-bad", help="Go on without files that cannot be read.")
]


@dataclass(frozen=True)
class Reading:
    """What the user says of the files: it beats ``kumite.toml``, the files and all inference."""

    file_fps: Annotated[
        float | None,
        typer.Option(help="The files' own rate, where they state none or a wrong one."),
    ] = None
    metres_per_unit: Annotated[
        float | None, typer.Option(help="Length of the files' unit in metres (else inferred).")
    ] = None
    up_axis: Annotated[
        str | None,
        typer.Option(help="Up axis of the files: Y, Z, X, -Y, -Z or -X (else inferred)."),
    ] = None
    ground: Annotated[
        float | None,
        typer.Option(help="Height of the floor in the files in metres (else inferred)."),
    ] = None
    role: Annotated[
        list[str] | None,
        typer.Option("--role", help="ROLE=JOINT, where names say too little; may be repeated."),
    ] = None
    encoding: Annotated[
        str | None,
        typer.Option(
            help="Encoding of joint names that are not UTF-8, like shift_jis (else guessed)."
        ),
    ] = None
    joint_positions: Annotated[
        str | None,
        typer.Option(
            help="What position channels below the hips count for: channels (followed, as far as "
            "bones of one length allow; the default) or offsets (nothing)."
        ),
    ] = None
    keep_t_pose: Annotated[
        bool, typer.Option("--keep-t-pose", help="Keep T poses and the like at a take's ends.")
    ] = False

    def given(self) -> list[str]:
        """The names of the options that were given."""
        return [
            f"--{f.name.replace('_', '-')}"
            for f in fields(self)
            if getattr(self, f.name) != f.default
        ]

    def refuse(self, source: Sequence[str], fps: float | None = None) -> None:
        """Say now what needs no reading. Errors: of the options; nothing there to be read."""
        from kumite.mocap.sources import check_options, find_files

        said = {f.name: getattr(self, f.name) for f in fields(self)}
        for name in ("role", "encoding", "keep_t_pose"):
            del said[name]
        check_options(fps=fps, roles=_roles(self.role), **said)
        find_files(source)

    def load(
        self, source: Sequence[str], fps: float | None = None, *, skip_bad: bool = False
    ) -> Loaded:
        """The clips of a source; warns of files that were left out, and of what is in doubt."""
        from kumite import mocap

        said = {f.name: getattr(self, f.name) for f in fields(self) if f.name != "role"}
        said["keep_t_pose"] = self.keep_t_pose or None
        with progress() as bars:
            Stages(bars)("reading motion capture")
            loaded = mocap.load(source, fps=fps, roles=_roles(self.role), skip_bad=skip_bad, **said)
        for bad in loaded.bad:
            err.print(f"left out: {bad}", markup=False, highlight=False)
        for line in loaded.doubts():
            err.print(f"warning: {line}", markup=False, highlight=False)
        return loaded


def _roles(pairs: Sequence[str] | None) -> dict[str, str]:
    roles = {}
    for pair in pairs or []:
        role, equals, joint = pair.partition("=")
        if not equals:
            raise KumiteError(f"--role {pair!r}: expected ROLE=JOINT, such as left_hand=LWrist")
        roles[role] = joint
    return roles


def reads_mocap(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of :class:`Reading`; it is called with them as ``reading``."""
    hints = get_type_hints(Reading, include_extras=True)
    options = [
        inspect.Parameter(
            f.name, inspect.Parameter.KEYWORD_ONLY, default=f.default, annotation=hints[f.name]
        )
        for f in fields(Reading)
    ]
    own = inspect.signature(command, eval_str=True).parameters.values()
    shown = [*(p.replace(kind=p.KEYWORD_ONLY) for p in own if p.name != "reading"), *options]

    def run(**given: Any) -> None:
        reading = Reading(**{f.name: given.pop(f.name) for f in fields(Reading)})
        command(**given, reading=reading)

    run.__name__, run.__doc__, run.__module__ = command.__name__, command.__doc__, __name__
    run.__annotations__ = {p.name: p.annotation for p in shown}
    run.__signature__ = inspect.Signature(shown)  # pyright: ignore[reportFunctionMemberAccess]
    return run
