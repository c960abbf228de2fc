"""What is not asked for is not imported: nobody waits for jax who collects claims, or merely has the plugin."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
HEAVY = [
    *("brax", "evosax", "flax", "jax", "matplotlib", "mujoco", "mujoco.mjx", "numpy"),
    *("optax", "pandas", "qdax", "rich", "scipy", "statsmodels"),
]


def _imported(code: str, folder: Path) -> set[str]:
    """Return which heavy packages a new process has imported after some code, whatever the code prints."""
    whole = f"{code}\nimport sys\nprint('\\n', [name for name in {HEAVY} if name in sys.modules])"
    # Other installed plugins import what they like.
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1"}
    command = [sys.executable, "-c", whole]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=True)
    return set(ast.literal_eval(done.stdout.splitlines()[-1].strip()))


def test_a_package_is_imported_without_what_its_names_need(tmp_path: Path) -> None:
    packages = "evoclaims, evoclaims.methods, evoclaims.methods.neat, evoclaims.envs, evoclaims.networks"
    assert _imported(f"import {packages}", tmp_path) == set()


def test_a_project_without_claims_pays_nothing_for_the_plugin(tmp_path: Path) -> None:
    (tmp_path / "test_it.py").write_text("def test_it(pytestconfig):\n    pytestconfig.getoption('claims_only')\n")
    code = "import pytest; status = pytest.main(['-p', 'evoclaims.plugin.hooks'])"
    assert _imported(f"{code}\nassert status == 0", tmp_path) == set()


def test_claims_are_collected_without_their_reproduction() -> None:
    options = ["-pevoclaims.plugin.hooks", "-pno:cacheprovider", "-c", os.devnull, "--rootdir=.", "--collect-only"]
    code = f"import pytest; status = pytest.main({[*options, 'claims']})"
    assert _imported(f"{code}\nassert status == 0", ROOT) <= {"numpy"}


def test_the_reproduction_is_imported_without_drawing_or_judging() -> None:
    loaded = _imported("import reproductions.nisioti2025", ROOT)
    assert "jax" in loaded
    assert not {"brax", "evosax", "flax", "matplotlib", "mujoco.mjx", "optax", "qdax", "statsmodels"} & loaded


def test_a_worker_process_is_ready_without_what_judges() -> None:
    assert not {"pandas", "scipy", "statsmodels"} & _imported("import evoclaims.execution.worker", ROOT)
