"""Sets up .venv: ``python requirements/install.py run`` (or ``dev``, which adds what tests).

Every package comes from a file that holds its hash. uv takes a tenth of pip's time; pip does it
where there is no uv, or where the package index is one that only pip has been told of.
"""

import importlib.util
import os
import shutil
import subprocess
import sys
import time
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / ".venv"
SCRIPTS = FOLDER / ("Scripts" if os.name == "nt" else "bin")
PYTHON = SCRIPTS / ("python.exe" if os.name == "nt" else "python")


def install(what: str) -> None:
    say("setting up .venv, only this once")
    if not PYTHON.exists():
        venv.create(FOLDER, symlinks=os.name != "nt")  # without pip, which takes 5 s
    uv = find_uv()
    packages = ["--require-hashes", "-r", f"requirements/{what}.txt"]
    kumite = ["--no-deps", "--no-build-isolation", "-e", "."]
    if uv:
        say(f"installing the packages that requirements/{what}.txt names")
        if done(uv, "pip", "install", "--quiet", "--python", PYTHON, *packages):
            if not done(uv, "pip", "install", "--quiet", "--python", PYTHON, *kumite):
                sys.exit(1)
            return
    say(f"installing the packages that requirements/{what}.txt names with pip: a minute or two")
    pip = (PYTHON, "-m", "pip", "--disable-pip-version-check", "install", "--quiet")
    if not (
        done(sys.executable, "-m", "venv", FOLDER) and done(*pip, *packages) and done(*pip, *kumite)
    ):
        sys.exit(1)


def find_uv() -> "str | Path | None":
    """uv from .venv or the path; else it is put into .venv."""
    ours = SCRIPTS / ("uv.exe" if os.name == "nt" else "uv")
    if ours.exists():
        return ours
    if not shutil.which("uv") and importlib.util.find_spec("pip"):
        pip = (sys.executable, "-m", "pip", "--disable-pip-version-check", "--python", PYTHON)
        if done(*pip, "install", "--quiet", "--require-hashes", "-r", "requirements/uv.txt"):
            return ours
    return shutil.which("uv")


def done(*command: "str | Path") -> bool:
    """Whether a command ends well; what it says is shown."""
    return subprocess.run(list(map(str, command)), cwd=ROOT).returncode == 0


def say(what: str) -> None:
    print(f"[{time.monotonic() - START:4.1f} s] {what}", flush=True)


START = time.monotonic()

if __name__ == "__main__":
    if sys.version_info < (3, 11):  # noqa: UP036 - whoever has an older one is to read this
        sys.exit("Kumite needs Python 3.11 or later; set PYTHON=/path/to/python3.11")
    if sys.argv[1:] not in (["run"], ["dev"]):
        sys.exit("usage: python requirements/install.py run|dev")
    install(sys.argv[1])
    say("done")
