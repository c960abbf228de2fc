"""A module that another library imports at its top and hardly uses is imported when it is called, and is whole then."""

from __future__ import annotations

import subprocess
import sys

from evoclaims.core.foreign import imported_when_called

QDAX = """
import sys
from evoclaims.methods.map_elites import MapElites
MapElites()._algorithm()
print([name for name in ("sklearn", "sklearn.cluster", "pandas") if name in sys.modules])
"""


def test_a_stand_in_calls_the_module_and_leaves_no_trace() -> None:
    sys.modules.pop("colorsys", None)
    with imported_when_called("colorsys", "rgb_to_hsv"):
        from colorsys import rgb_to_hsv
    assert "colorsys" not in sys.modules
    assert rgb_to_hsv(0.0, 0.0, b=1.0) == (2 / 3, 1.0, 1.0)
    import colorsys

    with imported_when_called("colorsys", "rgb_to_hsv"):
        assert sys.modules["colorsys"] is colorsys
    assert sys.modules["colorsys"] is colorsys


def test_map_elites_needs_no_scikit_learn() -> None:
    ran = subprocess.run([sys.executable, "-c", QDAX], capture_output=True, text=True, check=False)
    assert ran.stdout.splitlines() == ["[]"], ran.stderr
