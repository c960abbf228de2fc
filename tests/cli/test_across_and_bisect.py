"""`evoclaims across` and `bisect`: what they are asked, and how they search; environments are stood in for by hand."""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from importlib.metadata import PathDistribution, version
from pathlib import Path

import pytest
import unpacked
from hand_made_verdicts import report, verdict
from made_trials import trial_of
from tiny_project import Evoclaims, Project

from evoclaims.cli.elsewhere import Elsewhere, NotJudgedError
from evoclaims.core.environments import Environment, Recipe, installed_here
from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.verdict import Outcome
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.trials.result import TrialResult
from evoclaims.trials.spec import Budget, Condition
from evoclaims.trials.store import Store
from evoclaims.verdicts.across import Judged
from evoclaims.verdicts.source_trials import SourceTrials

RELEASES = [f"1.{minor}" for minor in range(1, 8)]
BISECT = ("bisect", "a", "--package", "pebble", "--good", "1.0", "--bad", "1.8", "--releases", *RELEASES)


@pytest.fixture
def outcomes(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """How the claim ends in each release, for tests to change; what is none of the outcomes is a trouble.

    Under "asked" are the releases in the order in which they were judged.
    """
    known = dict.fromkeys(("1.0", *RELEASES, "1.8"), "supported") | {"asked": ""}

    def judge(self: Elsewhere, recipe: Recipe) -> Judged:
        known["asked"] += f"{recipe.version} "
        outcome = known[recipe.version]
        if outcome == "gone":
            return Judged(recipe.label, {"other": report("other")}, {})
        if outcome == "late":
            late = verdict("inconclusive", without_result="1 of 10 trials ran out of time")
            return Judged(recipe.label, {"a": report("a", "inconclusive", verdict=late)}, {})
        if outcome not in list(Outcome):
            return Judged(recipe.label, {}, {}, trouble=outcome)
        return Judged(recipe.label, {"a": report("a", outcome)}, {})

    monkeypatch.setattr(Elsewhere, "judge", judge)
    return known


def _from(outcomes: dict[str, str], since: str, outcome: str) -> None:
    """Let a claim end otherwise from a release on."""
    outcomes.update({one: outcome for one in (*RELEASES, "1.8") if one >= since})


def test_the_release_is_found_by_a_handful_of_environments(evoclaims: Evoclaims, outcomes: dict[str, str]) -> None:
    _from(outcomes, "1.3", "refuted")
    status, out, _ = evoclaims(*BISECT)
    assert status == 0
    assert "The verdict of a changed in pebble 1.3; 1.2 was still as 1.0." in out
    assert "  pebble 1.3: a: supported -> refuted\n" in out
    assert outcomes["asked"] == "1.0 1.8 1.4 1.2 1.3 "


@pytest.mark.parametrize("instead", ["it cannot be installed", "error", "late"])
def test_a_release_that_cannot_be_judged_is_gone_round_and_told(
    evoclaims: Evoclaims, outcomes: dict[str, str], instead: str
) -> None:
    _from(outcomes, "1.4", "inconclusive")
    outcomes["1.4"] = instead
    status, out, _ = evoclaims(*BISECT)
    assert status == 0
    assert "changed after pebble 1.3 and not later than 1.5; unknown between them:\n  pebble 1.4: " in out
    assert ("it cannot be installed" in out) == (instead not in ("error", "late"))


@pytest.mark.parametrize(("release", "option"), [("1.0", "--good"), ("1.8", "--bad")])
def test_an_end_whose_trials_ran_out_of_time_is_refused(
    evoclaims: Evoclaims, outcomes: dict[str, str], release: str, option: str
) -> None:
    outcomes[release] = "late"
    status, _, err = evoclaims(*BISECT)
    assert (status, err.count("\n")) == (2, 1)
    assert f"pebble {release}, named by {option}, does not decide a, since trials ran out of time" in err


def test_a_claim_that_is_gone_has_changed_and_a_release_without_it_alone_says_nothing(
    evoclaims: Evoclaims, outcomes: dict[str, str]
) -> None:
    _from(outcomes, "1.3", "gone")
    assert "changed in pebble 1.3; 1.2 was still as 1.0." in evoclaims(*BISECT)[1]
    _from(outcomes, "1.3", "refuted")
    outcomes["1.2"] = "gone"
    assert "not later than 1.3; unknown between them:\n  pebble 1.2: the claim is broken or" in evoclaims(*BISECT)[1]


@pytest.mark.parametrize(("kind", "odd"), [("bits", {"machine": "other"}), ("drift", {"few": True})])
def test_a_release_whose_trials_cannot_be_compared_has_not_stayed_the_same(
    evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch, kind: str, odd: dict[str, object]
) -> None:
    """All but 1.4's can be: it has the change of 1.3, which it does not show."""
    condition = Condition(HandBuilt(), NParity(2), "direct", Budget(generations=1, reports=1))
    here = {"device": {"platform": "cpu", "kind": "cpu"}, "machine": "Linux"}

    def judge(self: Elsewhere, recipe: Recipe) -> Judged:
        unlike = odd if recipe.version == "1.4" else {}
        made = {**here, **unlike, "versions": {"pebble": recipe.version}}
        change = (kind == "drift") / 2 if recipe.version >= "1.3" else 0.0
        # Of a change of the bits alone the drift check sees nothing: half of the trials are higher, half are lower.
        values = [0.5 + seed / 1000 - change + (-1) ** seed * (recipe.version >= "1.3") / 5000 for seed in range(10)]
        trials = [trial_of(condition, seed, value, provenance=made) for seed, value in enumerate(values)]
        trials = trials[:2] if "few" in unlike else trials
        source = SourceTrials("ours", "parity", condition.id, (), {"pebble": (recipe.version,)}, ())
        return Judged(recipe.label, {"a": report("a", sources=(source,))}, {source.label: tuple(trials)})

    monkeypatch.setattr(Elsewhere, "judge", judge)
    status, out, _ = evoclaims(*BISECT)
    assert status == 0
    assert f"The {kind} of a changed from pebble 1.0 to 1.8" in out
    assert f"The {kind} of a changed in pebble 1.3; 1.2 " in out
    status, out, _ = evoclaims(*BISECT[: -len(RELEASES)], "1.2", "1.4", "1.5")
    assert f"The {kind} of a changed after pebble 1.2 and not later than 1.5; unknown between them:\n" in out
    assert f"  pebble 1.4: not all of its trials can be compared with those of pebble 1.0 for {kind}\n" in out


@pytest.mark.parametrize(("changes", "said"), [(True, "1.2 was still as 1.0"), (False, "9 trials the same to the bit")])
def test_what_no_release_lets_compare_is_said_beside_what_stayed(
    evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch, changes: bool, said: str
) -> None:
    """One trial of ten is from another machine in each release but the first."""
    condition = Condition(HandBuilt(), NParity(2), "direct", Budget(generations=1, reports=1))

    def judge(self: Elsewhere, recipe: Recipe) -> Judged:
        moved = 0.001 * (changes and recipe.version >= "1.3")

        def one(seed: int) -> TrialResult:
            machine = "other" if seed == 9 and recipe.version > "1.0" else "Linux"
            made = {"device": {"platform": "cpu", "kind": "cpu"}, "machine": machine}
            return trial_of(
                condition, seed, seed / 10 + moved, provenance={**made, "versions": {"pebble": recipe.version}}
            )

        source = SourceTrials("ours", "parity", condition.id, (), {"pebble": (recipe.version,)}, ())
        trials = {source.label: tuple(map(one, range(10)))}
        return Judged(recipe.label, {"a": report("a", sources=(source,))}, trials)

    monkeypatch.setattr(Elsewhere, "judge", judge)
    status, out, _ = evoclaims(*BISECT, "--by=bits")
    assert status == (not changes)
    unseen = "(the bits of ours on parity can be compared in part or not at all)"
    assert f"{said} {unseen}.\n" in out
    if changes:
        known = judge
        broken = Judged("pebble 1.2", {}, {}, "it cannot be installed")
        monkeypatch.setattr(Elsewhere, "judge", lambda self, one: broken if one.version == "1.2" else known(self, one))
        assert f"after pebble 1.1 and not later than 1.3 {unseen}; unknown" in evoclaims(*BISECT, "--by=bits")[1]


def test_where_nothing_changed_the_status_says_so(evoclaims: Evoclaims, outcomes: dict[str, str]) -> None:
    status, out, _ = evoclaims(*BISECT)
    assert (status, outcomes["asked"]) == (1, "1.0 1.8 ")
    nothing = "no trials tested for drift, no trial compared to the bit"
    assert f"a with pebble 1.8 as with 1.0: the same verdict, {nothing}.\n" in out
    assert "a with pebble 1.8 as with 1.0: no trial compared to the bit.\n" in evoclaims(*BISECT, "--by=bits")[1]


def test_an_end_that_cannot_be_judged_is_an_error(evoclaims: Evoclaims, outcomes: dict[str, str]) -> None:
    outcomes["1.8"] = "no wheel"
    status, _, err = evoclaims(*BISECT)
    assert status == 2
    assert (
        "pebble 1.8, named by --bad, cannot be judged: no wheel. If the release itself is the cause, name another one."
        in err
    )


def test_the_table_is_printed_and_written_and_the_status_says_that_something_changed(
    evoclaims: Evoclaims, outcomes: dict[str, str]
) -> None:
    outcomes["1.2"] = "refuted"
    status, out, _ = evoclaims("across", "--package", "pebble", "1.0", "1.1", "1.0", "--as", "markdown")
    assert (status, outcomes["asked"]) == (0, "1.0 1.1 ")
    assert "No verdict changed and no drift was shown in 1 environment after the first." in out
    assert Path("report/across.md").read_text().startswith("# No verdict changed")
    status, out, _ = evoclaims("across", "--package", "pebble", "1.0", "1.2", "--as", "csv", "--out", "t.csv")
    assert status == 1
    assert "pebble 1.2 changes a." in out
    outcomes["1.3"] = "it cannot be installed"
    status, out, _ = evoclaims("across", "--package", "Pebble", "1.0", "1.3")
    assert status == 1
    assert "pebble 1.3: no verdicts: it cannot be installed\n" in out
    assert Path("t.csv").read_text().startswith("environment,claim,outcome,n,")
    assert Path(".evoclaims-releases/.gitignore").read_text() == "*\n"
    assert not Path(".evoclaims").exists()
    assert evoclaims("report")[0] == 0
    assert "pebble 1.3 has no verdicts." in unpacked.read(Path("report/index.html"))


@pytest.mark.parametrize(
    ("outcome", "headline"),
    [
        ("error", "No claim was judged: pebble 1.0 has errors in a; pebble 1.1 has errors in a.\n"),
        ("not run", "No claim was judged.\n"),
    ],
)
def test_claims_that_nothing_judges_are_not_called_unchanged(
    evoclaims: Evoclaims, outcomes: dict[str, str], outcome: str, headline: str
) -> None:
    outcomes |= {"1.0": outcome, "1.1": outcome}
    status, out, _ = evoclaims("across", "--package", "pebble", "1.0", "1.1")
    assert status == 1
    assert out.endswith(headline)
    assert "depends on" not in out


@pytest.mark.parametrize(
    ("packages", "outcome", "told"),
    [(("my_pebble",), "supported", 0), (("jax",), "supported", 1), (("jax",), "error", 0), ((), "supported", 0)],
)
def test_that_no_trial_depends_on_a_package_is_said_where_trials_show_it(
    evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch, packages: tuple[str, ...], outcome: str, told: int
) -> None:
    """By any spelling of its name; and not of claims without trials, or that broke before they had all."""
    versions = dict.fromkeys(packages, ("1.0",))
    sources = (SourceTrials("ours", "parity", "c" * 64, (), versions, ()),) if versions else ()
    judged = {"a": report("a", sources=sources), "b": report("b", outcome)}
    monkeypatch.setattr(Elsewhere, "judge", lambda self, recipe: Judged(recipe.label, judged, {}))
    _, out, _ = evoclaims("across", "--package", "my.Pebble", "1.0", "1.1")
    assert out.count("No trial of these claims depends on my.Pebble") == told


def test_nothing_is_judged_where_the_newest_release_is_installed(
    evoclaims: Evoclaims, outcomes: dict[str, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    here = version("pytest")
    monkeypatch.setattr("evoclaims.cli.across.released", lambda package: ["0.1", here])
    status, out, _ = evoclaims("across", "--package", "pytest", "installed", "newest")
    assert (status, out) == (0, f"All of these are pytest {here}: there is nothing to compare.\n")


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("across",), "No difference between environments is named. Add --package NAME VERSION"),
        (("across", "--package", "pebble"), "--package pebble has no version"),
        (
            ("across", "--package", "pebble", "latest"),
            "'latest' is not a version of a package. Write one such as 0.3.2.",
        ),
        (
            ("across", "--package", "pebble", "installed"),
            "pebble is not installed here, so it has no installed version. Name a version.",
        ),
        (("across", "--package", "pebble", "1.0", "--as", "xml"), "There is no form named 'xml'."),
        (("bisect", "T9", *BISECT[2:]), "There is no claim named 'T9'."),
        (("across", "--constraints", "a/pins.txt", "b/pins.txt"), "Several environments would be called pins. Give"),
        (("across", "--package", "", "1.0"), "'' is not the name of a package. Write one such as jax."),
        (("bisect", "a", "--package=-rfile", "--good=1", "--bad=2", "--releases=1"), "'-rfile' is not the name of a"),
        (("across", "--python", ""), "'' is not a version of Python. Write one such as 3.13."),
        (("across", "--constraints", "none.txt"), "Cannot read the constraints none.txt"),
        ((*BISECT, "--by", "luck"), "There is no kind of change named 'luck'. Known: bits, drift, verdict."),
        (("bisect", "a", "--package", "p", "--good", "2", "--bad", "1", "--releases", "1"), "2 is not older than 1"),
    ],
)
def test_what_cannot_be_asked_is_a_sentence_before_any_environment(
    evoclaims: Evoclaims, arguments: tuple[str, ...], text: str
) -> None:
    status, _, err = evoclaims(*arguments)
    assert status == 2
    assert text in err


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[list[str]]:
    """The commands that would have run in environments; each judges one claim, and breaks at the full tier."""
    ran: list[list[str]] = []

    def watched(command: list[str], folder: Path, log: Path) -> tuple[int, str]:
        ran.append(command)
        (told,) = (option.partition("=")[2] for option in command if option.startswith("--claims-json="))
        Path(told).write_text(json.dumps({"claims": [report("a").to_json()]}))
        return (4, "ERROR: no such thing\n") if "-mfull" in command else (0, "")

    monkeypatch.setattr("evoclaims.cli.elsewhere._watched", watched)
    monkeypatch.setattr("evoclaims.cli.elsewhere.make", lambda *_: Environment(tmp_path / "made", {}))
    return ran


