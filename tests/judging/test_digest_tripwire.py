"""The tripwire says "changed" where the same trial should be the same to the bit."""

from __future__ import annotations

from typing import Any

import pytest

from evoclaims.judging.drift_report import DigestChange, compare_digests

CPU = {"platform": "cpu", "kind": "cpu", "count": 1}
MADE_BY: dict[str, Any] = {"device": CPU, "machine": "x86_64", "versions": {"jax": "0.10.2"}}


def test_equal_digests_are_compared_and_unchanged(trial) -> None:
    check = compare_digests([trial(0, 1.0, **MADE_BY)], [trial(0, 1.0, **MADE_BY)])
    assert (check.compared, check.changed) == (1, ())


def test_a_digest_that_differs_is_named_by_its_seed(trial) -> None:
    new = [trial(seed, 1.0, digest="new" if seed == 1 else "d", **MADE_BY) for seed in range(3)]
    check = compare_digests(new, [trial(seed, 1.0, **MADE_BY) for seed in range(3)])
    assert (check.compared, check.changed) == (3, (DigestChange("condition", 1, "d", "new"),))


@pytest.mark.parametrize(
    "other",
    [
        {"device": CPU | {"kind": "another"}},
        {"device": CPU | {"platform": "gpu"}},
        {"machine": "arm64"},
        {"versions": {"jax": "0.11.2"}},
        {"device": None},
        {"machine": None},
        {"versions": None},
        {"instructions": "znver3 avx2"},  # of which the other says nothing
    ],
)
def test_another_machine_class_or_version_is_not_comparable(trial, other: dict[str, Any]) -> None:
    theirs = trial(0, 1.0, digest="other", **(MADE_BY | other))
    assert compare_digests([trial(0, 1.0, **MADE_BY)], [theirs]).compared == 0
    assert compare_digests([theirs], [trial(0, 1.0, **MADE_BY)]).compared == 0


def test_on_a_gpu_bits_are_not_promised(trial) -> None:
    made_by = MADE_BY | {"device": CPU | {"platform": "gpu", "kind": "NVIDIA H200"}}
    assert compare_digests([trial(0, 1.0, **made_by)], [trial(0, 1.0, digest="other", **made_by)]).compared == 0


def test_records_that_do_not_say_how_they_were_made_are_never_comparable(trial) -> None:
    assert compare_digests([trial(0, 1.0)], [trial(0, 1.0, digest="other")]).compared == 0


def test_another_seed_or_condition_is_not_comparable(trial) -> None:
    new = [trial(0, 1.0, **MADE_BY)]
    assert compare_digests(new, [trial(1, 1.0, digest="x", **MADE_BY)]).compared == 0
    assert compare_digests(new, [trial(0, 1.0, "another", digest="x", **MADE_BY)]).compared == 0
