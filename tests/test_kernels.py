"""How kernels are compiled and kept."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import kumite

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
