"""The tripwire says "changed" where the same trial should be the same to the bit."""

from __future__ import annotations

from typing import Any

import pytest

from evoclaims.judging.drift_report import DigestChange, compare_digests

CPU = {"platform": "cpu", "kind": "cpu", "count": 1}
MADE_BY: dict[str, Any] = {"device": CPU, "machine": "x86_64", "versions": {"jax": "0.10.2"}}


@pytest.mark.parametrize(
    "further",
    [
        {},
        {"xla_flags": None, "x64": False, "prng": "threefry2x32"},  # which older records do not say
        {"git": {"sha": "0" * 40, "dirty": True}},
    ],
)
def test_a_digest_that_differs_is_named_by_its_seed(trial, further) -> None:
    new = [trial(seed, 1.0, digest="new" if seed == 1 else "d", **MADE_BY, **further) for seed in range(3)]
    check = compare_digests(new, [trial(seed, 1.0, **MADE_BY) for seed in range(3)])
    assert (check.compared, check.changed) == (3, (DigestChange("condition", 1, "d", "new"),))


@pytest.mark.parametrize(
    ("both", "other", "seed", "condition"),
    [
        (MADE_BY, {"device": CPU | {"kind": "another"}}, 0, "condition"),
        (MADE_BY, {"device": CPU | {"platform": "gpu"}}, 0, "condition"),
        (MADE_BY, {"machine": "arm64"}, 0, "condition"),
        (MADE_BY, {"versions": {"jax": "0.11.2"}}, 0, "condition"),
        (MADE_BY, {"device": None}, 0, "condition"),
        (MADE_BY, {"machine": None}, 0, "condition"),
        (MADE_BY, {"versions": None}, 0, "condition"),
        (MADE_BY, {"instructions": "znver3 avx2"}, 0, "condition"),  # of which the other says nothing
        (MADE_BY | {"xla_flags": None}, {"xla_flags": "--xla_cpu_enable_fast_math=true"}, 0, "condition"),
        (MADE_BY | {"prng": "threefry2x32"}, {"prng": "rbg"}, 0, "condition"),
        (MADE_BY | {"x64": False}, {"x64": True}, 0, "condition"),
        (MADE_BY | {"device": CPU | {"platform": "gpu"}}, {}, 0, "condition"),  # whose bits are not promised
        ({}, {}, 0, "condition"),  # how they were made is not said
        (MADE_BY, {}, 1, "condition"),
        (MADE_BY, {}, 0, "another"),
    ],
)
def test_what_need_not_have_the_same_bits_is_not_comparable(trial, both, other, seed: int, condition: str) -> None:
    mine, theirs = trial(0, 1.0, **both), trial(seed, 1.0, condition, digest="other", **(both | other))
    assert compare_digests([mine], [theirs]).compared == 0
    assert compare_digests([theirs], [mine]).compared == 0
