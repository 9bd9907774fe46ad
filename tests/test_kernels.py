"""How kernels are compiled and kept."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import kumite

ROOT = Path(__file__).parents[1]

PLUGS = """
import sys
from kumite.kernels.jit import kernel, plugged

def inner(x):
    return 0.0

def template(x):
    return inner(x) + inner(x + 1.0)

@kernel
def square(x):
    return 1.0 * x * x

@kernel
def cube(x):
    return x * x * x

for plug in (square, cube):
    made = plugged(template, inner=plug)
    print(made(2.0), sum(made.stats.cache_hits.values()))
"""

TIP = """
import numpy as np
from kumite.kernels import character
one, quarter, out = np.array([1.0, 0, 0, 0]), np.sqrt([0.5, 0.5, 0, 0]), np.zeros(3)
character.difference(one, quarter, out)
print(round(out[0] / np.pi, 6))
"""


@pytest.mark.slow
def test_compiled_code_is_not_kept_when_a_kernel_that_it_calls_changes(tmp_path: Path):
    """``character.difference`` calls ``pose.quaternion_product``, which lives in another file."""
    package = tmp_path / "kumite"
    shutil.copytree(
        Path(kumite.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__")
    )
    environment = {
        **os.environ,
        "PYTHONPATH": str(tmp_path),
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
    }

    def run() -> float:
        command = [sys.executable, "-c", TIP]
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=True, cwd=tmp_path
        )
        return float(done.stdout)

    assert run() == 0.5
    kept = sorted((tmp_path / "cache").rglob("*.nbc"))
    assert run() == 0.5 and sorted((tmp_path / "cache").rglob("*.nbc")) == kept
    pose = package / "kernels" / "pose.py"
    text = pose.read_text("utf-8")
    pose.write_text(text.replace("out[0] = a[0] * b[0] -", "out[0] = -a[0] * b[0] -"))
    assert run() == -0.5


@pytest.mark.slow
def test_plugged_kernels_are_kept_and_not_confused(tmp_path: Path):
    script = tmp_path / "plugs.py"
    environment = {
        **os.environ,
        "PYTHONPATH": str(Path(kumite.__file__).parent.parent),
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
    }

    def run(text: str) -> list[str]:
        script.write_text(text, "utf-8")
        command = [sys.executable, str(script)]
        done = subprocess.run(
            command, env=environment, capture_output=True, text=True, check=True, cwd=tmp_path
        )
        return done.stdout.split()

    assert run(PLUGS) == ["13.0", "0", "35.0", "0"]
    assert run(PLUGS) == ["13.0", "1", "35.0", "1"]
    # The same instructions with another constant, in the template and in a plug: Numba's key for
    # kept code is the same.
    assert run(PLUGS.replace("x + 1.0", "x + 2.0")) == ["20.0", "0", "72.0", "0"]
    assert run(PLUGS.replace("1.0 * x", "2.0 * x")) == ["26.0", "0", "35.0", "0"]


BOTH = """
import numpy as np
from numba import prange
from kumite.kernels.jit import kernel, parallel_kernel

def _double(x):
    for n in prange(len(x)):
        x[n] *= 2.0

few, many = kernel(_double), parallel_kernel(_double)
x = np.ones(4)
few(x)
many(x)
print(x[0], sum(few.stats.cache_hits.values()), sum(many.stats.cache_hits.values()))
"""


@pytest.mark.slow
def test_a_function_compiled_both_ways_is_kept_as_both(tmp_path: Path):
    """Numba's key for kept code does not say whether loops run on all cores."""
    (tmp_path / "both.py").write_text(BOTH, "utf-8")
    environment = {
        **os.environ,
        "PYTHONPATH": str(Path(kumite.__file__).parent.parent),
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
    }
    for hits in ("0 0", "1 1"):
        command = [sys.executable, str(tmp_path / "both.py")]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        assert done.stdout.split() == ["4.0", *hits.split()]


@pytest.mark.slow
def test_crowds_are_shown_by_what_is_compiled_first(tmp_path: Path):
    """A crowd before anybody alone: loops on all cores are compiled from nothing."""
    script = (
        "from kumite.kernels import character; from kumite.synthesis import Cast\n"
        "from tests.shared import builtin\n"
        "cast = Cast(builtin(), character.MANY)\n"
        "cast.show(0.0); print(character.show_many.signatures != [])"
    )
    environment = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(map(str, (Path(kumite.__file__).parents[1], ROOT))),
        "NUMBA_CACHE_DIR": str(tmp_path),
    }
    done = subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["True"]
