"""Which modules of evoclaims a claim passes from its sentence to its row of the table, and a seed to its record.

Run: python benchmarks/modules_passed.py [CLAIM]

A module counts if one of its functions is called; what importing it calls does not. The claim is judged from the
committed trials of the smoke tier by pytest, in this process. The seed is one of CMA-ES on parity, of two steps.
"""

from __future__ import annotations

import sys
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

import evoclaims

SOURCE = Path(evoclaims.__file__).parent
ROOT = SOURCE.parents[1]


@contextmanager
def passed() -> Iterator[dict[str, None]]:
    """Give the modules whose functions are called meanwhile, in the order of their first calls."""
    found: dict[str, None] = {}
    names: dict[str, str] = {}
    prefix = str(SOURCE)

    def note(frame: FrameType, event: str, argument: object) -> None:
        code = frame.f_code
        if event != "call" or not code.co_filename.startswith(prefix) or not code.co_flags & 0x2:  # 0x2: a function
            return
        name = names.get(code.co_filename)
        if name is None:
            name = names[code.co_filename] = Path(code.co_filename).relative_to(SOURCE).with_suffix("").as_posix()
        if name not in found and not _is_importing(frame):
            found[name] = None

    threading.setprofile(note)
    sys.setprofile(note)
    try:
        yield found
    finally:
        sys.setprofile(None)
        threading.setprofile(None)  # type: ignore[arg-type]


def _is_importing(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code.co_name == "<module>" and frame.f_code.co_filename.startswith(str(SOURCE)):
            return True
        frame = frame.f_back
    return False


def judge(claim: str, store: Path) -> None:
    """Judge a claim by pytest from the committed trials."""
    import pytest

    options = (
        "-q",
        "-Wignore::pytest.PytestAssertRewriteWarning",
        "-msmoke",
        f"--claims-only={claim}",
        "--claims-stored",
        "--claims-committed",
    )
    status = pytest.main([*options, f"--claims-storage={store}", f"--rootdir={ROOT}", str(ROOT / "claims")])
    assert status == 0, status


def train(store: Path) -> None:
    """Run one trial."""
    import jax

    from evoclaims.envs import NParity
    from evoclaims.methods import CmaEs
    from evoclaims.trials.runner import run
    from evoclaims.trials.spec import Budget, Condition
    from evoclaims.trials.store import Store

    run(Condition(CmaEs(), NParity(2), "curriculum", Budget(generations=2)), [0], Store(store), jax.devices("cpu"))


def main() -> None:
    """Print both lists."""
    claim = sys.argv[1] if len(sys.argv) > 1 else "M2"
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "store"
        store.mkdir()
        jobs: dict[str, Callable[[], None]] = {
            f"{claim}, from its sentence to its row": lambda: judge(claim, store),
            "a seed, to its record": lambda: train(store),
        }
        for what, job in jobs.items():
            with passed() as found:
                job()
            rooms: dict[str, list[str]] = {}
            for name in found:
                rooms.setdefault(name.partition("/")[0], []).append(name.partition("/")[2])
            print(f"\n{what}: {len(found)} modules")
            for room, names in rooms.items():
                print(f"  {room} ({len(names)}): {', '.join(names)}")


if __name__ == "__main__":
    main()
