"""What the documents say, run: the README's lines, the examples, the public names."""

from __future__ import annotations

import importlib
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("", ".mocap", ".performer", ".annotate", ".body", ".graph", ".synthesis", ".control")


def blocks(language: str, document: str = "README.md") -> list[str]:
    text = (ROOT / document).read_text("utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


@pytest.mark.slow
@pytest.mark.parametrize("example", sorted(p.name for p in (ROOT / "examples").glob("*.py")))
def test_examples_run(example: str, tmp_path: Path):
    source = ROOT / "examples" / example
    assert len(source.read_text().splitlines()) <= 100
    done = subprocess.run(
        [sys.executable, str(source)], cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip()


@pytest.mark.slow
@pytest.mark.parametrize(
    "document",
    [
        "README.md",
        "docs/avoidance.md",
        "docs/performer.md",
        "docs/preparation.md",
        "docs/reactions.md",
    ],
)
def test_the_documents_python_runs(document: str, tmp_path: Path):
    if document == "docs/reactions.md":
        pytest.importorskip("mujoco")
    code = "\n".join(blocks("python", document))
    assert code
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_the_readmes_commands_run(tmp_path: Path, mocap: Path):
    """Every ``kumite`` line of the README, in order, on the real boxer's clips."""
    lines = [line.split("#")[0].strip() for b in blocks("sh") for line in b.splitlines()]
    commands = [line for line in lines if line.startswith("kumite ")]
    assert len(commands) >= 6
    (tmp_path / "my_mocap").symlink_to((mocap / "boxer").resolve())
    environment = {
        **os.environ,
        "DEMO_SECONDS": "2",
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "XDG_CACHE_HOME": str(tmp_path / "cache"),
    }
    for command in commands:
        if command.startswith("kumite bench"):
            continue  # minutes long; its rows are tested on their own
        done = subprocess.run(
            command, shell=True, cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"


@pytest.mark.parametrize("package", (*PACKAGES, ".scene", ".studio", ".export"))
def test_public_names_can_be_imported(package: str):
    module = importlib.import_module(f"kumite{package}")
    names = getattr(module, "__all__", [])
    for name in names:
        assert getattr(module, name) is not None
    assert module.__doc__


@pytest.mark.parametrize("document", sorted(p.name for p in (ROOT / "docs").glob("*.md")))
def test_files_that_documents_show_are_there(document: str):
    text = (ROOT / "docs" / document).read_text("utf-8")
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", text):
        assert (ROOT / "docs" / target).exists(), target


def test_files_that_the_readme_shows_are_there():
    text = (ROOT / "README.md").read_text("utf-8")
    for target in re.findall(r"\]\((?!http)([^)#]+)\)", text) + re.findall(r'src="([^"]+)"', text):
        assert (ROOT / target).exists(), target
