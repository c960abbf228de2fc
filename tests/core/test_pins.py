"""Files of pins keep what they pin when a package is left out, however their lines are broken."""

from __future__ import annotations

import re
from dataclasses import dataclass

from hypothesis import given
from hypothesis import strategies as st
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from evoclaims.core.environments import without

NAMES = ("jax", "jaxlib", "Flax.Linen", "flax_linen", "evosax")
BREAKS = st.sampled_from([" ", "  ", " \\\n    ", "\\\n  ", " \\\n"])


@dataclass(frozen=True)
class Pin:
    """What is pinned, and how it is written."""

    requirement: str
    written: str

    @property
    def name(self) -> str:
        """The normalized name."""
        return canonicalize_name(Requirement(self.requirement).name)


@st.composite
def pins(draw: st.DrawFn) -> Pin:
    """A pin with a marker or none, up to three hashes, and a comment behind it or none."""
    equals, blank = draw(st.sampled_from(["==", " == "])), draw(st.sampled_from(["", " "]))
    marker = draw(st.sampled_from(["", ' ; python_version < "3.12"', "[cuda]"]))
    name, version = draw(st.sampled_from(NAMES)), draw(st.sampled_from(["1.0", "0.10.2"]))
    extras, marker = (marker, "") if marker.startswith("[") else ("", marker)
    requirement = f"{name}{extras}{equals}{version}{marker}"
    digests = draw(st.lists(st.text("0123456789abcdef", min_size=2, max_size=6), max_size=3))
    hashes = "".join(f"{draw(BREAKS)}--hash{draw(st.sampled_from('= '))}sha256:{digest}" for digest in digests)
    comment = draw(st.sampled_from(["", "  # via jax", "\n    # via jax", "\n# jax==9 \\"]))
    return Pin(requirement, f"{blank}{requirement}{hashes}{comment}\n")


FILES = st.lists(
    pins() | st.sampled_from([Pin("", "\n"), Pin("", "# evosax==0.1 \\\n"), Pin("", "--pre\n")]), max_size=8
)


def _read(text: str) -> list[str]:
    """Return the requirements of a file, without hashes."""
    lines = (re.sub(r"(^|\s+)#.*", "", line).strip() for line in text.splitlines())
    lines = (re.sub(r"[ \\]*--hash.*", "", line).removesuffix("\\").strip() for line in lines)
    return [line for line in lines if line and not line.startswith("-")]


def _written(file: list[Pin]) -> str:
    return "".join(pin.written for pin in file)


@given(FILES, st.sampled_from(NAMES))
def test_a_package_is_left_out_with_all_of_its_lines_and_all_others_stay(file: list[Pin], package: str) -> None:
    others = [pin.requirement for pin in file if pin.requirement and pin.name != canonicalize_name(package)]
    assert _read(without(_written(file), package)) == others


@given(FILES)
def test_no_other_character_changes(file: list[Pin]) -> None:
    text = _written(file)
    assert without(text, "") == without(text, "absent") == text


def test_a_file_may_end_in_the_middle_of_a_pin() -> None:
    assert without("jax==1.0\nflax==2.0 \\\n", "flax") == "jax==1.0\n"
