"""The claims of the paper under test: none moves without a word."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from evoclaims.verdicts.history import FILE, load

ROOT = Path(__file__).parents[2]


def test_no_claim_of_the_paper_has_moved_since_its_verdict_was_accepted(tmp_path: Path) -> None:
    options = ("--claims-stored", f"--claims-storage={tmp_path}", f"--claims-json={tmp_path / 'out.json'}")
    command = (sys.executable, "-m", "pytest", "claims", "-m", "smoke or full", "-p", "no:cacheprovider", *options)
    said = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout
    claims = json.loads((tmp_path / "out.json").read_text())["claims"]
    names = {(c["tier"], f"{c['claim']}[{c['case']}]" if c["case"] else c["claim"]): c["verdict"] for c in claims}
    assert {c["outcome"] for c in claims} == {"not run"}, said
    accepted = load(ROOT / "reproductions" / "nisioti2025" / FILE)
    assert len(accepted) > 80
    assert {key: names[key]["fingerprint"] for key in accepted} == {
        key: entries[-1].fingerprint for key, entries in accepted.items()
    }
