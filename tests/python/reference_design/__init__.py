"""The controllers' design in SciPy, for checking the firmware's own, and the exact robots under it."""
