"""All attacks by name, with their sizes in large."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass

import clock_jumps
import crowd
import full_disk
import hostile_files
import killing
import stopping_and_continuing
import two_hosts
from bench import Laboratory
from tally import Tally


@dataclass(frozen=True)
class Attack:
    """One kind of attack.

    Attributes:
        make: takes where to make it, how many times, and what to draw from.
        option: what it is counted in, on the command line.
        says: what is counted, in words.
        large: how many times by hand.
    """

    make: Callable[[Laboratory, int, random.Random], Tally]
    option: str
    says: str
    large: int


ATTACKS = {
    "crowd": Attack(crowd.attack, "crowd", "processes that work on one store at once, killed and started again", 50),
    "killing": Attack(killing.attack, "kills", "blows at processes in the middle of trials", 100),
    "stopping": Attack(stopping_and_continuing.attack, "stops", "rounds of stopping and continuing", 5),
    "hosts": Attack(two_hosts.attack, "hosts", "stores shared by two hosts, each with two workers", 6),
    "clocks": Attack(clock_jumps.attack, "clocks", "stores shared while clocks jump", 4),
    "disk": Attack(full_disk.attack_mounted, "disks", "disks that fill up", 5),
    "compiler": Attack(hostile_files.attack_compiler, "compilers", "compilers that are stopped", 3),
    "evidence": Attack(hostile_files.attack_evidence, "evidence", "stores with hostile files of evidence", 5),
    "container": Attack(hostile_files.attack_container, "containers", "stores shared with a container", 3),
    "cache": Attack(hostile_files.attack_full_cache, "caches", "caches on a disk that is full", 3),
    "limit": Attack(full_disk.attack_limited, "limits", "processes that may write no longer", 3),
}
