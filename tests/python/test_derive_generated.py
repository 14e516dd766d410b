"""The committed headers are what the scripts give, and they do what the symbols say, in C++."""

import shutil
import subprocess

import numpy as np
import pytest
import sympy as sp
from derive import emit, generate, mbbr, mbbr_header, mip, mip_header


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


PROGRAM = r"""
#include <cstdio>
#include "generated/NAME_model.hpp"
using namespace equipoise::generated::NAME;
template <class T, std::size_t M, std::size_t N> void print(const T (&v)[M], const T (&J)[M][N]) {
  for (T e : v) std::printf("%.17g ", double(e));
  for (auto& row : J) for (T e : row) std::printf("%.17g ", double(e));
}
template <class T> void run() {
  const Coefficients<T> c = coefficients<T>(Parameters{PARAMETERS});
  const T x[] = {STATE}, u[] = {INPUT};
  CALLS
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


def check_functions(root, folder, robot, model, parameters, state, u):
    """Every generated function, in double and float, against the symbols and their derivatives."""
    known = {sp.Symbol(k, positive=True): v for k, v in parameters.items()}
    lumped = {sp.Symbol(k, positive=True): e for k, e in robot.LUMPED.items()}
    calls, expected = "", []
    for n, rows in enumerate(model.rows):
        outputs, states = len(rows.names), rows.state or model.state
        calls += f"T v{n}[{outputs}], J{n}[{outputs}][{len(states)}];\n"
        calls += f"  {rows.function}(c, x, u, v{n}, J{n}); print(v{n}, J{n});\n  "
        matrix = sp.Matrix([e.subs(lumped).subs(known) for e in rows.expressions])
        f = sp.lambdify((model.state, model.inputs), (matrix, matrix.jacobian(states)))
        value, jacobian = f(state, u)
        expected += [*np.ravel(value), *np.ravel(jacobian)]
    program = PROGRAM.replace("PARAMETERS", ", ".join(map(repr, parameters.values())))
    program = program.replace("STATE", ", ".join(f"T({v})" for v in state)).replace("CALLS", calls)
    program = program.replace("INPUT", ", ".join(f"T({v})" for v in u))
    program = program.replace("NAME", robot.__name__.rpartition(".")[2])
    in_double, in_float = compile_and_run(root, folder, program)
    expected = np.array(expected)
    scale = np.maximum(np.abs(expected), 1.0)
    assert np.max(np.abs(in_double - expected) / scale) < 1e-12
    assert np.max(np.abs(in_float - expected) / scale) < 1e-4


def test_mbbr_model_computes_the_derived_rows_and_their_jacobians(root, tmp_path):
    parameters = mbbr.TABLE_5_2 | {"I_t2": 2.6e-3, "l_az": 0.17}  # no accidental symmetry
    state, u = [0.03, -0.05, 0.4, -0.7, 6.0, 3.0, -5.0], [0.6, -0.3, 1.2]
    check_functions(root, tmp_path, mbbr, mbbr_header.model(), parameters, state, u)


def test_mip_model_computes_the_derived_rows_and_their_jacobians(root, tmp_path):
    parameters = mip.TABLE_3_2 | {"lateral": 0.8, "l_ay": 0.01, "l_az": 0.03}
    check_functions(root, tmp_path, mip, mip_header.model(), parameters, [0.03, 0.4, 6.0, 8.0], [0.6, -0.3])


def test_words_do_not_make_a_header_stale():
    code = '"""About."""\n\n\ndef f(x):\n    """What it does."""\n    # why\n    return x + 1\n'
    reworded = '"""Other words."""\n\n\ndef f(x):\n    """Something\n\n    longer."""\n    return x + 1\n'
    changed = code.replace("x + 1", "x + 2")
    assert emit._statements(code) == emit._statements(reworded)
    assert emit._statements(code) != emit._statements(changed)
