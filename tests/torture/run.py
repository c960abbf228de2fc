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

import clock_jumps
import full_disk
import killing
import stopping_and_continuing
import two_hosts
from bench import HangError, Laboratory
from tally import Tally

ATTACKS = {
    "kills": (killing.attack, 100, "blows at processes in the middle of trials"),
    "stops": (stopping_and_continuing.attack, 5, "rounds of stopping and continuing"),
    "hosts": (two_hosts.attack, 6, "stores shared by two hosts, each with two workers"),
    "clocks": (clock_jumps.attack, 4, "stores shared while clocks jump"),
    "disks": (full_disk.attack_mounted, 5, "disks that fill up"),
    "limits": (full_disk.attack_limited, 3, "processes that may write no longer"),
}
"""Each by the option that says how many times, with what that is in large, and in words."""


def main() -> int:
    """Make every attack that was asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    for name, (_, large, says) in ATTACKS.items():
        parser.add_argument(f"--{name}", type=int, default=large, help=f"{says} ({large})")
    parser.add_argument("--only", choices=[*ATTACKS], action="append", help="make this attack alone")
    parser.add_argument("--folder", type=Path, help="an empty one, which keeps the projects where something was found")
    parser.add_argument("--seed", type=int, default=random.randrange(2**32), help="of all that is drawn")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that nothing is left running
    print(f"seed {options.seed}", flush=True)
    tallies = []
    with tempfile.TemporaryDirectory(prefix="evoclaims-torture-", ignore_cleanup_errors=True) as aside:
        os.environ.setdefault("JAX_PLATFORMS", "cpu")
        os.environ.setdefault("JAX_NUM_CPU_DEVICES", "2")
        os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(Path(aside, "compiled")))
        os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.1")
        laboratory = Laboratory((options.folder or Path(aside)).resolve())
        for name in options.only or ATTACKS:
            began, draw = time.monotonic(), random.Random(f"{options.seed} {name}")
            try:
                tally = ATTACKS[name][0](laboratory, getattr(options, name), draw)
            except HangError as error:
                tally = Tally(name, violations=[str(error)])
            tallies.append(tally)
            print(f"{tally}\n  ({time.monotonic() - began:.0f} s)", flush=True)
    violations = sum(len(tally.violations) for tally in tallies)
    print(f"\n{len(tallies)} attacks, {violations} violations")
    return int(violations > 0)


if __name__ == "__main__":
    sys.exit(main())
