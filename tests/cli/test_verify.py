"""`evoclaims verify` reads everything back, and moves bad files aside."""

from __future__ import annotations

from tiny_project import Evoclaims

from evoclaims.trials.store import Store


def test_verify_moves_bad_files_aside_and_the_trials_run_again(evoclaims: Evoclaims, stored: Store) -> None:
    assert evoclaims("verify")[:2] == (0, "20 trials in .evoclaims, 0 problems\n")
    record = stored.record_files(stored.ids()[3])[-1]
    record.write_bytes(record.read_bytes()[:50])
    stored.checkpoints.mkdir()
    (stored.checkpoints / "torn.npz").write_bytes(b"PK")
    status, out, _ = evoclaims("verify", "--dry-run")
    assert (status, out.splitlines()[-1]) == (1, "20 trials in .evoclaims, 3 problems")
    assert record.exists()
    status, out, _ = evoclaims("status")
    assert (status, out.splitlines()[-1].count("1 error")) == (1, 1)
    assert "run `evoclaims verify`" in out
    status, out, _ = evoclaims("verify")
    assert (status, out.splitlines()[-1]) == (1, "19 trials in .evoclaims, 3 problems")
    assert str(record) in out
    assert not record.exists()
    assert evoclaims("verify")[0] == 0
    for method in ("right", "wrong"):
        evoclaims("run", method)
    assert len(stored.ids()) == 20


def test_verify_reads_no_verdicts_and_says_so(evoclaims: Evoclaims, stored: Store) -> None:
    verdict = stored.root / "verdicts" / "smoke" / "a.json"
    verdict.parent.mkdir(parents=True)
    verdict.write_text("torn")
    assert evoclaims("verify")[:2] == (0, "20 trials in .evoclaims, 0 problems\n")
    assert evoclaims("status")[1].splitlines()[-1] == "claims (smoke): 1 supported, 1 refuted"
