"""What must not keep a user waiting, and what an installation holds."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import kumite
from kumite.scene import catalogue, load_scene, settings

ROOT = Path(__file__).parents[1]

BROKEN = """
title = "nothing fits"
[[fighter]]
name = "red"
position = [0.0, 0.0]
against = "blue"
style = "bxer"
[[dodger]]
name = "blue"
[balls]
speed = [9.0, 3.0]
"""
COMMANDS = ("info", "build", "perform", "likeness", "spheres", "segment", "train")
COMMANDS += ("scenes", "run", "metrics", "export", "studio", "bench")
# Each ends before anything has to be computed.
QUICK = [
    (["--help"], 0),
    (["--version"], 0),
    *(([command, "--help"], 0) for command in COMMANDS),
    (["scenes"], 0),
    (["run", "sparing"], 2),
    (["run", "broken.toml"], 2),
    (["run", "sparring", "--count", "3"], 2),
    (["run", "sparring", "--throws", "3"], 2),
    (["run", "sparring", "--out", "fight.foo"], 2),
    (["run", "sparring", "--out", "broken.toml/fight.rec"], 2),
    (["run", "sparring", "--library", "missing"], 2),
    (["run", "sparring", "--library", "broken.toml"], 2),
    (["studio", "sparing"], 2),
    (["studio", "broken.toml"], 2),
    (["studio", "sparring", "--library", "missing.kumite"], 2),
    (["studio", "missing.rec"], 2),
    (["studio", "missing.kumite"], 2),
    (["export", "fight.rec", "-o", "fight.foo"], 2),
    (["export", "missing.rec", "-o", "fight.glb"], 2),
    (["metrics", "missing.rec"], 2),
    (["metrics", "broken.toml"], 2),
    (["info", "missing"], 2),
    (["info", "broken.toml"], 2),
    (["info", "missing.rec"], 2),
    (["info", "missing.kumite"], 2),
    (["info", ".", "--up-axis", "W"], 2),
    (["info", ".", "--role", "nose=Nose"], 2),
    (["build", "missing", "-o", "x.kumite"], 2),
    (["build", ".", "-o", "x.kumite", "--layer", "none"], 2),
    (["build", ".", "-o", "broken.toml/x"], 2),
    (["segment", "missing"], 2),
    (["likeness", "missing"], 2),
    (["train", "missing"], 2),
    (["spheres", "missing", "-o", "x.toml"], 2),
]


def test_what_computes_nothing_imports_no_compiler(tmp_path: Path):
    (tmp_path / "broken.toml").write_text(BROKEN, "utf-8")
    program = f"""
import sys
from kumite import cli
for command, expected in {QUICK!r}:
    sys.argv = ["kumite", *command]
    try:
        cli.main()
        status = 0
    except SystemExit as end:
        status = end.code or 0
    assert status == expected, (command, status)
    heavy = {{"numba", "scipy", "numpy", "matplotlib", "viser"}} & set(sys.modules)
    assert not heavy, (command, heavy)
