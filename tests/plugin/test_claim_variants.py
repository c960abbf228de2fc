"""Claims under a variant of the protocol."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable

import pytest
from tiny_project import REPRODUCTION, Project

from evoclaims.cli import main

Sentence = Callable[[pytest.RunResult, str], None]


def test_a_variant_is_judged_from_its_own_trials_where_it_has_some_and_its_evidence_lies_apart(
    project: Project,
) -> None:
    project.write(first="supported", second="refuted")
    project.run("-m", "smoke")
    assert project.run("-m", "smoke", "--claims-variant=traded", "--claims-json=out.json").ret == 0
    first, second = json.loads((project.path / "out.json").read_text())["claims"]
    assert (first["outcome"], first["variant"], second["outcome"]) == ("refuted", "traded", "not run")
    assert "changes none of its trials" in second["reason"]
    folder = project.store / "verdicts" / "smoke"
    plain, varied = folder / "first.json", folder / "variants" / "traded" / "first.json"
    assert [json.loads(path.read_text())["outcome"] for path in (plain, varied)] == ["supported", "refuted"]


def test_what_is_accepted_of_the_protocol_is_not_of_a_variant(project: Project) -> None:
    project.write(
        """
@says("first", expect="supported", because="so it is")
def test_first(trials, verdict):
    verdict(trials("right", on="parity").solves_every_level.in_most_trials())
"""
    )
    assert project.json("-m", "smoke")["claims"][0]["expected"] == "supported"
    assert project.json("-m", "smoke", "--claims-variant=traded")["claims"][0]["expected"] is None


def test_an_unknown_variant_is_a_sentence_with_the_known_ones(project: Project, sentence: Sentence) -> None:
    project.write(first="supported")
    result = project.run("-m", "smoke", "--claims-variant=trade")
    sentence(result, "There is no variant named 'trade'. Did you mean 'traded'? Known: traded.")
    assert result.ret == 4


def test_the_command_runs_what_a_variant_changes_and_says_what_hangs_on_it(
    project: Project, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(project.path)
    project.write(first="supported", second="refuted")
    assert project.run("-m", "smoke", own_store=True).ret == 1
    capsys.readouterr()
    assert main(["run", "--variant", "traded"]) == 0
    shown = capsys.readouterr().out
    assert "right on parity (smoke)" in shown
    assert "  right on parity (smoke): stored\nabout 0 s on such a device (cpu)\n" in shown
    assert "wrong on parity (smoke)" not in shown
    assert "traded: The right network is wrong" in shown
    assert "first: supported -> refuted" in shown
    assert "second" not in shown
    assert main(["reference", "--unknown-revision", "--variant", "traded"]) == 0
    written = project.path / "reference" / "variants" / "traded" / "smoke"
    assert [path.name for path in written.iterdir()] == ["right-parity.jsonl"]
    capsys.readouterr()
    shutil.rmtree(".evoclaims")
    assert main(["run", "--variant", "traded"]) == 0
    committed = "  right on parity (smoke): committed, so not run; name method and task to run it here"
    assert committed in capsys.readouterr().out.splitlines()
    assert main(["run", "right", "--on", "parity", "--variant", "traded", "--trials", "2"]) == 0
    assert "right on parity (smoke)" in capsys.readouterr().out.splitlines()
    shutil.rmtree("reference")
    assert main(["run", "--variant", "traded"]) == 0
    shown = capsys.readouterr().out
    assert re.search(r"^  right on parity \(smoke\): 8 trials to run, about \d+ s$", shown, re.MULTILINE)
    assert "  first: refuted; not run under the protocol itself" in shown.splitlines()
    assert shown.index("8 trials to run") < shown.index("\nright on parity (smoke)\n")
    assert main(["run", "wrong", "--variant", "traded"]) == 2
    assert "changes none of these conditions" in capsys.readouterr().err


def test_a_condition_that_another_variant_has_committed_is_not_written_again(
    project: Project, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    one = '{"traded": Variant('
    assert one in REPRODUCTION
    swapped = '"swapped": Variant("It is swapped", {"smoke": traded_in(1)})'
    twice = REPRODUCTION.replace(one, f"{{{swapped}, {one[1:]}")
    monkeypatch.chdir(project.path)
    project.pytester.makepyfile(tiny_paper=twice)
    project.write(first="supported", second="refuted")
    shutil.copytree(project.store, ".evoclaims")
    assert main(["reference", "--unknown-revision", "--variant", "traded"]) == 0
    before = sorted(project.path.glob("reference/**/*.jsonl"))
    assert len(before) == 1
    capsys.readouterr()
    assert main(["reference", "--unknown-revision", "--variant", "swapped"]) == 0
    said = "left alone: right on parity: the same condition as under traded, committed there\n"
    assert capsys.readouterr().out == said
    assert sorted(project.path.glob("reference/**/*.jsonl")) == before
    assert (
        main(["reference", "--unknown-revision", "--variant", "traded"]) == 0
    )  # under its own name it is written anew
    assert "wrote " in capsys.readouterr().out


def test_a_variant_without_trials_says_how_they_are_run(
    project: Project, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(project.path)
    project.write(first="supported")
    assert main(["reference", "--unknown-revision", "--variant", "traded"]) == 2
    said = (
        "evoclaims: No condition of the smoke tier that traded changes has 10 stored trials; run them first with "
        "`evoclaims run --tier smoke --variant traded`.\n"
    )
    assert capsys.readouterr().err == said
