"""Environments with another release of one package: made once, by real installers, whole or not at all."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import venv
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import pytest
from wheels import write_wheel

from evoclaims.cli.elsewhere import between, released
from evoclaims.core import environments
from evoclaims.core.environments import Environment, NotInstallableError, Recipe, checked, make, reason
from evoclaims.core.errors import UserError

Make = Callable[..., Environment]


@pytest.fixture
def wheels(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of wheels, the only ones that pip knows."""
    folder = tmp_path / "wheels"
    folder.mkdir()
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_FIND_LINKS", str(folder))
    return folder


@pytest.fixture
def made(tmp_path: Path) -> list[str]:
    """The environments that were made, and not found."""
    return []


@pytest.fixture
def make_one(tmp_path: Path, made: list[str]) -> Make:
    """A function that returns the environment of a release."""

    def of(package: str, version: str, **others: object) -> Environment:
        recipe = Recipe(package, version, **others)  # type: ignore[arg-type]
        return make(recipe, tmp_path / "kept", tmp_path, lambda: made.append(recipe.label))

    return of


def _python(environment: Environment, code: str) -> str:
    """Return what some code prints in an environment."""
    return subprocess.run([environment.python, "-c", code], capture_output=True, text=True, check=True).stdout.strip()


def test_an_environment_has_the_release_on_trial_and_all_else_from_here_and_is_made_once_if_whole(
    wheels: Path, make_one: Make, made: list[str]
) -> None:
    write_wheel(wheels, "pebble", "1.1", "import grain, pytest\nsize = grain.size", "Requires-Dist: grain==2.0\n")
    write_wheel(wheels, "grain", "2.0", "size = 7")
    environment = make_one("pebble", "1.1")
    assert (
        _python(environment, "import pebble; print(pebble.size, pebble.pytest.__version__)")
        == f"7 {pytest.__version__}"
    )
    assert environment.moved("pebble") == {"grain": (None, "2.0")}
    assert make_one("pebble", "1.1") == environment
    assert made == ["pebble 1.1"]
    (environment.folder / "complete.json").unlink()  # as after a kill
    (environment.folder / "pyvenv.cfg").unlink()
    assert make_one("pebble", "1.1") == environment
    assert _python(environment, "import pebble; print(pebble.size)") == "7"
    assert len(made) == 2


def test_a_release_that_nobody_has_is_told_in_a_line_and_leaves_nothing(
    wheels: Path, make_one: Make, tmp_path: Path
) -> None:
    with pytest.raises(NotInstallableError, match=r"^No matching distribution found for pebble==9\.9$"):
        make_one("pebble", "9.9")
    assert [path.suffix for path in (tmp_path / "kept").iterdir()] == [".lock"]


def test_a_release_that_python_would_not_find_first_is_refused(
    wheels: Path, make_one: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_wheel(wheels, "pebble", "1.1", "size = 7")
    write_wheel(wheels, "pebble", "1.2", "size = 7")
    shutil.unpack_archive(wheels / "pebble-1.2-py3-none-any.whl", tmp_path / "before", "zip")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path / "before"))
    with pytest.raises(NotInstallableError, match=r"^Python finds pebble 1\.2 before the installed release$"):
        make_one("pebble", "1.1")


