"""``kumite.toml`` beside mocap files: what a user knows better than any inference.

```toml
metres_per_unit = 0.01        # for every file in this folder and below
up_axis = "Y"
ground_height = 0.02          # m
file_fps = 120                # where files do not state their rate, or state a wrong one
fps = 30                      # resample everything to this rate
encoding = "shift_jis"        # of joint names
joint_positions = "offsets"   # position channels below the hips count for nothing
keep_t_pose = true            # frames that stand apart at a take's ends stay

[roles]
head = "Skull"

[files."walk_01.bvh"]         # for one file; a name, or a path below this folder
metres_per_unit = 0.0254
name = "walk"
```
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from kumite import toml
from kumite.errors import KumiteError, at, short
from kumite.roles import ROLES

FILE_NAME = "kumite.toml"
_Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_Finite = Annotated[float, Field(allow_inf_nan=False)]


class FileSettings(BaseModel):
    """What may be said of one file."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    metres_per_unit: _Positive | None = None
    up_axis: Literal["Y", "Z", "X", "-Y", "-Z", "-X"] | None = None
    ground_height: _Finite | None = None  # m
    file_fps: _Positive | None = None  # frames a second of the file
    roles: dict[str, str] | None = None  # role -> joint name
    name: str | None = Field(default=None, min_length=1)
    encoding: str | None = Field(default=None, min_length=1)
    joint_positions: Literal["channels", "offsets"] | None = None
    keep_t_pose: bool | None = None

    @field_validator("up_axis", mode="before")
    @classmethod
    def _upper(cls, value: Any) -> Any:
        return value.upper() if isinstance(value, str) else value

    @field_validator("roles")
    @classmethod
    def _known(cls, value: dict[str, str] | None) -> dict[str, str] | None:
        odd = [r for r in value or {} if r not in ROLES]
        if odd:
            raise ValueError(f"unknown role {odd[0]!r}; expected one of {', '.join(ROLES)}")
        return value


class FolderSettings(FileSettings):
    """What may be said of a folder and all below it."""

    name: None = None
    fps: _Positive | None = None  # resample to this rate
    files: dict[str, FileSettings] = Field(default_factory=dict)


def read_settings(folder: Path) -> FolderSettings | None:
    """The settings beside the files of a folder; None if there are none.

    Errors: not TOML; unknown keys and bad values, all at once, with the valid choices; a table for
    a file that is not there.
    """
    path = folder / FILE_NAME
    try:
        source = path.read_text(encoding="utf-8")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError) as error:
        raise KumiteError(f"{path}: cannot be read ({error})") from None
    settings = toml.parse(source, path, FolderSettings)
    for name in settings.files:
        try:
            there = (folder / name).is_file()
        except (OSError, ValueError):  # too long for a name, or a NUL in it
            there = False
        if not there:
            raise at(
                path,
                toml.line_of(source, "files", name),
                f"files.{short(name)!r}: no such file; expected a path below {folder}",
            )
    return settings


class SettingsTree:
    """The settings of a source folder and the folders below it, each read once.

    The nearest folder's word wins, and a file's own table beats its folder.
    """

    def __init__(self) -> None:
        self._read: dict[Path, FolderSettings | None] = {}

    def folder(self, folder: Path) -> FolderSettings | None:
        if folder not in self._read:
            self._read[folder] = read_settings(folder)
        return self._read[folder]

    def of(self, path: Path, top: Path) -> Mapping[str, Any]:
        """What is said of one file below ``top``; keys that nobody mentions are absent."""
        folders = [path.parent]
        while folders[-1] != top and top in folders[-1].parents:
            folders.append(folders[-1].parent)
        out: dict[str, Any] = {}
        for folder in reversed(folders):
            settings = self.folder(folder)
            if settings is None:
                continue
            own = settings.files.get(path.relative_to(folder).as_posix())
            for model in (settings, own):
                if model is None:
                    continue
                said = model.model_dump(exclude_none=True, exclude={"files"})
                roles = {**out.get("roles", {}), **said.pop("roles", {})}
                out |= said
                if roles:
                    out["roles"] = roles
        return out
