"""How even the queue of `evoclaims run --numprocesses N` is, by 100 conditions that wait and do little else.

They wait for 0.1 to 3 seconds, in proportion to their budgets, which are all that the command knows of them. Printed
are the wall times of one process and of N, and their ratio to an even share.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

PAPER = """
import time
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from evoclaims.envs.gates.parity import NParity
from evoclaims.judging.design import Design
from evoclaims.methods.hand_built import HandBuilt
from evoclaims.paper.reproduction import Reproduction, Tier
from evoclaims.trials.spec import Budget
from evoclaims.trials.spec import Condition


@dataclass(frozen=True)
class Waiting(HandBuilt):
    name: ClassVar[str] = "waiting"
    number: int = 0

    def init(self, key, task):
        if not getattr(Waiting, f"_waited{self.number}", False):  # traced several times
            setattr(Waiting, f"_waited{self.number}", True)
            time.sleep(0.1 * (1 + self.number * 7 % 30))
        return super().init(key, task)


conditions = {
    (f"waiting{number}", "parity"): Condition(
        Waiting(number=number), NParity(2), "direct", Budget(generations=1 + number * 7 % 30, reports=1)
    )
    for number in range(100)
}
tiers = {name: Tier(conditions, Design.fixed(2)) for name in ("smoke", "full")}
REPRODUCTION = Reproduction(name="waiting", title="Waiting", folder=Path(__file__).parent, tiers=tiers)
"""


def wall_time(folder: Path, processes: int) -> float:
    """Run the whole tier into a store of its own."""
    command = [sys.executable, "-c", "from evoclaims.cli import main; raise SystemExit(main())", "run", "--device=cpu"]
    began = time.perf_counter()
    subprocess.run(
        [*command, "--on=parity", f"--numprocesses={processes}", f"--storage=store{processes}"],
        cwd=folder,
        check=True,
        stdout=subprocess.DEVNULL,
    )
    return time.perf_counter() - began


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--processes", type=int, default=4)
    processes = parser.parse_args().processes
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "pyproject.toml").write_text('[tool.evoclaims]\nreproduction = "waiting_paper"\n')
        (folder / "waiting_paper.py").write_text(PAPER)
        one, several = wall_time(folder, 1), wall_time(folder, processes)
    ratio = several * processes / one
    print(f"one process {one:.1f} s, {processes} processes {several:.1f} s: {ratio:.2f} of an even share")


if __name__ == "__main__":
    main()
