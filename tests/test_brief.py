"""What values show of themselves: a line or two, and a small picture in notebooks."""

from __future__ import annotations

import base64
import dataclasses
import importlib
import io
import re
from collections.abc import Callable

import numpy as np
import pytest
from PIL import Image

from kumite.graph import Layer
from kumite.scene import Recording, World, load_scene, record
from tests import toys
from tests.test_docs import PACKAGES


@pytest.fixture(scope="module")
def fight(library: Layer) -> Recording:
    return record(World(load_scene("sparring"), library, seed=3), 4.0)


def test_values_are_shown_in_two_lines_at_most(library: Layer, fight: Recording):
    clip = library.clips.clip(0)
    values = (clip, library.clips, clip.skeleton, library, fight, library.table, library.strikes)
    for value in values:
        assert 20 < len(repr(value)) < 400 and "array(" not in repr(value), repr(value)
    assert f"{len(clip.skeleton)} joints" in repr(clip) and repr(clip.name) in repr(clip)
    assert f"{library.table.states} states" in repr(library)
    assert "'Sparring', red, blue, 4.0 s" in repr(fight)
    assert re.search(rf"first=int\d+\[{len(library.table.first)}\]", repr(library.table))


@pytest.mark.parametrize("package", (*PACKAGES, ".scene"))
def test_everything_public_that_holds_arrays_is_brief(package: str):
    """A new dataclass with arrays that shows them all is found here."""
    module = importlib.import_module(f"kumite{package}")
    for name in getattr(module, "__all__", []):
        value = getattr(module, name)
        if isinstance(value, type) and dataclasses.is_dataclass(value):
            types = [str(f.type) for f in dataclasses.fields(value)]
            if any(re.search(r"ndarray|Clip|Layer|Skeleton", t) for t in types):
                assert value.__repr__.__module__ == "kumite.brief", name


def test_notebooks_show_a_picture(library: Layer, fight: Recording):
    few = toys.still(20)
    for value in (few, library.clips, library, fight):
        show: Callable[[], str] = getattr(value, "_repr_html_")  # noqa: B009 - added by @pictured
        text = show()
        data = re.search(r"base64,([^\"]+)", text)
        assert data is not None and re.sub("&#x27;", "'", text).endswith(f"{value!r}</code></div>")
        image = np.asarray(Image.open(io.BytesIO(base64.b64decode(data[1]))))
        assert image.shape[1] > 300 and image.std() > 10 and len(text) < 250_000
