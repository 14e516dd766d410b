"""Experiments of the dissertation [T]: one module each, with `run(out_dir) -> Result` (see framework.py).

A module's docstring says what it does, COVERS names the tables and figures it reproduces. To add one is to
add a module and, if its table is new, a row in coverage.py.
"""
