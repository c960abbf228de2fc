"""The file of accepted verdicts: everything comes back as it was, and what is no history is one sentence."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from evoclaims.core.errors import UserError
from evoclaims.judging.verdict import Outcome
from evoclaims.verdicts.history import AcceptedVerdict, dump, eras, in_order, load, parse

TEXT = st.text(max_size=12)
ENTRIES = st.builds(
    AcceptedVerdict,
    outcome=st.sampled_from(Outcome),
    reason=TEXT,
    n=st.integers(0, 100),
    p=st.none() | st.floats(0, 1),
    fingerprint=TEXT,
    accepted=st.dates().map(str),
    versions=st.dictionaries(TEXT, TEXT, max_size=3),
    device=TEXT,
    revision=TEXT,
    trials=TEXT,
)
HISTORIES = st.dictionaries(st.tuples(TEXT, TEXT), st.lists(ENTRIES, min_size=1, max_size=3).map(tuple), max_size=4)

ENTRY = AcceptedVerdict(
    Outcome.REFUTED, "p = 1", 10, 1.0, "f" * 64, "2025-11-02", {"jax": "0.10.2"}, "cpu", "a" * 40, "d" * 64
)


@given(HISTORIES)
@settings(max_examples=40)
def test_a_history_comes_back_as_it_was_whatever_the_names_in_it(
    history: dict[tuple[str, str], tuple[AcceptedVerdict, ...]],
) -> None:
    assert parse(dump(history).encode(), "verdicts.toml") == history


def test_versions_are_written_once_for_all_verdicts_that_share_them() -> None:
    other = replace(ENTRY, versions={"jax": "0.11.2"})
    text = dump({("smoke", "G1"): (ENTRY, other), ("full", "G1"): (replace(ENTRY, accepted="2025-12-01"),)})
    assert text.count('jax = "0.10.2"') == 1
    assert text.count('jax = "0.11.2"') == 1


def test_the_same_history_gives_the_same_file_in_whatever_order_it_was_gathered() -> None:
    keys = [("smoke", "G1"), ("full", "G1"), ("full", "C1")]
    assert dump(dict.fromkeys(keys, (ENTRY,))) == dump(dict.fromkeys(keys[::-1], (ENTRY,)))


def test_without_a_file_nothing_has_been_accepted(tmp_path: Path) -> None:
    assert load(tmp_path / "verdicts.toml") == {}


def test_a_changed_fingerprint_begins_a_new_era() -> None:
    a, b = (replace(ENTRY, fingerprint=letter * 64) for letter in "ab")
    again = replace(a, outcome=Outcome.SUPPORTED)
    assert eras((a, again, b, a)) == ((a, again), (b,), (a,))
    assert eras(()) == ()


def test_claims_come_in_the_order_in_which_people_count() -> None:
    keys = [("smoke", "G10"), ("smoke", "G9[b]"), ("smoke", "G9[a]"), ("full", "G10"), ("smoke", "C1")]
    assert [claim for _, claim in sorted(keys, key=in_order)] == ["G10", "C1", "G9[a]", "G9[b]", "G10"]


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("schema = 1", "schema = ", "it is no whole TOML file"),
        ("schema = 1", "schema = 2", "its schema is 2 and this version of evoclaims reads schema 1"),
        ("schema = 1", "schema = true", "its schema is True"),
        ("schema = 1", "", "its schema is None"),
        ('outcome = "refuted"', 'outcome = "maybe"', "Invalid enum value 'maybe'"),
        ('outcome = "refuted"', "", "beyond the known ones: outcome"),
        ('outcome = "refuted"', 'outcome = "refuted"\nwhy = "so"', "beyond the known ones: why"),
        ("n = 10", "n = true", "n of G1 (smoke) is not as it was written: Expected `int`, got `bool`"),
        ("p = 1.0", "p = nan", "p of G1 (smoke) is not as it was written"),
        ("p = 1.0", "p = 1.5", "Expected `float` <= 1.0"),
        ("p = 1.0", 'p = "1"', "Expected `float | null`, got `str`"),
        ('reason = "p = 1"', "reason = 1", "Expected `str`, got `int`"),
        ('accepted = "2025-11-02"', 'accepted = "last week"', "Invalid RFC3339 encoded date"),
        ('accepted = "2025-11-02"', 'accepted = "2025-13-02"', "accepted of G1 (smoke) is not as it was written"),
        ('environment = "', 'environment = "x', "G1 (smoke) names the environment x"),
        ('jax = "0.10.2"', "jax = 3", "Expected `str`, got `int`"),
        ("[[verdicts.smoke.G1]]", "[verdicts.smoke.G1]", "G1 (smoke) has no list of verdicts"),
        ("[[verdicts.smoke.G1]]", "[[verdicts.smoke]]", "smoke is no table"),
        ("[[verdicts.smoke.G1]]", "[[verdicts]]", "verdicts is no table"),
    ],
)
def test_a_file_that_is_no_history_is_one_sentence_with_its_name(tmp_path: Path, old: str, new: str, text: str) -> None:
    sound = dump({("smoke", "G1"): (ENTRY,)})
    assert sound.count(old) == 1
    path = tmp_path / "verdicts.toml"
    path.write_text(sound.replace(old, new))
    with pytest.raises(UserError) as caught:
        load(path)
    said = str(caught.value)
    assert said.startswith(f"{path} holds no accepted verdicts: ")
    assert text in said
    assert "\n" not in said


@pytest.mark.parametrize("data", [b"\xff", b"a = " + b"[" * 5000, b"x = '\x1b[2J'", b""])
def test_bytes_of_any_kind_are_refused_with_a_sentence_that_steers_no_terminal(data: bytes) -> None:
    with pytest.raises(UserError) as caught:
        parse(data, "a\x1bb")
    assert str(caught.value).isprintable()


def test_a_claim_without_any_verdict_is_said_without_steering_the_terminal() -> None:
    with pytest.raises(UserError) as caught:
        parse(b'schema = 1\n[verdicts.smoke]\n"G\\u001b1" = []', "x")
    assert str(caught.value).startswith(r"x holds no accepted verdicts: G\x1b1 (smoke) has no list of verdicts.")