def test_another_python_with_pins_gets_this_program_first_and_then_the_release_on_trial_whatever_is_pinned(
    make_one: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    uv = tmp_path / "bin" / "uv"
    uv.parent.mkdir()
    uv.write_text(
        f"#!{sys.executable}\n"
        "import pathlib, subprocess, sys\n"
        f"with open({str(tmp_path / 'said')!r}, 'a') as said:\n"
        "    print(*sys.argv[1:], file=said)\n"
        "if sys.argv[1] == 'venv':\n"
        "    subprocess.run([sys.executable, '-m', 'venv', '--without-pip', sys.argv[-1]], check=True)\n"
        "elif sys.argv[-1] == 'pebble==1.1':\n"
        "    (site,) = pathlib.Path(sys.argv[4]).parents[1].glob('lib/*/site-packages')\n"
        "    (site / 'pebble-1.1.dist-info').mkdir()\n"
        "    (site / 'pebble-1.1.dist-info' / 'METADATA').write_text('Name: pebble\\nVersion: 1.1\\n')\n"
    )
    uv.chmod(0o755)
    monkeypatch.setenv("PATH", f"{uv.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("PYTHONPATH", "")
    pins = tmp_path / "pins.txt"
    hashes = " \\\n    --hash=sha256:12 \\\n    --hash=sha256:34\n"
    kept = f"# what we had\njax==0.10.2\npebble-stone==3{hashes}    # via ours\n"
    pins.write_text(f"Pebble == 1.0{hashes}{kept}")
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "ours"\n')

    environment = make_one("pebble", "1.1", python="3.13", constraints=pins)

    begun, first, second = (tmp_path / "said").read_text().splitlines()
    constraints = environment.folder / "constraints.txt"
    assert begun == f"venv --python 3.13 {environment.folder}"
    assert first.startswith(f"pip install --python {environment.python} --constraint {constraints} ")
    assert "evoclaims" in first or "--editable" in first
    assert first.endswith(f"--editable {tmp_path}")
    assert second == f"pip install --python {environment.python} --constraint {constraints} pebble==1.1"
    assert constraints.read_text() == kept  # uv checks the hashes that there are


@pytest.mark.parametrize(
    ("origin", "asked"),
    [
        ({"url": "file:///our%20work/it", "dir_info": {"editable": True}}, ["--editable", "/our work/it"]),
        ({"url": "file:///our%20work/it.whl", "archive_info": {}}, ["/our work/it.whl"]),
    ],
)
def test_this_program_is_found_in_a_folder_with_a_space_in_its_name(
    monkeypatch: pytest.MonkeyPatch, origin: dict[str, object], asked: list[str]
) -> None:
    distribution = SimpleNamespace(read_text=lambda name: json.dumps(origin))
    monkeypatch.setattr(environments.importlib.metadata, "distribution", lambda name: distribution)
    assert environments._this_program() == asked


def test_an_environment_of_a_project_with_other_dependencies_is_another_one(
    make_one: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A layer over what is installed here holds none of the project's, and stays."""
    monkeypatch.setattr(environments, "_made", lambda recipe, empty, *_: empty)
    (tmp_path / "pins.txt").write_text("a<3\n")
    whole, layers = [], []
    for edit in ('dependencies = ["a==1"]', 'dependencies = ["a==2"]', 'readme = "b"', "dependencies = 5"):
        (tmp_path / "pyproject.toml").write_text(f'[project]\nname = "ours"\n{edit}\n')
        whole.append(make_one("", "", constraints=tmp_path / "pins.txt").folder)
        layers.append(make_one("pebble", "1.0").folder)
    assert [whole.index(folder) for folder in whole] == [0, 1, 2, 2]
    assert len(set(layers)) == 1


def test_without_uv_no_other_python_is_tried(make_one: Make, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.setattr(environments.sysconfig, "get_path", lambda *_: str(tmp_path))
    with pytest.raises(NotInstallableError, match=r"not installed: pip install 'evoclaims\[releases\]'"):
        make_one("", "", python="3.99")


@pytest.mark.parametrize(
    ("said", "why"),
    [
        (
            "Collecting x\nERROR: Could not find it\nERROR: No matching distribution found for x\n\n",
            "No matching distribution found for x",
        ),
        ("error: subprocess-exited-with-error\nhint: See above.\n", "subprocess-exited-with-error"),
        ("usage: pytest\npytest: error: unrecognized arguments: -x\n  file: y\n", "unrecognized arguments: -x file: y"),
        ("E   ImportError: no x\n==== 1 error in 2s ====\n", "ImportError: no x"),
        (
            "  × No solution found:\n  ╰─▶ Because there is\n      no x, no.\n",
            "No solution found: ╰─▶ Because there is no x, no",
        ),
        (
            "pyenv: python3.99: command not found\n\nNote: See 'pyenv help global' for tips\n      to be found.\n",
            "python3.99: command not found",
        ),
        ("Traceback\nValueError: bad\n", "ValueError: bad"),
        ("", ""),
    ],
)
def test_the_reason_is_the_last_error_or_the_last_line(said: str, why: str) -> None:
    assert reason(said) == why


def test_releases_are_listed_oldest_first_and_final_ones_alone(wheels: Path) -> None:
    for version in ("1.10", "1.9", "2.0rc1", "1.9.1"):
        write_wheel(wheels, "pebble", version, "")
    assert released("pebble") == ["1.9", "1.9.1", "1.10"]
    assert between("1.9", "2.0rc1", released("pebble")) == ["1.9", "1.9.1", "1.10", "2.0rc1"]
    with pytest.raises(UserError, match=r"pip lists no releases of gravel .*\. Name them on the command line"):
        released("gravel")
    with pytest.raises(UserError, match=r"1\.10 is not older than 1\.9"):
        between("1.10", "1.9", [])


def test_releases_are_listed_in_an_environment_without_pip_as_uv_makes_it(
    wheels: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    write_wheel(wheels, "pebble", "1.1", "")
    venv.create(tmp_path / "bare", symlinks=True)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "bare" / "bin" / "python"))
    monkeypatch.setattr("importlib.util.find_spec", lambda name, find=find_spec: None if name == "pip" else find(name))
    assert released("pebble") == ["1.1"]
    with pytest.raises(UserError, match="'new' is not a version"):
        checked("new")


def test_what_comes_with_a_release_and_is_older_than_declared_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    declared = ["jax>=0.10.2,<0.13", "evosax~=0.3.2", "numpy", "submitit>=1.5; extra == 'slurm'", "odd>>1"]
    monkeypatch.setattr(environments.importlib.metadata, "requires", lambda name: declared)
    (tmp_path / "pyproject.toml").write_text('[project]\ndependencies = ["jax>=0.11", "Torch_X>2"]\n')
    older = {"jax": "0.10.2", "evosax": "0.3.0", "numpy": "1.0", "submitit": "1.0", "torch-x": "1.9"}
    environment = Environment(tmp_path, older)
    expected = {"evosax": ("0.3.0", "0.3.2"), "jax": ("0.10.2", "0.11"), "torch-x": ("1.9", "2")}
    assert environment.below("qdax", tmp_path) == expected
    assert environment.below("evosax", tmp_path).keys() == {"jax", "torch-x"}  # the release on trial may be older
    assert environment.below("jax", tmp_path) == expected  # but for what the process would die by
    assert Environment(tmp_path, {"jax": "0.13.0", "evosax": "0.3.2"}).below("qdax", tmp_path) == {}


def test_an_installer_that_a_signal_kills_is_said_so() -> None:
    with pytest.raises(NotInstallableError, match=r"^python\S* was killed by SIGSEGV$"):
        environments._run([sys.executable, "-c", "import os, signal; os.kill(os.getpid(), signal.SIGSEGV)"])
