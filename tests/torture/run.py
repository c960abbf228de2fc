"""The attacks in large: `python tests/torture/run.py --kills 100` says what was done, and ends with 1 if it hurt."""

from __future__ import annotations

import argparse
import os
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

import attacks
from bench import HangError, Laboratory
from tally import Tally


def main() -> int:
    """Make every attack that was asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    for attack in attacks.ATTACKS.values():
        parser.add_argument(
            f"--{attack.option}", type=int, default=attack.large, help=f"{attack.says} ({attack.large})"
        )
    parser.add_argument("--seconds", type=float, default=480.0, help="how long a crowd works (480)")
    parser.add_argument("--only", choices=[*attacks.ATTACKS], action="append", help="make this attack alone")
    parser.add_argument(
        "--folder", type=Path, help="an empty one, which keeps the projects in which something was found"
    )
    parser.add_argument("--seed", type=int, default=random.randrange(2**32), help="of all that is drawn")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that nothing is left running
    print(f"seed {options.seed}", flush=True)
    tallies = []
    with tempfile.TemporaryDirectory(prefix="evoclaims-torture-", ignore_cleanup_errors=True) as aside:
        folder = (options.folder or Path(aside)).resolve()
        os.environ.setdefault("JAX_PLATFORMS", "cpu")
        os.environ.setdefault("JAX_NUM_CPU_DEVICES", "2")
        os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(Path(aside, "compiled")))
        os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.1")
        laboratory = Laboratory(folder, options.seconds)
        for name in options.only or attacks.ATTACKS:
            attack, began = attacks.ATTACKS[name], time.monotonic()
            times, draw = getattr(options, attack.option), random.Random(f"{options.seed} {name}")
            try:
                tally = attack.make(laboratory, times, draw)
            except HangError as error:
                tally = Tally(name, violations=[str(error)])
            tallies.append(tally)
            print(f"{tally}\n  ({time.monotonic() - began:.0f} s)", flush=True)
    violations = sum(len(tally.violations) for tally in tallies)
    print(f"\n{len(tallies)} attacks, {violations} violations")
    return int(violations > 0)


if __name__ == "__main__":
    sys.exit(main())
