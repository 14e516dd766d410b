"""The committed headers are what the scripts give, and they do what the symbols say, in C++."""

import shutil
import subprocess

import numpy as np
import pytest
import sympy as sp
from derive import generate, mbbr, mbbr_header


def test_committed_headers_are_current(root):
    assert generate.stale(root / "config" / "generated") == []


def test_stale_headers_are_named(tmp_path, capsys):
    text = mbbr_header.render()
    (tmp_path / "mbbr_model.hpp").write_text(text.replace("c.theta_x_ddot_tx +", "c.theta_x_ddot_tx -"))
    assert generate.main(["--check", "--output", str(tmp_path)]) == 1
    errors = capsys.readouterr().err
    assert "mbbr_model.hpp: stale" in errors
    assert "python3 -m tools.derive" in errors


def test_last_digits_of_another_solver_are_not_stale():
    assert generate.same("x = 1.2345678;", "x = 1.2345679;")
    assert not generate.same("x = 1.23456;", "x = 1.23466;")
    assert not generate.same("x = 1.5;", "y = 1.5;")


MBBR_PROGRAM = r"""
#include <cstdio>
#include "generated/mbbr_gains.hpp"
#include "generated/mbbr_model.hpp"
using namespace equipoise::generated::mbbr;
static_assert(kScheduled.size() == kRows && kScheduled[0].yaw_rate_rad_s == 0.0);
template <class T> void run() {
  const Parameters p{PARAMETERS};
  const Coefficients<T> c = coefficients<T>(p);
  const T x[7] = {STATE}, u[3] = {INPUT};
  T a[5], J[5][7], y[2], H[2][7];
  accelerations(c, x, u, a, J);
  accelerometer(c, x, u, y, H);
  for (T v : a) std::printf("%.17g ", double(v));
  for (auto& row : J) for (T v : row) std::printf("%.17g ", double(v));
  for (T v : y) std::printf("%.17g ", double(v));
  for (auto& row : H) for (T v : row) std::printf("%.17g ", double(v));
  std::printf("\n");
}
int main() { run<double>(); run<float>(); }
"""


def compile_and_run(root, folder, program):
    compiler = shutil.which("g++") or shutil.which("c++")
    if compiler is None:
        pytest.skip("no C++ compiler")
    (folder / "main.cpp").write_text(program)
    flags = [
        "-std=c++17",
        "-O1",
        "-Wall",
        "-Wextra",
        "-Wconversion",
        "-Wdouble-promotion",
        "-Wshadow",
        "-Werror",
    ]
    command = [compiler, *flags, "-I", str(root / "config"), "-o", "main", "main.cpp"]
    subprocess.run(command, cwd=folder, check=True)
    lines = subprocess.run([folder / "main"], capture_output=True, text=True, check=True).stdout.splitlines()
    return [np.array(line.split(), float) for line in lines]


def test_mbbr_header_computes_the_derived_rows_and_their_jacobians(root, tmp_path):
    parameters = mbbr.TABLE_5_2 | {"I_t2": 2.6e-3, "l_az": 0.17}  # no accidental symmetry
    state, u = [0.03, -0.05, 0.4, -0.7, 6.0, 3.0, -5.0], [0.6, -0.3, 1.2]
    program = MBBR_PROGRAM.replace("PARAMETERS", ", ".join(map(repr, parameters.values())))
    program = program.replace("STATE", ", ".join(f"T({v})" for v in state))
    program = program.replace("INPUT", ", ".join(f"T({v})" for v in u))
    in_double, in_float = compile_and_run(root, tmp_path, program)

    accelerations, accelerometer = mbbr.high_yaw()
    lumped = {sp.Symbol(k, positive=True): e for k, e in mbbr.LUMPED.items()}
    expected = []
    for rows in (accelerations, accelerometer):
        rows = sp.Matrix([e.subs(lumped) for e in rows])
        f = sp.lambdify((mbbr.STATE, mbbr.INPUT, tuple(mbbr.P.values())), (rows, rows.jacobian(mbbr.STATE)))
        value, jacobian = f(state, u, list(parameters.values()))
        expected += [*np.ravel(value), *np.ravel(jacobian)]
    expected = np.array(expected)
    scale = np.maximum(np.abs(expected), 1.0)
    assert np.max(np.abs(in_double - expected) / scale) < 1e-12
    assert np.max(np.abs(in_float - expected) / scale) < 1e-4
