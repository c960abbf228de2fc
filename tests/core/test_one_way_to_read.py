"""Files that somebody else may have put there are read by `core.files` alone, which never waits and never overflows."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import evoclaims
from evoclaims.core import files

PACKAGE = Path(evoclaims.__file__).parent
OPENING = {"open", "fdopen", "ZipFile", "memmap", "fromfile", "genfromtxt", "loadtxt", "parse_file"}
READING = {"read_bytes", "read_text"}
LIBRARIES = {"json", "tomllib", "np", "jnp", "numpy", "pickle"}

ELSEWHERE = {
    # files of this package
    "core/lazy.py": ["Path(str(module.__file__)).with_suffix('.pyi').read_text"],
    "cli/new.py": ["(layer / NEXT).read_text"],
    "report/html.py": ["(resources.files('evoclaims.report') / 'assets' / name).read_text"],
    # what the system says
    "core/provenance.py": ["Path('/proc/cpuinfo').read_text", "distribution.read_text", "distribution.read_text"],
    "cluster/submissions.py": ["Path(f'/proc/{job}/cmdline').read_bytes"],
    "trials/lease.py": ["Path(f'/proc/{owner.pid}/stat').read_text", "open"],
    "trials/loop_messages.py": ["Path(f'/proc/{pid}/environ').read_bytes"],
    "core/environments.py": ["distribution.read_text"],
    # standard streams, and nothing
    "cli/main.py": ["os.open"],
    "cli/terminal.py": ["open"],
    "execution/worker.py": ["open", "os.fdopen", "os.fdopen"],
    "trials/loop_process.py": ["os.fdopen", "os.fdopen", "os.open"],
    # parts of a file that is open
    "trials/arrays.py": [
        "archive.open",
        "self._archive.open",
        "self._archive.open",
        "zipfile.ZipFile",
        "zipfile.ZipFile",
    ],
    # written
    "cli/elsewhere.py": ["open"],
    "plugin/summary.py": ["open"],
}
"""Calls that open or read files, by module."""


def calls(path: Path) -> Iterator[str]:
    """Yield the functions called in a module by which a file could be opened or read."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(node, ast.Call):
            continue
        function, name, of = node.func, "", ""
        if isinstance(function, ast.Name):
            name = function.id
        elif isinstance(function, ast.Attribute):
            name, of = function.attr, ast.unparse(function.value)
        read = bool(of) and (name in READING or (name == "load" and of in LIBRARIES))
        if name in OPENING or read:
            yield ast.unparse(function)


def test_every_other_call_that_reads_a_file_is_listed() -> None:
    found = {
        path.relative_to(PACKAGE).as_posix(): names
        for path in sorted(PACKAGE.rglob("*.py"))
        if path != Path(files.__file__) and (names := sorted(calls(path)))
    }
    assert found == {name: sorted(listed) for name, listed in ELSEWHERE.items()}


def test_a_file_of_holes_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "holes"
    with path.open("wb") as file:
        file.truncate(files.MOST_BYTES + 1)
    with pytest.raises(OSError, match="too large"):
        files.read_file(path)


@pytest.mark.parametrize(
    "text", ["[" * 200_000 + "]" * 200_000, '{"a":' * 100_000 + "1" + "}" * 100_000, "[", "\udcff"]
)
def test_what_is_not_json_is_a_value_error(text: str, tmp_path: Path) -> None:
    (tmp_path / "file").write_bytes(text.encode(errors="surrogateescape"))
    with pytest.raises(ValueError, match="."):
        files.read_json(tmp_path / "file")
