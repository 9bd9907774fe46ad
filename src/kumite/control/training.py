"""Trained policies on disk: solved on first use, found again by content."""

from __future__ import annotations

import contextlib
import hashlib
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

from kumite import files
from kumite.checked import checked
from kumite.control.policy import Behaviour, Policy, solve
from kumite.errors import KumiteError
from kumite.graph import Layer

KIND = "policy"
VERSION = 1
RESIDUAL = 1e-4


@checked
def trained(
    library: Layer,
    behaviour: Behaviour,
    folder: Path | str | None,
    *,
    residual: float = RESIDUAL,
    progress: Callable[[str, int, float], None] = lambda name, sweep, residual: None,
) -> Policy:
    """The policy of a behaviour: read from ``folder``, else solved and kept there.

    A folder of None, or one that cannot be written, only means that it is solved again next time.
    """
    settings = {"library": library.digest, "residual": residual, **asdict(behaviour)}
    settings["code"] = files.code_digest("control", "kernels")
    key = hashlib.sha256(json.dumps(settings, sort_keys=True).encode()).hexdigest()
    path = None if folder is None else Path(folder) / f"{behaviour.name}-{key[:16]}.policy"
    if path is not None and path.exists():
        try:
            header, arrays = files.load(path, KIND, VERSION)
            found = Policy(behaviour, arrays["value"], **header)
            if len(found.value) == library.table.states:
                return found
        except files.UNREADABLE:
            pass  # damaged or of another version: solve it again and write it anew
    policy = solve(
        library,
        behaviour,
        residual=residual,
        progress=lambda sweep, left: progress(behaviour.name, sweep, left),
    )
    if path is not None:
        header = {
            "residual": policy.residual,
            "converged": policy.converged,
            "sweeps": policy.sweeps,
            "backups": policy.backups,
            "seconds": policy.seconds,
        }
        with contextlib.suppress(KumiteError):
            files.save(path, KIND, VERSION, header, {"value": policy.value})
    return policy
