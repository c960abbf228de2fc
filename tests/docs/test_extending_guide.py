"""The repository that the guide shows is made from the guide, word for word, and run; so are its commands."""

from __future__ import annotations

import importlib
import json
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from evoclaims.cli import main
from evoclaims.core.errors import UserError
from evoclaims.envs import Robot
from evoclaims.envs.ecorobot.robots import SIMPLE_ROB

GUIDE = (Path(__file__).parents[2] / "docs" / "extending.md").read_text(encoding="utf-8")
FILES: dict[str, str] = dict(re.findall(r"`([\w/.]+)`:\n\n```\w+\n(.*?)```", GUIDE, flags=re.DOTALL))
"""The guide's files by name: each block follows a line that ends with its name in backquotes and a colon."""

COMMANDS = [
    shlex.split(line, comments=True)
    for block in re.findall(r"```sh\n(.*?)```", GUIDE, flags=re.DOTALL)
    for line in block.splitlines()
]
LATER = {"whole_paper.py", "claims/test_climbing.py"}
"""What the guide adds after the first run."""
BESIDE = {"with_mine.py", "claims/test_mine.py"}
"""What it puts beside this paper's claims and conditions."""

IN_ONE_PROCESS = """
import json, pytest, sys
from evoclaims.cli import main
run = {"pytest": lambda words: pytest.main([*words, "-p", "no:xdist"]), "evoclaims": main}
print([int(run[words[0]](words[1:])) for words in json.loads(sys.argv[1])])
"""
AUTHOR = ["-c", "user.name=A", "-c", "user.email=a@example.org"]


def _write(folder: Path, names: set[str]) -> None:
    """Write files of the guide."""
    for name in names:
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(FILES[name], encoding="utf-8")


def test_the_smoke_test_that_is_shown_is_one_of_the_paper() -> None:
    (shown,) = re.findall(r"```python\n(@claim\.smoke.*?)```", GUIDE, flags=re.DOTALL)
    assert shown in (Path(__file__).parents[2] / "claims" / "test_stepping_stones.py").read_text(encoding="utf-8")


def test_the_faults_that_are_shown_for_a_new_project_change_what_it_trains_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    page = (Path(__file__).parents[2] / "docs" / "mutants.md").read_text(encoding="utf-8")
    (shown,) = re.findall(r"```python\n(from dataclasses[^`]*?our_paper.*?)```", page, flags=re.DOTALL)
    assert main(["new", str(tmp_path / "mine")]) == 0
    (tmp_path / "mine/reproductions/our_paper/mutants.py").write_text(shown, encoding="utf-8")
    faults = "import json, reproductions.our_paper as paper\nfrom reproductions.our_paper.mutants import MUTANTS\n"
    faults += "sound = paper.REPRODUCTION.tiers['smoke'].conditions\n"
    faults += "print(json.dumps({name: one.targets(sound) for name, one in MUTANTS.items()}))"
    ran = subprocess.run(
        [sys.executable, "-c", faults], cwd=tmp_path / "mine", capture_output=True, text=True, check=True
    )
    assert json.loads(ran.stdout) == {"tiny-steps": ["hill_climber"], "half-paid": ["majority"]}


def test_what_the_guide_shows_is_short() -> None:
    together = ["our_paper.py", "claims/test_majority.py"], ["whole_paper.py", "claims/test_climbing.py"], BESIDE
    for names in (*together, ["hill_climber.py"], ["majority.py"], ["corridor.py"]):
        lines = [line for name in names for line in FILES[name].splitlines() if line.strip()]
        assert len(lines) <= (40 if "our_paper.py" in names else 20 if names == BESIDE else 30), names
        assert max(map(len, lines)) <= 120


def test_the_guide_s_repository_comes_to_verdicts_and_its_commands_do_what_they_say(pytester: pytest.Pytester) -> None:
    _write(pytester.path, set(FILES) - LATER - BESIDE)
    for words in (["init", "-q"], ["add", "."], [*AUTHOR, "commit", "-qm", "first"]):
        assert pytester.run("git", *words).ret == 0  # trials of unknown revision are no references
    assert COMMANDS[0] == ["pytest", "-m", "smoke"]
    result = pytester.runpytest_inprocess("-m", "smoke", "--claims-json=out.json", "-p", "no:xdist")
    assert result.ret == 0
    claims = json.loads((pytester.path / "out.json").read_text())["claims"]
    assert {claim["claim"]: claim["outcome"] for claim in claims} == {"H1": "supported", "H2": "supported"}

    _write(pytester.path, LATER)
    settings = FILES["pyproject.toml"].replace('"our_paper"', '"whole_paper"')
    (pytester.path / "pyproject.toml").write_text(settings, encoding="utf-8")
    result = pytester.run(sys.executable, "-c", IN_ONE_PROCESS, json.dumps(COMMANDS))
    assert result.outlines[-1] == str([int(words[:2] == ["evoclaims", "accept"]) for words in COMMANDS])
    told = [
        "claims: 4 supported",
        "  H4: supported either way",
        "wrote *corridor.jsonl: 10 trials",
        "accepted: H4 (smoke)*",
    ]
    for line in told:
        result.stdout.fnmatch_lines([line])


def test_a_method_beside_those_of_the_paper_is_judged_with_the_papers_reference_trials(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["new", "beside", "--from", "nisioti2025"]) == 0
    folder = pytester.path / "beside"
    monkeypatch.chdir(folder)
    _write(folder, BESIDE | {"hill_climber.py"})
    settings = folder / "pyproject.toml"
    text = settings.read_text(encoding="utf-8")
    assert text.count('"reproductions.nisioti2025"') == 1
    settings.write_text(text.replace('"reproductions.nisioti2025"', '"with_mine"'), encoding="utf-8")
    commands = [shlex.split(one) for one in re.findall(r"`(evoclaims (?:run hill|status --only H5)[^`]*)`", GUIDE)]
    assert [words[1] for words in commands] == ["run", "status"]
    result = pytester.run(sys.executable, "-c", IN_ONE_PROCESS, json.dumps(commands))
    assert result.outlines[-1] == "[0, 0]"
    assert len(list((folder / ".evoclaims" / "trials").rglob("*.json"))) == 10  # and none of CMA-ES
    result.stdout.re_match_lines([r"H5 +It does for 3-parity \(here\) +✓ supported†? +10 "])


def test_the_robot_and_the_task_that_are_shown_are_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    section = GUIDE.partition("## A robot's task\n")[2].partition("\n## ")[0]
    package = tmp_path / "my_package"
    package.mkdir()
    (package / "__init__.py").write_text("")
    shutil.copy(SIMPLE_ROB.file, package / "rover.xml")
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "slalom.py").write_text("\n".join(re.findall(r"```python\n(.*?)```", section, re.DOTALL)))
    slalom = importlib.import_module("slalom").slalom
    assert slalom.robot.file == str(package / "rover.xml")
    assert slalom.scene.model.nu == slalom.action_size > 0


@pytest.mark.parametrize(
    ("xml", "said"),
    [
        ("my_robots:rover.xml", "there is no package 'my_robots'. Write PACKAGE:PATH"),
        ("rover.xml", "there is no package 'rover.xml'. Write PACKAGE:PATH"),
        (":rover.xml", "there is no package ''. Write PACKAGE:PATH"),
        ("evoclaims:rover.xml", "there is no file "),
    ],
)
def test_a_model_that_is_not_there_is_a_sentence(xml: str, said: str) -> None:
    with pytest.raises(UserError, match="The robot 'rover' has its model in ") as error:
        _ = Robot("rover", xml).file
    assert said in str(error.value)
