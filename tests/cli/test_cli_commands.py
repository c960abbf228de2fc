"""The command line in the tiny project: what each command does, prints and returns."""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

import pytest
from tiny_project import Evoclaims

from evoclaims.cli import main
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
    again = evoclaims("run", "right", "--trials", "2", "--first-seed", "7", "--device", "cpu")[1]
    assert "nothing was run: all were stored" in again
    assert [line for line in again.splitlines() if "seed" in line] == lines[1:]


def test_an_edited_method_of_the_same_revision_is_told_wherever_its_trials_count(
    evoclaims: Evoclaims, project: Any
) -> None:
    project.write(a="undecided")
    told = "the code of tiny_paper.Coin was edited or renamed after trials had run, and they still count"
    paper = Path("tiny_paper.py")

    def after(old: str = "", new: str = "") -> list[bool]:
        text = paper.read_text(encoding="utf-8")
        paper.write_text(text.replace(old, new) if old else text, encoding="utf-8")
        sys.modules.pop("tiny_paper", None)
        more = ("reference", "--unknown-revision"), ("accept", "--tier", "smoke"), ("compare", "--tier", "smoke")
        return [told in evoclaims(*command)[1] for command in (("run", "coin"), ("run", "coin"), ("status",), *more)]

    assert after() == [False] * 6
    Path("verdicts.toml").unlink()
    assert after("1.0, -1.0)", "2.0, -2.0)") == [True] * 6
    assert "a (smoke)" in evoclaims("status")[1].partition(told)[2]
    assert after("revision: ClassVar[int] = 1", "revision: ClassVar[int] = 2") == [False] * 6


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
            "--trials takes 1 to 100 trials per condition (no verdict reads more), not 0.",
        ),
        (("run", "right", "--trials", "101"), "not 101. Run further seeds by `evoclaims run` with --first-seed."),
        (("run", "right", "--first-seed", "-1"), "A seed is a whole number from 0 to 2147483647, not -1."),
        (
            ("run", "right", "--first-seed", "2147483647"),
            "A seed is a whole number from 0 to 2147483647, not 2147483648.",
        ),
        (("reference",), "No condition of the smoke tier has 10 stored trials; run them first"),
    ],
)
def test_a_users_mistake_is_one_sentence_and_status_2(
    evoclaims: Evoclaims, arguments: tuple[str, ...], text: str
) -> None:
    status, _, err = evoclaims(*arguments)
    assert status == 2
    assert err.startswith("evoclaims: ")
    assert text in err


def test_an_option_that_a_command_lacks_is_told_with_its_usage(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["new", "here", "--teir", "full"])
    assert ended.value.code == 2
    err = capsys.readouterr().err
    assert err.startswith("usage: evoclaims new [-h]")
    assert "evoclaims new: error: unrecognized arguments: --teir" in err


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


def test_a_method_or_task_that_raises_is_a_sentence_and_the_other_conditions_run(
    project: Any, evoclaims: Evoclaims
) -> None:
    asked = {"b": ("leaving", "parity"), "c": ("broken", "parity"), "d": ("coin", "broken_parity")}
    body = "verdict(trials('{}', on='{}').solves_every_level.in_most_trials())"
    project.write(a="supported", **{name: body.format(*names) for name, names in asked.items()})
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


def test_an_interrupt_ends_the_run_at_once_and_says_that_it_goes_on(
    evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[object] = []

    def interrupt(*arguments: object) -> None:
        asked.append(arguments)
        raise KeyboardInterrupt

    monkeypatch.setattr("evoclaims.claims.fetching.RunMissing.__call__", interrupt)
    status, _, err = evoclaims("run")
    assert (status, len(asked)) == (130, 1)
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
