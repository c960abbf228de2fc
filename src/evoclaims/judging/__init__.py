"""Judging claims: exact tests, attainability first, and exactly one of five outcomes."""

from evoclaims.judging.assertion import Assertion
from evoclaims.judging.baseline import DriftCase, DriftReport, DriftRow, check_drift
from evoclaims.judging.fingerprint import fingerprint
from evoclaims.judging.judge import attainability, judge, needed_trials
from evoclaims.judging.measure import Event, Measure, Profile
from evoclaims.judging.protocol import FIXED_10, SEQUENTIAL, Look, Protocol
from evoclaims.judging.sample import Sample, Source, Trials
from evoclaims.judging.tripwire import DigestChange, DigestCheck, compare_digests
from evoclaims.judging.verdict import Evidence, Interval, Outcome, PValues, Verdict

__all__ = [
    "FIXED_10",
    "SEQUENTIAL",
    "Assertion",
    "DigestChange",
    "DigestCheck",
    "DriftCase",
    "DriftReport",
    "DriftRow",
    "Event",
    "Evidence",
    "Interval",
    "Look",
    "Measure",
    "Outcome",
    "PValues",
    "Profile",
    "Protocol",
    "Sample",
    "Source",
    "Trials",
    "Verdict",
    "attainability",
    "check_drift",
    "compare_digests",
    "fingerprint",
    "judge",
    "needed_trials",
]
