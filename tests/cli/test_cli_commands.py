"""The command line in the tiny project: what each command does, prints and returns."""

from __future__ import annotations

import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from tiny_project import Evoclaims, Project, trials_of

from evoclaims.cli import main
from evoclaims.judging.design import SEQUENTIAL
from evoclaims.paper import references
from evoclaims.paper.reproduction import Reproduction
from evoclaims.trials.store import Store


def test_run_runs_what_is_missing_and_lists_the_trials(evoclaims: Evoclaims) -> None:
    status, out, err = evoclaims("run", "right", "--trials", "2", "--first-seed", "7", "--device", "cpu")
    assert (status, err) == (0, "")
    lines = [line for line in out.splitlines() if "seed" in line or line.startswith("right")]
    assert lines[0] == "right on parity (smoke)"
    assert [re.sub(r" \(.*", "", line) for line in lines[1:]] == [
        f"  seed {seed}: done after 4 environment steps, success by level 1.000" for seed in (7, 8)
    ]
    assert len(Store(Path(".evoclaims")).ids()) == 2


def test_a_second_run_runs_nothing(evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch) -> None:
    first = evoclaims("run", "wrong", "--trials", "3")
    monkeypatch.setattr("evoclaims.trials.runner.Lanes", None)
    second = evoclaims("run", "wrong", "--trials", "3")
    trials = [[line for line in out.splitlines() if "seed" in line] for _, out, _ in (first, second)]
    assert trials[0] == trials[1]
    assert len(trials[0]) == 3
    assert second[0] == 0
    assert ["nothing was run: all were stored" in out for _, out, _ in (first, second)] == [False, True]


def test_an_edited_method_of_the_same_revision_is_told_wherever_its_trials_count(
    evoclaims: Evoclaims, project: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # two edits in one second would share it
    project.write(a="undecided")
    told = "the code of tiny_paper.Coin was edited after trials had run, and they still count"
    paper = Path("tiny_paper.py")

    def after(old: str = "", new: str = "") -> list[bool]:
        text = paper.read_text(encoding="utf-8")
        paper.write_text(text.replace(old, new) if old else text, encoding="utf-8")
        sys.modules.pop("tiny_paper", None)
        return [told in evoclaims(*command)[1] for command in (("run", "coin"), ("run", "coin"), ("status",))]

    assert after() == [False, False, False]
    assert after("1.0, -1.0)", "2.0, -2.0)") == [True, True, True]
    assert "a (smoke)" in evoclaims("status")[1].partition(told)[2]
    assert after("revision: ClassVar[int] = 1", "revision: ClassVar[int] = 2") == [False, False, False]


def test_run_can_be_held_to_a_task_and_a_tier(evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, int]] = []

    def fetch(self: object, condition: Any, seeds: range) -> list[Any]:
        asked.append((condition.label, condition.steps))
        return []

    monkeypatch.setattr("evoclaims.claims.fetching.RunMissing.__call__", fetch)
    assert evoclaims("run", "--on", "parity", "--tier", "full")[0] == 0
    assert asked == [(f"{n} on n_parity", 2) for n in ("hand_built", "hand_built_negated", "coin", "broken")]


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (
            ("run", "rihgt"),
            "There is no method named 'rihgt'. Did you mean 'right'? Known: broken, coin, right, wrong.",
        ),
        (("run", "--on", "partiy"), "There is no task named 'partiy'. Did you mean 'parity'? Known: parity."),
        (("run", "right", "--on", "x"), "There is no task for right named 'x'. Known: parity."),
        (
            ("run", "right", "--trials", "0"),
            "--trials takes 1 to 100 trials a condition (no verdict looks at more), not 0.",
        ),
        (("run", "right", "--trials", "101"), "not 101. Further seeds are run by another call, with --first-seed."),
        (("run", "right", "--trials", "1000000000000"), "--trials takes 1 to 100 trials a condition"),
        (("run", "right", "--first-seed", "-1"), "A seed is 0 or above and below 2147483648, not -1."),
        (("run", "right", "--first-seed", "2147483647"), "A seed is 0 or above and below 2147483648, not 2147483648."),
        (("run", "right", "--device", "tpu"), "There is no device named 'tpu'. Did you mean 'gpu'?"),
        (("run", "right", "--storage", "pyproject.toml"), "is a file, not a folder"),
        (("run", "--tier", "ful"), "There is no tier named 'ful'. Did you mean 'full'? Known: full, smoke."),
        (("plan", "--tier", "ful"), "There is no tier named 'ful'."),
        (("plan", "--device", "tpu"), "There is no device named 'tpu'."),
        (("plan", "--variant", "trade"), "There is no variant named 'trade'. Did you mean 'traded'? Known: traded."),
        (("status", "--tier", "ful"), "There is no tier named 'ful'."),
        (("status", "--storage", "pyproject.toml"), "is a file, not a folder"),
        (("reference", "--tier", "ful"), "There is no tier named 'ful'."),
        (("reference",), "No condition of the smoke tier has 10 stored trials; run them first"),
        (("verify", "--storage", "pyproject.toml"), "is a file, not a folder"),
    ],
)
def test_a_users_mistake_is_one_sentence_and_status_2(
    evoclaims: Evoclaims, arguments: tuple[str, ...], text: str
) -> None:
    status, _, err = evoclaims(*arguments)
    assert status == 2
    assert err.startswith("evoclaims: ")
    assert text in err


