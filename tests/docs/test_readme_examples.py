"""README: every block of code does what README shows, and its findings are those of the table below them."""

from __future__ import annotations

import json
import re
import shlex
import subprocess
import sys
import tomllib
from configparser import ConfigParser
from pathlib import Path

import pytest

from evoclaims import cli
from evoclaims.report.verdict_overview import HEADINGS, WORDS

ROOT = Path(__file__).parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"```(\w+)\n(.*?)```", README, re.DOTALL)
CLAIM, TOX, OUTPUT, PROJECT, OWN_CLAIM, COMMANDS = (text for _, text in BLOCKS)
ROWS = [line.strip("| ").split(" | ") for line in README.splitlines() if line.startswith("| ")]
TABLE = {cells[0]: dict(zip(ROWS[0], cells, strict=True)) for cells in ROWS[2:]}

IN_ONE_PROCESS = """
import json, pytest, sys
from evoclaims.cli import main
run = {"pytest": lambda words: pytest.main([*words, "-p", "no:xdist", "--claims-json=out.json"]), "evoclaims": main}
print([int(run[words[0]](words[1:])) for words in json.loads(sys.argv[1])])
"""


def _commands(block: str) -> list[list[str]]:
    """Return the commands of a block, each as its words."""
    return [words for line in block.splitlines() for words in _split(shlex.split(line, comments=True))]


def _split(words: list[str]) -> list[list[str]]:
    """Return the commands of a line that && joins."""
    if "&&" not in words:
        return [words]
    place = words.index("&&")
    return [words[:place], *_split(words[place + 1 :])]


def test_it_is_short() -> None:
    assert len(README.splitlines()) <= 150
    assert len(README.encode()) <= 8192


def test_the_claim_that_is_shown_is_a_claim_of_the_paper() -> None:
    """Where the sentence is in the source, how it is read and since when are left out."""
    claims = [path.read_text(encoding="utf-8") for path in (ROOT / "claims").glob("*.py")]
    assert any(CLAIM.strip() in re.sub(r"^    (line|read|since)=.*\n", "", text, flags=re.MULTILINE) for text in claims)


def test_the_two_commands_run_the_claims_at_smoke_and_the_tests() -> None:
    settings = ConfigParser(interpolation=None)
    settings.read(ROOT / "tox.ini")
    assert _commands(TOX) == [["python", "-m", "pip", "install", "tox"], ["tox", "-e", "smoke"], ["tox", "-e", "tests"]]
    runs = {name: settings[f"testenv:{name}"]["commands"].split() for name in ("smoke", "tests")}
    assert runs["smoke"][:4] == ["pytest", "-m", "smoke", "claims"]
    assert runs["tests"][:2] == ["pytest", "tests"]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    versions = [words[-1] for line in project["classifiers"] if (words := line.split(" :: "))[1:2] == ["Python"]]
    assert f"(Python {versions[0]} to {versions[-1]})" in TOX


def test_the_table_of_verdicts_is_what_the_committed_trials_give(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("COLUMNS", str(max(map(len, OUTPUT.splitlines()))))
    names = ",".join(line.split()[0] for line in OUTPUT.splitlines()[1:])
    cli.main(["status", "--only", names, "--storage", str(tmp_path)])
    printed = [line.replace("†", " ").rstrip() for line in capsys.readouterr().out.splitlines()]
    assert printed[: len(OUTPUT.splitlines())] == OUTPUT.splitlines()


def test_the_new_project_runs_with_the_method_and_the_claim_that_are_added(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    new, enter, *begin, run = _commands(PROJECT)
    folder = tmp_path / enter[1]
    monkeypatch.chdir(tmp_path)
    assert cli.main(new[1:]) == 0
    assert f"wrote 7 files to {folder}; next:" in capsys.readouterr().out
    who = ["-c", "user.name=someone", "-c", "user.email=someone@example.org"]
    for command in begin:
        subprocess.run([command[0], *who, *command[1:]], cwd=folder, check=True, capture_output=True)
    (package,) = re.findall(r"`(reproductions/\S+\.py)`", README)
    (method,) = re.findall(r"`(METHODS\[.*?)`", README)
    text = (folder / package).read_text()
    before, line, after = text.partition("TASKS = ")
    (folder / package).write_text(f"{before}{method}\n{line}{after}")
    (claims,) = re.findall(r"`(claims/\S+\.py)`", README)
    with (folder / claims).open("a") as file:
        file.write(f"\n\n{OWN_CLAIM}")
    commands = [run, *_commands(COMMANDS)]
    ran = subprocess.run(
        [sys.executable, "-W", "error", "-c", IN_ONE_PROCESS, json.dumps(commands)],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
    )
    ends = {"accept": 1, "watch": 2}  # a new project has no committed trials to watch
    statuses = [ends.get(words[1], 0) for words in commands]
    assert ran.stdout.splitlines()[-1:] == [str(statuses)], ran.stdout + ran.stderr
    assert "has ten committed trials" in ran.stderr
    judged = {one["claim"]: one for one in json.loads((folder / "out.json").read_text())["claims"]}
    assert [judged[claim]["outcome"] for claim in ("H1", "H2")] == ["supported", "supported"]
    assert judged["H3"]["verdict"]["n"] == 10
    assert (folder / "report" / "index.html").is_file()


def test_each_finding_names_verdicts_that_the_table_has() -> None:
    """A finding ends with claims and their marks: of the text's protocol, or of a column that is named."""
    findings = re.findall(r"^\* .*$", README.partition("## What came out")[2].partition("| claim")[0], re.MULTILINE)
    found = 0
    for finding in findings:
        for column, claim, shown in re.findall(r"(?:(\w+): )?\b([A-Z]\d+) (\(✓\)|[✓✗?])", finding):
            assert TABLE[claim][column or "text"] == shown, finding
            found += 1
    assert 3 <= len(findings) <= 6
    assert found >= len(findings)


def test_sentences_in_the_table_have_ten_words_at_most() -> None:
    assert tuple(ROWS[0][:2]) == HEADINGS
    assert [row[HEADINGS[1]] for row in TABLE.values() if len(row[HEADINGS[1]].split()) > WORDS] == []
