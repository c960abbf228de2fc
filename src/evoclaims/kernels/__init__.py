"""Compiles functions of small arrays to single GPU kernels; README.md beside this file explains how."""
