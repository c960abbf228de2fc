"""The repository that the guide shows is made from the guide, word for word, and run; so are its commands."""

from __future__ import annotations

import json
import re
import shlex
import sys
from pathlib import Path

import pytest

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

IN_ONE_PROCESS = "import sys, json; from evoclaims.cli import main; print([main(c) for c in json.loads(sys.argv[1])])"


def _write(folder: Path, names: set[str]) -> None:
    """Write files of the guide."""
    for name in names:
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(FILES[name], encoding="utf-8")


def _judged(pytester: pytest.Pytester, *options: str) -> dict[str, str]:
    """Run pytest as the guide says, and return the outcomes of claims."""
    result = pytester.runpytest_subprocess(*options, "--claims-json=out.json", "-p", "no:xdist")
    assert result.ret == 0
    claims = json.loads((pytester.path / "out.json").read_text())["claims"]
    return {claim["claim"]: claim["outcome"] for claim in claims}


@pytest.mark.parametrize(
    ("names", "most"),
    [
        (["hill_climber.py"], 30),
        (["majority.py"], 30),
        (["our_paper.py", "claims/test_majority.py"], 40),
        (["whole_paper.py", "claims/test_climbing.py"], 30),
    ],
)
def test_what_the_guide_shows_is_short(names: list[str], most: int) -> None:
    lines = [line for name in names for line in FILES[name].splitlines() if line.strip()]
    assert len(lines) <= most
    assert max(map(len, lines)) <= 120


def test_the_guide_s_repository_comes_to_verdicts_and_its_commands_do_what_they_say(pytester: pytest.Pytester) -> None:
    first = set(FILES) - LATER
    assert {"pyproject.toml", "hill_climber.py", "majority.py", "our_paper.py", "claims/test_majority.py"} == first
    _write(pytester.path, first)
    assert ["pytest", "-m", "smoke"] in COMMANDS
    assert _judged(pytester, "-m", "smoke") == {"H1": "supported", "H2": "supported"}

    _write(pytester.path, LATER)
    settings = FILES["pyproject.toml"].replace('"our_paper"', '"whole_paper"')
    (pytester.path / "pyproject.toml").write_text(settings, encoding="utf-8")
    commands = [words[1:] for words in COMMANDS if words[0] == "evoclaims"]
    assert {"plan", "status", "report", "run", "reference", "accept", "compare"} == {words[0] for words in commands}
    result = pytester.run(sys.executable, "-c", IN_ONE_PROCESS, json.dumps(commands))
    assert result.outlines[-1] == str([int(words[0] == "accept") for words in commands])
    result.stdout.fnmatch_lines(["*H3: supported either way*", "wrote *hill_climber-majority.jsonl: 10 trials"])
    result.stdout.fnmatch_lines(["accepted: H3 (smoke): supported, the first verdict"])

    (under_variant,) = (words[1:] for words in COMMANDS if "--claims-variant" in words)
    assert _judged(pytester, *under_variant) == dict.fromkeys(("H1", "H2", "H3"), "supported")
