"""Names of files: readable where that tells texts apart, with a hash where it does not."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from evoclaims.core.files import LONGEST, file_name

PIECES = ("", "a", "b", "-", "~", "/", " ", "日本", "中国", "\n", "\x1b", "\0", ".", "\ud800", "[", "a-b")


@pytest.mark.parametrize(
    ("texts", "name"),
    [
        (("G1", ""), "G1"),
        (("G1", "n_parity"), "G1-n_parity"),
        (("G6", "cma_es-hyperneat-n_parity"), "G6-cma_es-hyperneat-n_parity"),
        (("a", "1.0-right"), "a-1.0-right"),
    ],
)
def test_a_common_name_is_its_own_file_name(texts: tuple[str, str], name: str) -> None:
    assert file_name(*texts) == name


def test_different_texts_have_different_names_and_each_can_be_a_file(tmp_path: Path) -> None:
    texts = ["".join(pieces) for pieces in product(PIECES, repeat=2)]
    pairs = [(first, second) for first in sorted(set(texts)) for second in ("", "a", "a/b", "a b", "-", "b~")]
    names = {pair: file_name(*pair) for pair in pairs}
    assert len(set(names.values())) == len(pairs)
    for name in names.values():
        (tmp_path / f"{name}.json").touch()
    assert len(list(tmp_path.iterdir())) == len(pairs)


@given(st.lists(st.tuples(st.text(max_size=300), st.text(max_size=300)), min_size=2, max_size=2, unique=True))
def test_no_two_texts_share_a_name_that_is_too_long_for_a_file(pairs: list[tuple[str, str]]) -> None:
    names = [file_name(*pair) for pair in pairs]
    assert len(set(names)) == 2
    assert all(0 < len(name.encode("ascii")) <= LONGEST for name in names)
