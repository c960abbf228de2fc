"""`evoclaims merge`: what it prints, returns and refuses, and that a project judges what it has brought together."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from tiny_project import Evoclaims, forget, trials_of

from evoclaims.cli.store_folder import open_store
from evoclaims.trials.store import Store


@pytest.fixture
def halves(stored: Store) -> tuple[Store, Store]:
    """Two stores, one with the trials of the right network, one with those of the wrong one."""
    right, wrong = (Store(Path(shutil.copytree(stored.root, name))) for name in ("right", "wrong"))
    forget(right, trials_of(right, "hand_built_negated"))
    forget(wrong, trials_of(wrong, "hand_built"))
    return right, wrong


@pytest.mark.usefixtures("halves")
def test_stores_are_brought_together_and_judged(evoclaims: Evoclaims) -> None:
    shutil.rmtree(".evoclaims")
    status, out, err = evoclaims("merge", "right", "wrong")
    assert (status, err) == (0, "")
    assert out.splitlines() == [
        f"{name}: trials: 10 copied into .evoclaims, 0 there already, 0 different; damaged files left out: 0"
        for name in ("right", "wrong")
    ]
    _, out, _ = evoclaims("status")
    assert "claims (smoke): 1 supported, 1 refuted" in out
    status, out, _ = evoclaims("merge", "right", "wrong")
    assert (status, out.count("trials: 0 copied"), out.count("10 there already")) == (0, 2, 2)


@pytest.mark.usefixtures("halves")
def test_a_dry_run_makes_no_store(evoclaims: Evoclaims) -> None:
    status, out, _ = evoclaims("merge", "right", "wrong", "--storage=both", "--dry-run")
    assert (status, out.count("trials: 10 to copy into both")) == (0, 2)
    assert not Path("both").exists()


def test_what_differs_is_named_and_stays(evoclaims: Evoclaims, halves: tuple[Store, Store], stored: Store) -> None:
    one = trials_of(stored, "hand_built")[0]
    forget(stored, [one])
    stored.put(replace(one, digest="0" * 64, metrics={**one.metrics, "last_success": 0.5}), {})
    status, out, _ = evoclaims("merge", "right")
    assert status == 1
    differs, total = out.splitlines()
    assert differs.startswith(str(halves[0].record_files(one.id)[-1]))
    assert f"is in {stored.record_files(one.id)[-1]} and stays: metrics (last_success 1.0 and 0.5)" in differs
    assert "9 there already, 1 different" in total


@pytest.mark.usefixtures("halves")
@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("right", "nowhere"), "There is no trial store 'nowhere': the folder does not exist."),
        (("right", "claims"), "claims is not a trial store: it has no store.json"),
        (("right", ".evoclaims"), ".evoclaims is the store to copy into"),
    ],
)
def test_what_is_no_other_store_is_refused_before_anything_is_copied(
    arguments: tuple[str, ...], text: str, evoclaims: Evoclaims
) -> None:
    before = open_store(".evoclaims").ids()
    status, out, err = evoclaims("merge", *arguments)
    assert (status, out) == (2, "")
    assert text in err
    assert open_store(".evoclaims").ids() == before