def test_each_python_has_a_store_of_its_own_as_records_do_not_name_it(
    evoclaims: Evoclaims, commands: list[list[str]]
) -> None:
    assert evoclaims("across", "--python", "3.12", "3.13", "--only", "a")[0] == 0
    stores = [option for command in commands for option in command if option.startswith("--claims-storage=")]
    root = Path(".evoclaims-releases").absolute()
    assert stores == [f"--claims-storage={root / f'python{version}'}" for version in ("3.12", "3.13")]
    assert all({"-msmoke", "--claims-only=a", "--claims-device=auto"}.issubset(command) for command in commands)


def test_a_run_that_ends_before_its_claims_has_no_verdicts_whatever_file_it_left(
    evoclaims: Evoclaims, commands: list[list[str]]
) -> None:
    status, out, err = evoclaims("across", "--package", "pebble", "1.0", "--tier", "full")
    assert (status, len(commands)) == (2, 1)
    assert "pebble 1.0: pytest ended with 4: no such thing\n" in out
    assert "No claim was judged in any of these environments" in err


def test_an_environment_whose_python_is_gone_has_no_verdicts_and_stops_no_other(
    evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("evoclaims.cli.elsewhere.make", lambda *_: Environment(tmp_path / "gone", {}))
    status, out, err = evoclaims("across", "--package", "pebble", "1.0", "1.1")
    assert status == 2
    assert out.count(": pytest cannot be run there (") == 2
    assert "No claim was judged in any of these environments" in err


def test_no_claim_is_left_out_nor_judged_by_trials_of_other_versions_whatever_the_environment_says_of_pytest(
    project: Project, stored: Store, monkeypatch: pytest.MonkeyPatch
) -> None:
    """These would look like trials that the release has not changed."""
    project.write(a="refuted", b="supported")
    monkeypatch.setenv("PYTEST_ADDOPTS", "-x --claims-any-version")
    monkeypatch.setattr(Environment, "python", Path(sys.executable))
    elsewhere = Elsewhere(project.path, project.path / "claims", stored, "smoke", None, "cpu")
    here = installed_here()
    found = elsewhere._run(Environment(project.path, here), stored)
    assert [one.outcome for one in found] == ["refuted", "supported"]
    with pytest.raises(NotJudgedError, match=f"from trials of numpy {here['numpy']}, which is not what is installed"):
        elsewhere._run(Environment(project.path, {**here, "numpy": "1.0"}), stored)


def test_an_environment_with_trials_of_code_that_was_edited_since_is_not_judged(
    evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A release that was judged before the edit would differ from one that is judged after it."""
    source = SourceTrials("ours", "parity", "c" * 64, (), {"pebble": ("1.0",)}, ())
    kept = {"1.0": replace(source, edited=("paper.Pebbles",)), "1.1": replace(source, versions={"pebble": ("1.1",)})}

    def judges(elsewhere: Elsewhere, environment: Environment, *_: object) -> list[str]:
        told = json.dumps({"claims": [report("a", sources=(kept[environment.versions["pebble"]],)).to_json()]})
        return [sys.executable, "-c", f"import pathlib, sys; pathlib.Path(sys.argv[1]).write_text({told!r})"]

    monkeypatch.setattr(Elsewhere, "_command", lambda *asked: [*judges(*asked), str(asked[-1])])
    monkeypatch.setattr(
        "evoclaims.cli.elsewhere.make", lambda recipe, *_: Environment(tmp_path, {"pebble": recipe.version})
    )
    status, out, _ = evoclaims("across", "--package", "pebble", "1.0", "1.1")
    assert status == 1
    assert (
        "pebble 1.0: its claims were judged from trials that ran before paper.Pebbles was edited or renamed; raise "
        "its `revision`, so that they run again, or name another --storage\n" in out
    )
    assert out.endswith("pebble 1.0 has no verdicts.\n")
    status, _, err = evoclaims("bisect", "a", "--package=pebble", "--good=1.0", "--bad=1.1", "--releases=1.0")
    assert status == 2
    assert "pebble 1.0, named by --good, cannot be judged: its claims were judged from trials that ran before" in err


def test_an_environment_with_what_is_too_old_is_not_judged_and_its_packages_are_named(
    evoclaims: Evoclaims, commands: list[list[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    old = Environment(tmp_path / "old", {**installed_here(), "jax": "0.6.2", "pebble": "1.0"})
    monkeypatch.setattr("evoclaims.cli.elsewhere.make", lambda *_: old)
    status, out, _ = evoclaims("across", "--package", "pebble", "1.0")
    assert (status, commands) == (2, [])
    assert f"pebble 1.0: its installation changed jax {version('jax')} -> 0.6.2, too\n" in out
    assert (
        "pebble 1.0: it has jax 0.6.2 (oldest supported: 0.10.2); name a release that works with supported ones" in out
    )


def test_what_was_installed_from_a_folder_is_not_called_a_release(
    evoclaims: Evoclaims, commands: list[list[str]], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """An installer is content with a version that it finds here, such as that of a maintainer's own checkout."""
    for name, address in (("pebble", '{"url": "file:///pebble", "dir_info": {}}'), ("gravel", "")):
        information = tmp_path / f"{name}-1.1.dist-info"
        information.mkdir()
        (information / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.1\n")
        if address:
            (information / "direct_url.json").write_text(address)
    monkeypatch.syspath_prepend(tmp_path)
    found = [PathDistribution(folder) for folder in tmp_path.glob("*.dist-info")]
    monkeypatch.setattr("importlib.metadata.distributions", lambda: found)
    monkeypatch.setattr("evoclaims.cli.elsewhere.make", lambda *_: Environment(tmp_path / "made", installed_here()))
    said = "it is what is installed here from file:///pebble, no release: an edit without a new version is not seen"
    out = [evoclaims("across", "--package", name, "1.0", "1.1")[1] for name in ("pebble", "gravel")]
    assert f"\npebble 1.1: {said}\n" in out[0]
    assert [text.count("no release") for text in out] == [2, 0]  # while it is made, and below the table


def test_a_run_that_a_signal_kills_is_said_so_with_the_function(
    evoclaims: Evoclaims, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    dies = "import ctypes, faulthandler; faulthandler.enable()\ndef deepest(): ctypes.string_at(0)\ndeepest()"
    monkeypatch.setattr(Elsewhere, "_command", lambda *_: [sys.executable, "-c", dies])
    made = Environment(tmp_path, {})
    monkeypatch.setattr("evoclaims.cli.elsewhere.make", lambda *_: made)
    _, out, _ = evoclaims("across", "--package", "pebble", "1.0")
    assert "pebble 1.0: pytest was killed by SIGSEGV in string_at (" in out
