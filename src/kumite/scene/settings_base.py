"""What all scene files are made of: tables without other keys, names, finite numbers, places."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
FARTHEST = 1000.0  # m: recordings keep single precision
Metres = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]
Name = Annotated[str, Field(min_length=1, max_length=60)]

Reaction = Annotated[float, Field(ge=0, le=2, allow_inf_nan=False)]  # s …
REACTION = 0.0  # … until one knows of an attack that has begun

NEAREST = "nearest"  # of those who are after one, or of all
ARENA = "arena"  # what its edge is called among the objects


class Settings(BaseModel):
    """What a file may say: no other keys, and nothing changes later."""

    model_config = ConfigDict(extra="forbid", frozen=True)
