"""Compiles functions of small arrays to single kernels; README.md beside this file explains how."""