@pytest.mark.parametrize("command", [("status",), ("new", "here")])
def test_an_option_that_a_command_lacks_is_told_with_its_usage(
    command: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([*command, "--teir", "full"])
    assert ended.value.code == 2
    err = capsys.readouterr().err
    assert err.startswith(f"usage: evoclaims {command[0]} [-h]")
    assert f"evoclaims {command[0]}: error: unrecognized arguments: --teir" in err


@pytest.mark.parametrize("command", ["plan", "run", "status", "reference"])
def test_outside_of_a_project_a_command_says_what_is_missing(
    evoclaims: Evoclaims, tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch, command: str
) -> None:
    monkeypatch.chdir(tmp_path_factory.mktemp("elsewhere"))
    status, _, err = evoclaims(command)
    assert (status, err.count("\n")) == (2, 1)
    assert "has a [tool.evoclaims] table" in err


RAISING = """

class Leaving(Coin):
    name: ClassVar[str] = "leaving"

    def step(self, key, task, level, state):
        raise SystemExit("gone")


@dataclass(frozen=True)
class BrokenParity(NParity):
    def examine(self, policy, key, level):
        return super().examine(policy, key, level).nonsense


def with_raising(generations):
    found = {("leaving", "parity"): replace(conditions(generations)["coin", "parity"], method=Leaving())}
    found["broken", "parity"] = conditions(generations)["broken", "parity"]
    found["coin", "broken_parity"] = replace(conditions(generations)["coin", "parity"], task=BrokenParity(2))
    return {**found, ("right", "parity"): conditions(generations)["right", "parity"]}


REPRODUCTION = replace(REPRODUCTION, tiers={"smoke": Tier(with_raising(1), Design.fixed(10))}, variants={})
"""


def test_a_method_or_task_that_raises_is_a_sentence_and_the_other_conditions_run(evoclaims: Evoclaims) -> None:
    reproduction = Path("tiny_paper.py")
    reproduction.write_text(reproduction.read_text() + RAISING)
    lines = reproduction.read_text().splitlines()
    places = [
        1 + lines.index(f"        {line}")
        for line in (
            'raise SystemExit("gone")',
            'raise RuntimeError("out of order")',
            "return super().examine(policy, key, level).nonsense",
        )
    ]
    status, out, err = evoclaims("run")
    assert status == 1
    assert err.splitlines() == [
        f"evoclaims: leaving on parity (smoke) failed: SystemExit: gone (tiny_paper.py, line {places[0]}).",
        f"evoclaims: broken on parity (smoke) failed: RuntimeError: out of order (tiny_paper.py, line {places[1]}).",
        "evoclaims: coin on broken_parity (smoke) failed: AttributeError: 'Episode' object has no attribute 'nonsense' "
        f"(tiny_paper.py, line {places[2]}).",
        "evoclaims: 3 of 4 conditions failed.",
    ]
    assert "right on parity (smoke)" in out.splitlines()
    assert len(Store(Path(".evoclaims")).ids()) == 10
    assert evoclaims("run", "right")[0] == 0


def test_what_the_projects_own_code_raises_in_any_command_is_a_sentence_with_its_place(evoclaims: Evoclaims) -> None:
    reproduction = Path("tiny_paper.py")
    lines = reproduction.read_text().splitlines()
    place = lines.index("        return task.horizon")
    lines[place] = "        return task.nothing"
    reproduction.write_text("\n".join(lines).replace('"right": HandBuilt()', '"right": Coin()'))
    status, _, err = evoclaims("plan")
    said = f"AttributeError: 'NParity' object has no attribute 'nothing' (tiny_paper.py, line {place + 1})"
    assert (status, err) == (2, f"evoclaims: {said}.\n")


def test_an_error_that_may_be_of_evoclaims_keeps_its_traceback(
    evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("evoclaims.cli.plan.devices.choose", lambda name: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        evoclaims("plan")


def test_a_record_that_is_damaged_keeps_no_other_condition_from_running(evoclaims: Evoclaims, stored: Store) -> None:
    (record,) = (path for path in stored.record_files(stored.ids()[3]) if path.exists())
    record.write_bytes(record.read_bytes()[:50])
    status, out, err = evoclaims("run", "--on", "parity", "--trials", "10")
    assert status == 1
    assert err.count(str(record)) == 1
    assert sum(line.endswith("on parity (smoke)") for line in out.splitlines()) == 2  # of four, one is broken as such


def test_an_interrupt_ends_the_run_at_once(evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []

    def interrupt(*arguments: object) -> None:
        asked.append(arguments)
        raise KeyboardInterrupt

    monkeypatch.setattr("evoclaims.claims.fetching.RunMissing.__call__", interrupt)
    assert evoclaims("run")[0] == 130
    assert len(asked) == 1


def test_an_interrupted_command_says_that_it_goes_on(evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(*arguments: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("evoclaims.claims.fetching.RunMissing.__call__", interrupt)
    status, _, err = evoclaims("run", "right")
    assert status == 130
    assert "the same command goes on from the last checkpoint" in err


def test_status_shows_the_verdicts_that_the_store_gives(evoclaims: Evoclaims) -> None:
    status, out, _ = evoclaims("status")
    assert status == 0
    assert "claims (smoke): 2 not run" in out
    assert not Path(".evoclaims").exists()
    evoclaims("run", "right")
    status, out, _ = evoclaims("status")
    assert (status, out.splitlines()[-1]) == (0, "claims (smoke): 1 supported, 1 not run")
    evoclaims("run", "wrong")
    status, out, _ = evoclaims("status")
    assert (status, out.splitlines()[-1]) == (1, "claims (smoke): 1 supported, 1 refuted")
    assert re.search(r"^b +b in small \(§1\) +✗ refuted +10 ", out, re.MULTILINE)
    assert evoclaims("status", "--tier", "full")[1].splitlines()[-1] == "claims (full): 2 not run"


def test_claims_that_cannot_be_collected_are_named_with_the_reason(
    evoclaims: Evoclaims, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("claims/test_more.py").write_text("import a_package_that_is_not_installed\n")
    assert main(["status"]) == 2
    err = capsys.readouterr().err
    assert "cannot be collected" in err
    assert "claims/test_more.py" in err
    assert "No module named 'a_package_that_is_not_installed'" in err


def test_plan_counts_what_is_stored_and_what_is_missing(evoclaims: Evoclaims) -> None:
    status, out, _ = evoclaims("plan")
    assert status == 0
    assert re.search(r"^right on parity +0 +10 +40 +unknown$", out, re.MULTILINE)
    assert re.search(r"^total +80 +unknown$", out, re.MULTILINE)
    assert "Times are by" not in out
    assert re.search(r"^a +10 +0.05 +0.028 +\S+ +✓ ✗$", out, re.MULTILINE)
    assert "--measure times a few steps" in out
    assert "coin" not in out  # no claim asks for it
    evoclaims("run", "right", "--trials", "4")
    status, out, _ = evoclaims("plan")
    assert re.search(r"^right on parity +4 +6 +24 +\d+ s$", out, re.MULTILINE)
    assert re.search(r"^wrong on parity +0 +10 +40 +unknown$", out, re.MULTILINE)


def test_plan_says_which_claim_cannot_be_judged_and_why(evoclaims: Evoclaims, project: Project) -> None:
    project.write(c="verdict(trials('rigth', on='parity').mean_success > 0)")
    status, out, _ = evoclaims("plan")
    assert status == 0
    assert "c: error: There is no method named 'rigth'. Did you mean 'right'?" in " ".join(out.split())


def test_plan_shows_whole_numbers_on_a_narrow_terminal(evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "52")
    _, out, _ = evoclaims("plan")
    assert re.search(r"^right on +0 +10 +40 +unknown *\nparity *$", out, re.MULTILINE), out
    assert re.search(r"^a +10 +0.05 +0.028 +\S+ +✓ ✗$", out, re.MULTILINE), out
    monkeypatch.setenv("COLUMNS", "30")  # too narrow for the numbers alone: lines are longer, and nothing is cut
    _, out, _ = evoclaims("plan")
    assert re.search(r"^right on parity +0 +10 +40 +unknown$", out, re.MULTILINE), out
    assert re.search(r"^a +10 +0.05 +0.028 +\S+ +✓ ✗$", out, re.MULTILINE), out
    monkeypatch.setenv("COLUMNS", "0")  # a terminal that knows no size
    _, out, _ = evoclaims("plan")
    assert re.search(r"^right on parity +0 +10 +40 +unknown$", out, re.MULTILINE), out


def test_plan_tells_times_as_of_a_device_that_trials_were_made_on(evoclaims: Evoclaims) -> None:
    evoclaims("run", "right", "--trials", "4")
    status, out, _ = evoclaims("plan", "--like", "cpu")
    assert status == 0
    assert "as they took on one cpu" in out
    assert re.search(r"^right on parity +4 +6 +24 +\d+ s$", out, re.MULTILINE)
    status, _, err = evoclaims("plan", "--like", "abacus")
    assert status == 2
    assert "No trial of the smoke tier at hand was made on a device called 'abacus'" in err


def test_plan_of_a_variant_has_what_it_changes_and_the_claims_that_read_it(
    evoclaims: Evoclaims, project: Project, stored: Store
) -> None:
    """The variant's right network is the protocol's wrong one, whose trials are stored."""
    assert evoclaims("reference")[0] == 0
    status, out, _ = evoclaims("plan", "--variant", "traded")
    assert status == 0
    assert "Conditions of the smoke tier that traded changes, on " in out
    assert re.search(r"^right on parity +10 +0 +0 +0 s$", out, re.MULTILINE)
    assert "wrong on parity" not in out
    assert re.search(r"^a +10 +0.05 ", out, re.MULTILINE)
    assert not re.search(r"^b ", out, re.MULTILINE)
    project.write(b="refuted")
    status, _, err = evoclaims("plan", "--variant", "traded")
    assert status == 2
    assert err == "evoclaims: The variant traded changes no condition that claims of the smoke tier read.\n"


def test_plan_tells_what_the_reference_trials_have_cost(evoclaims: Evoclaims, stored: Store) -> None:
    assert "reference trials" not in evoclaims("plan")[1]
    assert evoclaims("reference")[0] == 0
    path = Path("reference/smoke/right-parity.jsonl")
    device = {"platform": "gpu", "kind": "NVIDIA Abacus", "count": 1}
    timing = {"run": 7000.0, "compile": 200.0, "batch": 10, "started": "2026-01-01T00:00:00+00:00"}
    references.write(path, [replace(t, provenance={"device": device}, timing=timing) for t in references.load(path)])
    made_here = Path("reference/smoke/wrong-parity.jsonl").rename("wrong-parity.jsonl")
    out = evoclaims("plan")[1]
    assert re.search(r"took on one *\n.*NVIDIA Abacus$", out, re.MULTILINE)
    assert re.search(r"^right on parity +10 +0 +0 +0 s$", out, re.MULTILINE)
    assert re.search(r"^right on parity +2 h 00 min$", out, re.MULTILINE)
    assert re.search(r"^wrong on parity +not run$", out, re.MULTILINE)
    assert re.search(r"^total +2 h 00 min *\n +and more$", out, re.MULTILINE)
    assert "Fewer than 10 reference trials: wrong on parity (0)." in out
    assert re.search(r"^a +10 +.*✓ ✗ +2 h 00 min$", out, re.MULTILINE)
    assert re.search(r"^b +10 +.*✓ ✗ +not run$", out, re.MULTILINE)
    made_here.rename("reference/smoke/wrong-parity.jsonl")
    out = evoclaims("plan")[1]
    assert re.search(r"^wrong on parity +– ", out, re.MULTILINE)
    assert re.search(r"^total +2 h 00 min .*\n +and elsewhere", out, re.MULTILINE)


def test_plan_tells_the_hours_of_a_cpu_core(evoclaims: Evoclaims, stored: Store) -> None:
    assert evoclaims("reference")[0] == 0
    out = evoclaims("plan", "--tier", "full")[1]
    assert re.search(r" CPU\n.* core hours$", out, re.MULTILINE)
    assert "took on one" not in out
    assert re.search(r"^right on parity +0 +10 +80 +unknown$", out, re.MULTILINE)
    assert re.search(r"^right on parity +< 1$", out, re.MULTILINE)


def test_plan_times_a_few_steps_where_it_is_asked_to_and_stores_none(evoclaims: Evoclaims) -> None:
    status, out, _ = evoclaims("plan", "--measure", "--tier", "full")
    assert status == 0
    assert re.search(r"^right on parity +0 +10 +80 +\d+ s$", out, re.MULTILINE)
    assert "unknown" not in out
    assert not Path(".evoclaims/trials").exists()


def test_verify_moves_bad_files_aside_and_the_trials_run_again(evoclaims: Evoclaims, stored: Store) -> None:
    assert evoclaims("verify")[:2] == (0, "20 trials in .evoclaims, 0 problems\n")
    record = stored.record_files(stored.ids()[3])[-1]
    record.write_bytes(record.read_bytes()[:50])
    stored.checkpoints.mkdir()
    (stored.checkpoints / "torn.npz").write_bytes(b"PK")
    status, out, _ = evoclaims("verify", "--dry-run")
    assert (status, out.splitlines()[-1]) == (1, "20 trials in .evoclaims, 3 problems")
    assert record.exists()
    status, out, _ = evoclaims("status")
    assert (status, out.splitlines()[-1].count("1 error")) == (1, 1)
    assert "run `evoclaims verify`" in out
    status, out, _ = evoclaims("verify")
    assert (status, out.splitlines()[-1]) == (1, "19 trials in .evoclaims, 3 problems")
    assert str(record) in out
    assert not record.exists()
    assert evoclaims("verify")[0] == 0
    for method in ("right", "wrong"):
        evoclaims("run", method)
    assert len(stored.ids()) == 20


def test_verify_reads_no_verdicts_and_says_so(evoclaims: Evoclaims, stored: Store) -> None:
    verdict = stored.root / "verdicts" / "smoke" / "a.json"
    verdict.parent.mkdir(parents=True)
    verdict.write_text("torn")
    assert evoclaims("verify")[:2] == (0, "20 trials in .evoclaims, 0 problems\n")
    assert evoclaims("status")[1].splitlines()[-1] == "claims (smoke): 1 supported, 1 refuted"


def test_the_help_of_verify_says_what_is_read(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["verify", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert "read every stored trial, champion and checkpoint back" in text
    assert "verdicts are not read: `evoclaims status` judges the trials anew" in text


def test_a_device_without_enough_memory_is_one_sentence(evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch) -> None:
    import jax

    from evoclaims.trials.lanes import Lanes

    def advance(*arguments: object) -> None:
        raise jax.errors.JaxRuntimeError("RESOURCE_EXHAUSTED: Out of memory allocating 17179869184 bytes.")

    monkeypatch.setattr(Lanes, "advance", advance)
    status, _, err = evoclaims("run", "right", "--trials", "50")
    assert (status, err.count("\n")) == (1, 1)
    assert err.startswith("evoclaims: right on parity (smoke) failed: The device's memory ")
    assert (
        "does not hold 1 trial of hand_built on n_parity at once, and fewer cannot be run. Close what else uses" in err
    )


def test_reference_commits_the_trials_of_every_condition_that_has_enough(evoclaims: Evoclaims) -> None:
    evoclaims("run", "right")
    evoclaims("run", "wrong", "--trials", "9")
    status, out, _ = evoclaims("reference")
    path = references.path_of(Path.cwd() / "reference", "smoke", "right", "parity")
    assert status == 0
    assert f"wrote {path}: 10 trials" in out
    assert "left alone: wrong on parity: 9 of 10 trials are stored or committed" in out
    assert [trial.seed for trial in references.load(path)] == list(range(10))
    assert not references.path_of(Path.cwd() / "reference", "smoke", "wrong", "parity").exists()


def test_reference_takes_the_trials_of_a_look_and_never_fewer_than_are_committed(
    evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch
) -> None:
    plain = Reproduction.tier
    monkeypatch.setattr(Reproduction, "tier", lambda self, *names: replace(plain(self, *names), design=SEQUENTIAL))
    evoclaims("run", "right", "--trials", "6")
    evoclaims("run", "wrong", "--trials", "4")
    status, out, _ = evoclaims("reference")
    path = references.path_of(Path.cwd() / "reference", "smoke", "right", "parity")
    assert status == 0
    assert f"wrote {path}: 5 trials" in out
    assert "left alone: wrong on parity: 4 of 5 trials are stored or committed" in out
    evoclaims("run", "right")
    assert f"wrote {path}: 10 trials" in evoclaims("reference")[1]
    before = [(trial.seed, trial.digest) for trial in references.load(path)]
    assert len(before) == 10
    evoclaims("run", "right", "--trials", "6", "--storage", "other")
    assert f"wrote {path}: 10 trials" in evoclaims("reference", "--storage", "other")[1]
    assert [(trial.seed, trial.digest) for trial in references.load(path)] == before


def test_stored_trials_join_those_that_are_committed(evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch) -> None:
    plain = Reproduction.tier
    monkeypatch.setattr(Reproduction, "tier", lambda self, *names: replace(plain(self, *names), design=SEQUENTIAL))
    evoclaims("run", "right", "--trials", "5")
    evoclaims("reference")
    evoclaims("run", "right", "--trials", "4", "--first-seed", "5", "--storage", "later")
    status, out, err = evoclaims("reference", "--storage", "later")
    path = references.path_of(Path.cwd() / "reference", "smoke", "right", "parity")
    assert f"wrote {path}: 5 trials" in out
    evoclaims("run", "right", "--trials", "5", "--first-seed", "5", "--storage", "later")
    assert f"wrote {path}: 10 trials" in evoclaims("reference", "--storage", "later")[1]
    assert [trial.seed for trial in references.load(path)] == list(range(10))
    evoclaims("run", "wrong", "--trials", "4", "--storage", "few")
    status, _, err = evoclaims("reference", "--storage", "few")
    assert (status, "No condition of the smoke tier has 5 stored trials" in err) == (2, True)


def test_reference_says_which_claim_it_cannot_write_the_trials_of(evoclaims: Evoclaims, stored: Store) -> None:
    record = stored.record_files(trials_of(stored, "hand_built_negated")[3].id)[-1]
    record.write_bytes(record.read_bytes()[:50])
    status, out, _ = evoclaims("reference")
    assert status == 0
    assert f"left alone: what b alone reads, which is error now: Cannot use {record.absolute()}: " in out
    assert [path.name for path in Path("reference/smoke").iterdir()] == ["right-parity.jsonl"]
