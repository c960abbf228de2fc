"""The command as a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

COMMAND = "from evoclaims.cli import main; raise SystemExit(main())"


def _evoclaims(folder: Path, *arguments: str, code: str = COMMAND) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    return subprocess.run(
        [sys.executable, "-c", code, *arguments],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_mistake_is_one_sentence_on_standard_error(tmp_path: Path) -> None:
    done = _evoclaims(tmp_path, "status")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith("evoclaims: No pyproject.toml at or above")
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize("arguments", [("--help",), ("run", "--help"), ("runn",), ()])
def test_help_and_unknown_commands_wait_for_no_library(tmp_path: Path, arguments: tuple[str, ...]) -> None:
    code = (
        "import sys; from evoclaims.cli import main\ntry:\n    main()\nexcept SystemExit as end:\n"
        "    sys.exit(77 if {'jax', 'numpy', 'rich', 'pytest'} & sys.modules.keys() else end.code)\n"
    )
    done = _evoclaims(tmp_path, *arguments, code=code)
    assert done.returncode == (0 if "--help" in arguments else 2), done.stderr
    if arguments == ("runn",):
        assert "invalid choice: 'runn'" in done.stderr
