"""Planted faults: claims that no fault of what they name can change say nothing (mutation analysis).

DeMillo, Lipton and Sayward 1978, Hints on test data selection, IEEE Computer 11(4).
"""
