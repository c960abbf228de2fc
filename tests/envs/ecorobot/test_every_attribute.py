"""A sample of what `every_attribute.py` tries, more of which `test_fidelity.py` and the tables of errors have."""

from __future__ import annotations

from pathlib import Path

import pytest
from custom_robots import Texts
from every_attribute import TOLERANCE, furthest, with_attribute

from evoclaims.core.errors import UserError

EQUAL = [
    ("flag", "eulerdamp", "disable"),
    ("flag", "constraint", "disable"),
    ("flag", "contact", "disable"),
    ("joint", "springref", "0.37"),
]
REFUSED = [
    ("geom", "fluidshape", "ellipsoid", "ellipsoids in a fluid"),
    ("joint", "frictionloss", "0.37", "friction loss"),
]


@pytest.fixture
def texts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Texts:
    return Texts(tmp_path, monkeypatch)


@pytest.mark.parametrize(("element", "attribute", "value"), EQUAL, ids=lambda part: part)
def test_an_attribute_moves_a_robot_as_in_c(element: str, attribute: str, value: str, texts: Texts) -> None:
    robot = texts.robot(with_attribute(element, attribute, value), frames=1, contacts=12)
    assert furthest(robot) < TOLERANCE


@pytest.mark.parametrize(("element", "attribute", "value", "sentence"), REFUSED, ids=lambda part: part)
def test_an_attribute_is_refused(element: str, attribute: str, value: str, sentence: str, texts: Texts) -> None:
    with pytest.raises(UserError, match=f"robot rover .*{sentence}"):
        furthest(texts.robot(with_attribute(element, attribute, value), frames=1, contacts=12))