"""
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert "sparring" in done.stdout and "unknown scene 'sparing'" in done.stderr
    assert "unknown style 'bxer'" in done.stderr and "speed = [9, 3]" in done.stderr


def test_a_scene_reads_its_own_file_only(monkeypatch):
    read: list[str] = []
    parse = settings.toml.parse

    def parsed(text: str, where: str, model):
        read.append(where)
        return parse(text, where, model)

    monkeypatch.setattr(settings.toml, "parse", parsed)
    assert load_scene("sparring").about == catalogue.about("sparring")
    assert read == ["sparring.toml"]


def test_what_is_installed_is_what_the_project_asks_for():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    extras = project["optional-dependencies"]
    run = [*project["dependencies"], *extras["physics"]]
    for wanted, file in ((run, "run.txt"), ([*run, *extras["dev"]], "dev.txt")):
        lines = (ROOT / "requirements" / file).read_text("utf-8").splitlines()
        locked = {line.split("==")[0] for line in lines if "==" in line}
        assert {name.split(">=")[0] for name in wanted} <= locked, file


KEPT = """
from kumite import caches
from kumite.kernels import pose
import numpy as np
out = np.zeros(4)
pose.quaternion_product(np.array([1.0, 0, 0, 0]), np.array([0.0, 1, 0, 0]), out)
print(out.tolist(), sum(pose.quaternion_product.stats.cache_hits.values()), caches.root())
"""


def _kept(**environment: str | None) -> tuple[list[str], str]:
    given = {**os.environ, "PYTHONPATH": str(Path(kumite.__file__).parents[1]), **environment}
    given = {name: value for name, value in given.items() if value is not None}
    command = [sys.executable, "-c", KEPT]
    done = subprocess.run(command, env=given, capture_output=True, text=True)  # type: ignore[arg-type]
    assert done.returncode == 0, done.stderr
    return done.stdout.split("] ")[1].split(), done.stderr


def test_kernels_are_kept_where_the_user_says(tmp_path: Path):
    folder = str(tmp_path / "kept")
    named = {"KUMITE_CACHE": folder, "NUMBA_CACHE_DIR": None}
    assert _kept(**named) == (["0", folder], "")
    assert _kept(**named) == (["1", folder], "")
    for path in (tmp_path / "kept").rglob("*.nbc"):  # cut off by a full disk
        path.write_bytes(path.read_bytes()[:-100])
    assert _kept(**named) == (["0", folder], "")


def test_without_a_place_to_keep_kernels_it_runs_and_says_so(tmp_path: Path):
    (tmp_path / "file").touch()
    for named in ({"KUMITE_CACHE": f"{tmp_path}/file/in"}, {"XDG_CACHE_HOME": f"{tmp_path}/file"}):
        (hits, where), said = _kept(**{"KUMITE_CACHE": None, "NUMBA_CACHE_DIR": None, **named})
        assert hits == "0" and not Path(where).exists()  # a temporary one, gone with the process
        assert said.count("\n") == 1 and "name a folder to keep them in with KUMITE_CACHE" in said


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (
            OSError(errno.EACCES, "Permission denied", "/opt/scenes"),
            "/opt/scenes: Permission denied",
        ),
        (OSError(errno.EMFILE, "Too many open files"), "Too many open files"),
    ],
)
def test_what_the_system_refuses_is_said_as_it_is(
    run, monkeypatch: pytest.MonkeyPatch, error: OSError, said: str
):
    def refuse() -> list[str]:
        raise error

    monkeypatch.setattr(catalogue, "names", refuse)
    assert run("scenes") == (2, "", f"error: {said}\n")


@pytest.mark.skipif(os.name == "nt", reason="pipes break otherwise there")
@pytest.mark.parametrize("args", [["scenes"], ["scenes", "--json"], ["--help"]])
def test_nobody_reads_on(args: list[str]):
    reader, writer = os.pipe()
    os.close(reader)
    command = [sys.executable, "-m", "kumite", *args]
    done = subprocess.run(command, stdout=writer, stderr=subprocess.PIPE, text=True)
    os.close(writer)
    assert (done.returncode, done.stderr) == (1, "")


def test_with_no_output_at_all_it_runs(tmp_path: Path):
    program = "import sys; sys.stdout = None; from kumite import cli; cli.main()"
    command = [sys.executable, "-c", program, "scenes", "--json"]
    done = subprocess.run(command, stderr=subprocess.PIPE, text=True)
    assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.skipif(os.name == "nt", reason="Ctrl-C is no signal to one process there")
@pytest.mark.parametrize("module", ["typer", "kumite.cli.scenes", "pydantic", "numba"])
def test_ctrl_c_while_it_imports_ends_it_without_a_traceback(tmp_path: Path, module: str):
    program = f"""
import signal, sys
signal.signal(signal.SIGINT, signal.default_int_handler)  # in the background it is ignored
class Interrupt:
    def find_spec(self, name, path=None, target=None):
        if name == {module!r}:
            sys.meta_path.remove(self)
            exec("import signal; signal.raise_signal(signal.SIGINT)")
sys.meta_path.insert(0, Interrupt())
sys.argv = ["kumite", "run", "sparring", "--seconds", "0.1"]
from kumite import cli
cli.main()
"""
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True
    )
    assert (done.returncode, done.stdout) == (130, "")
    assert done.stderr.strip().splitlines()[-1] == "interrupted" and "Trace" not in done.stderr


PLAYED = """
import contextlib, sys
from kumite import cli
from kumite.scene import Playback, load_recording
rec = sys.argv[1]
stage = Playback(load_recording(rec))
for _ in range(20):
    stage.step()
stage.reset(1)
for outs in (["x.glb"], ["x.bvh", "--character", "red"]):
    sys.argv = ["kumite", "export", rec, "-o", *outs]
    with contextlib.suppress(SystemExit):
        cli.main()
from kumite.kernels.within import KERNELS
print(len(KERNELS) > 9, sorted(name for name, kernel in KERNELS.items() if kernel.overloads))
"""


def test_what_is_recorded_is_played_and_exported_without_a_kernel(tmp_path: Path):
    recording = Path(kumite.__file__).parent / "studio" / "sparring.rec"
    command = [sys.executable, "-c", PLAYED, str(recording)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines()[-1] == "True []"
    assert (tmp_path / "x.glb").stat().st_size > 10_000
