"""What the documents say, run: the README's lines, the examples, the public names."""

from __future__ import annotations

import importlib
import re
import runpy
import shlex
from itertools import pairwise
from pathlib import Path

import pytest
from typer.core import TyperGroup
from typer.main import get_command

import kumite
import kumite.graph
from kumite.cli.start import app
from tests.shared import builtin

ROOT = Path(__file__).parents[1]
PACKAGES = ("", ".mocap", ".performer", ".annotate", ".body", ".graph", ".synthesis", ".control")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of its own to work in. All runs in this process: kernels are loaded once, and the
    built-in performer's libraries are those that other tests have made.
    """
    monkeypatch.chdir(tmp_path)
    for module in (kumite, kumite.graph):
        monkeypatch.setattr(module, "builtin_layer", lambda cache, **which: builtin(**which))
    return tmp_path


def blocks(language: str, document: str = "README.md") -> list[str]:
    text = (ROOT / document).read_text("utf-8")
    return re.findall(rf"```{language}\n(.*?)```", text, flags=re.DOTALL)


@pytest.mark.slow
@pytest.mark.parametrize("example", sorted(p.name for p in (ROOT / "examples").glob("*.py")))
def test_examples_run(example: str, here: Path, capsys: pytest.CaptureFixture[str]):
    source = ROOT / "examples" / example
    assert len(source.read_text("utf-8").splitlines()) <= 100
    runpy.run_path(str(source), run_name="__main__")
    assert capsys.readouterr().out.strip()


@pytest.mark.slow
@pytest.mark.parametrize(
    "document",
    [
        "README.md",
        "docs/avoidance.md",
        "docs/controllers.md",
        "docs/events.md",
        "docs/performer.md",
        "docs/preparation.md",
        "docs/reactions.md",
    ],
)
def test_the_documents_python_runs(document: str, here: Path):
    if document == "docs/reactions.md":
        pytest.importorskip("mujoco")
    code = "\n".join(blocks("python", document))
    assert code
    (here / "document.py").write_text(code, "utf-8")
    runpy.run_path("document.py", run_name="__main__")


def commands() -> list[list[str]]:
    """Every ``kumite`` line of the README, in order, cut into words."""
    lines = [line.split("#")[0].strip() for b in blocks("sh") for line in b.splitlines()]
    return [shlex.split(line)[1:] for line in lines if line.startswith("kumite ")]


def test_the_readmes_commands_lead_where_they_say():
    """Options are known; files are made by an earlier line; libraries that are built are used."""
    root = get_command(app)
    assert isinstance(root, TyperGroup)
    made, used = {"my_mocap"}, set()
    for name, *words in commands():
        root.commands[name].make_context(name, list(words))  # errors: an option that is unknown
        outputs = {b for a, b in pairwise(words) if a in ("-o", "--out", "--output", "--plot")}
        files = {w for w in words if re.search(r"^my_mocap$|\.(kumite|rec|txt|toml)$", w)}
        assert files - outputs <= made, f"{name} {words}"
        used |= files - outputs
        made |= outputs
    assert {f for f in made if f.endswith((".kumite", ".txt"))} <= used


@pytest.mark.slow
def test_the_readmes_commands_run(
    run, tmp_path: Path, mocap: Path, monkeypatch: pytest.MonkeyPatch
):
    """Every ``kumite`` line of the README, in order, on the real boxer's clips; two seconds of what
    is a matter of seconds, but for the fight whose hits are looked at afterwards.
    """
    lines = [shlex.split(line, comments=True) for b in blocks("sh") for line in b.splitlines()]
    commands = [line[1:] for line in lines if line[:1] == ["kumite"]]
    assert len(commands) >= 6
    (tmp_path / "my_mocap").symlink_to((mocap / "boxer").resolve())
    monkeypatch.setenv("DEMO_SECONDS", "1")
    for command in commands:
        if command[0] == "bench":
            continue  # minutes long; its rows are tested on their own
        if "--seconds" in command and "fight.rec" not in command:
            command += ["--seconds", "2"]  # the last one counts
        status, out, err = run(*command)
        assert status == 0, f"{command}\n{out}\n{err}"


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
