"""Our files: whole or not at all, versioned, and nothing in them runs."""

from __future__ import annotations

import ast
import os
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from kumite import files
from kumite.errors import KumiteError


def test_round_trip_and_same_bytes(tmp_path):
    arrays = {"b": np.arange(6).reshape(2, 3), "a": np.array([1.5, 2.5])}
    files.save(tmp_path / "x", "thing", 3, {"k": [1, "é"]}, arrays)
    files.save(tmp_path / "y", "thing", 3, {"k": [1, "é"]}, dict(reversed(arrays.items())))
    assert (tmp_path / "x").read_bytes() == (tmp_path / "y").read_bytes()
    header, back = files.load(tmp_path / "x", "thing", 3)
    assert header == {"k": [1, "é"]}
    assert all(np.array_equal(back[k], v) and back[k].dtype == v.dtype for k, v in arrays.items())


def test_other_kinds_versions_and_damage_are_told_apart(tmp_path):
    path = tmp_path / "x"
    files.save(path, "thing", 3, {}, {"a": np.zeros(50)})
    with pytest.raises(KumiteError, match="this is a thing; expected a library"):
        files.load(path, "library", 3)
    with pytest.raises(KumiteError, match="version 3; this Kumite reads version 4"):
        files.load(path, "thing", 4)
    whole = path.read_bytes()
    for cut in (0, 4, 20, len(whole) - 40):
        path.write_bytes(whole[:cut])
        with pytest.raises(KumiteError, match="damaged"):
            files.load(path, "thing", 3)
    path.write_bytes(b"\xff" * 200)
    with pytest.raises(KumiteError, match="damaged"):
        files.load(path, "thing", 3)
    with pytest.raises(KumiteError, match="cannot be read"):
        files.load(tmp_path / "none", "thing", 3)


def test_one_changed_bit_is_damage(tmp_path):
    path = tmp_path / "x"
    files.save(path, "thing", 3, {"fps": 30.0}, {"a": np.arange(50), "none": np.zeros((0, 3))})
    whole = path.read_bytes()
    for place in (whole.index(b"30.0"), len(whole) - 1, len(whole) - 200):
        changed = bytearray(whole)
        changed[place] ^= 1
        path.write_bytes(changed)
        with pytest.raises(KumiteError, match="damaged thing"):
            files.load(path, "thing", 3)


def test_a_device_is_never_replaced_and_a_link_is_followed(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(KumiteError, match="expected a file"), files.writing(pipe):
        pass
    assert pipe.is_fifo()
    with pytest.raises(KumiteError, match="Is a directory"), files.writing(tmp_path):
        pass
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "deep" / "real")
    with files.writing(link) as temporary:
        temporary.write_text("new")
    assert link.is_symlink() and (tmp_path / "deep" / "real").read_text() == "new"


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path):
    path = tmp_path / "x"
    path.write_text("old")
    with pytest.raises(RuntimeError), files.writing(path) as temporary:
        temporary.write_text("half")
        raise RuntimeError
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["x"]


def test_a_folder_that_cannot_be_written_is_said(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with (
        pytest.raises(KumiteError, match="cannot be written"),
        files.writing(tmp_path / "file" / "x"),
    ):
        pass


def test_what_a_file_holds_is_told_without_reading_it_all(tmp_path):
    files.save(tmp_path / "x", "thing", 3, {}, {"a": np.zeros(50)})
    assert files.kind_of(tmp_path / "x") == "thing"
    whole = (tmp_path / "x").read_bytes()
    for k, other in enumerate(
        (b"", b"\xff" * 200, whole[:20], b"HIERARCHY\nROOT hips\n", b"\0" * 9)
    ):
        (tmp_path / f"{k}").write_bytes(other)
        assert files.kind_of(tmp_path / f"{k}") is None
    assert files.kind_of(tmp_path) is None and files.kind_of(tmp_path / "none") is None
    assert files.kind_of("") is None and files.kind_of("x" * 5000) is None


WRITERS = {"write_text", "write_bytes", "savefig", "save", "tofile", "dump", "savez", "writestr"}
WHOLE = {"files.save", "learning.save"}
ELSEWHERE = {
    "kernels/kept.py",  # imports nothing of ours; it renames, too, and what is lost is made anew
    "export/notebook.py",  # into memory
}


def _writes(tree: ast.AST, inside: bool = False) -> Iterator[tuple[int, bool]]:
    """Lines on which something is written, and whether that is within ``files.writing``."""
    if isinstance(tree, ast.With):
        calls = [i.context_expr for i in tree.items if isinstance(i.context_expr, ast.Call)]
        inside = inside or any(ast.unparse(c.func).endswith("writing") for c in calls)
    if isinstance(tree, ast.Call) and ast.unparse(tree.func) not in WHOLE:
        name = ast.unparse(tree.func).rpartition(".")[2]
        given = [*tree.args, *(k.value for k in tree.keywords)]
        modes = {str(a.value) for a in given if isinstance(a, ast.Constant)}
        if name in WRITERS or (name == "open" and modes & {"w", "wb", "a", "ab", "x", "xb"}):
            yield tree.lineno, inside
    for child in ast.iter_child_nodes(tree):
        yield from _writes(child, inside)


def test_whatever_writes_a_file_writes_it_whole():
    root = Path(files.__file__).parent
    found = 0
    for path in sorted(root.rglob("*.py")):
        for line, whole in _writes(ast.parse(path.read_text("utf-8"))):
            found += 1
            name = path.relative_to(root).as_posix()
            assert whole or name in ELSEWHERE, f"{name}:{line} writes without files.writing"
    assert found > 9  # it finds writes at all
