"""High-yaw-rate model of the MBBR, derived from first principles and written as C++.

Kane's equations for the body, the ball (no spin) and the wheels, with the tilt and its rates to first order and
yaw rate, ball rates and inputs arbitrary. Output: config/generated/mbbr_model.hpp.
"""

import sympy as sp

PARAMETERS = "m_t m_b r r_w l l_az I_t1 I_t2 I_t3 I_b I_w k1 k2_ball mu_v g".split()
P = {name: sp.Symbol(name, positive=True) for name in PARAMETERS}
STATE = sp.symbols("tx ty dtx dty dtz px py")
INPUT = sp.symbols("ux uy uz")
SMALL = STATE[:4]
ROWS = ["theta_x_ddot", "theta_y_ddot", "theta_z_ddot", "phi_x_ddot", "phi_y_ddot"]


def first_order(expression):
    """Drops products of the tilt and its rates."""
    e = sp.Symbol("e")
    scaled = sp.expand(expression.subs({s: e * s for s in SMALL}, simultaneous=True))
    return sum(scaled.coeff(e, i) for i in (0, 1))


def skew(v):
    return sp.Matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def derive():
    """Rows of accelerations (ball: inertial, resolved in the yaw frame) and of the accelerometer (x, y)."""
    tx, ty, dtx, dty, dtz, px, py = STATE
    m_t, m_b, r, l = P["m_t"], P["m_b"], P["r"], P["l"]
    R = sp.Matrix([[1, 0, ty], [0, 1, -tx], [-ty, tx, 1]])
    omega = sp.Matrix([dtx - ty * dtz, dty + tx * dtz, dtz])
    com = sp.Matrix([0, 0, l])
    inertia = sp.diag(P["I_t1"], P["I_t2"], P["I_t3"])
    roll = sp.Matrix([[0, 1], [-1, 0], [0, 0]])  # ball velocity / r from its rates, [T] (5.9)
    horizontal = sp.Matrix([[1, 0], [0, 1], [0, 0]])
    ball_rate = R.T * sp.Matrix([px, py, 0])
    torque = P["k1"] * sp.Matrix(INPUT) - (P["k2_ball"] + P["mu_v"]) * (ball_rate - omega)  # [T] (5.13), (5.34)

    body_mass = inertia + m_t * (com.dot(com) * sp.eye(3) - com * com.T) + P["I_w"] * sp.eye(3)
    coupling = m_t * skew(com) * R.T * r * roll - P["I_w"] * R.T * horizontal
    ball_mass = (P["I_b"] + P["I_w"] + (m_b + m_t) * r**2) * sp.eye(2)
    centripetal = omega.cross(omega.cross(com))
    gyroscopic = P["I_w"] * omega.cross(ball_rate)
    body = (
        -omega.cross(inertia * omega)
        - m_t * com.cross(centripetal)
        - m_t * P["g"] * com.cross(R.T * sp.Matrix([0, 0, 1]))
        - gyroscopic
        - torque
    )
    ball = -m_t * (R.T * r * roll).T * centripetal + horizontal.T * R * (gyroscopic + torque)
    mass = sp.Matrix(sp.BlockMatrix([[body_mass, coupling], [coupling.T, ball_mass]]).as_explicit())
    mass = mass.applyfunc(first_order)
    force = sp.Matrix(list(body) + list(ball)).applyfunc(first_order)

    # (M0 + M1) q = b0 + b1, first order in the small quantities
    upright = {s: 0 for s in SMALL}
    mass_0, force_0 = mass.subs(upright), force.subs(upright)
    inverse = mass_0.inv().applyfunc(sp.simplify)
    zeroth = inverse * force_0
    q = zeroth + inverse * ((force - force_0) - (mass - mass_0) * zeroth)

    # body accelerations -> second derivatives of the Euler angles, [T] (A.13) differentiated
    theta_y_ddot_0 = zeroth[1]
    theta_z_ddot_0 = zeroth[2]
    rows = [
        q[0] + dty * dtz + ty * theta_z_ddot_0,
        q[1] - dtx * dtz - tx * theta_z_ddot_0,
        q[2] + tx * theta_y_ddot_0,
        q[3],
        q[4],
    ]
    lever = sp.Matrix([0, 0, P["l_az"]])
    ball_acceleration = r * roll * sp.Matrix([q[3], q[4]])
    y = (
        R.T * (sp.Matrix([0, 0, -P["g"]]) - ball_acceleration)
        - sp.Matrix(q[:3]).cross(lever)
        - omega.cross(omega.cross(lever))
    )
    return [first_order(sp.expand(row)) for row in rows], [first_order(sp.expand(y[i])) for i in (0, 1)]


def monomials(expression):
    """[(monomial, coefficient of the parameters, name)] in state and input."""
    poly = sp.Poly(sp.expand(expression), *STATE, *INPUT)
    result = []
    for powers, coefficient in poly.terms():
        variables = [(v, k) for v, k in zip(STATE + INPUT, powers) if k]
        name = "_".join(str(v) + (str(k) if k > 1 else "") for v, k in variables)
        monomial = sp.Mul(*[v**k for v, k in variables])
        result.append((monomial, sp.simplify(coefficient), name))
    return result


def c_code(expression):
    """C++ with powers written as products."""
    text = sp.ccode(expression, user_functions={"Pow": [(lambda b, e: e == 2, lambda b, e: f"({b})*({b})")]})
    return text


def straight_line(outputs, prefix):
    """Statements that assign every (target, expression), common subexpressions first."""
    replacements, reduced = sp.cse([e for _, e in outputs], symbols=sp.numbered_symbols(prefix), optimizations="basic")
    lines = [f"  const T {name} = {c_code(value)};" for name, value in replacements]
    lines += [f"  {target} = {c_code(value)};" for (target, _), value in zip(outputs, reduced)]
    return lines


def render():
    accelerations, accelerometer = derive()
    coefficients, symbolic = [], []
    for row, expression in zip(ROWS + ["accel_x", "accel_y"], accelerations + accelerometer):
        total = 0
        for monomial, coefficient, name in monomials(expression):
            symbol = sp.Symbol(f"{row}_{name}")
            coefficients.append((symbol, coefficient))
            total += symbol * monomial
        symbolic.append(total)

    def function(name, outputs, rows, count):
        pairs = [(f"{outputs}[{i}]", e) for i, e in enumerate(rows)]
        pairs += [(f"J[{i}][{j}]", sp.diff(e, v)) for i, e in enumerate(rows) for j, v in enumerate(STATE)]
        body = straight_line(pairs, "k")
        used = set().union(*[e.free_symbols for _, e in pairs])
        load = [f"  const T {v} = x[{i}];" for i, v in enumerate(STATE) if v in used]
        load += [f"  const T {v} = u[{i}];" for i, v in enumerate(INPUT) if v in used]
        load += [f"  const T {s} = c.{s};" for s, _ in coefficients if s in used]
        head = [
            "template <class T>",
            f"inline void {name}(const Coefficients<T>& c, const T x[7], const T u[3], T {outputs}[{count}],",
            f"                   T J[{count}][7]) noexcept {{",
        ]
        return head + load + body + ["}", ""]

    replacements, reduced = sp.cse([e for _, e in coefficients], symbols=sp.numbered_symbols("k"))
    lines = ["struct Parameters {"] + [f"  double {name};" for name in PARAMETERS] + ["};", ""]
    lines += ["template <class T>", "struct Coefficients {"] + [f"  T {s};" for s, _ in coefficients] + ["};", ""]
    lines += ["template <class T>", "inline Coefficients<T> coefficients(const Parameters& p) noexcept {"]
    used = set().union(*[e.free_symbols for _, e in coefficients])
    lines += [f"  const double {name} = p.{name};" for name in PARAMETERS if P[name] in used]
    lines += [f"  const double {name} = {c_code(value)};" for name, value in replacements]
    lines += ["  Coefficients<T> c;"]
    lines += [f"  c.{s} = static_cast<T>({c_code(value)});" for (s, _), value in zip(coefficients, reduced)]
    lines += ["  return c;", "}", ""]
    lines += function("accelerations", "a", symbolic[:5], 5)
    lines += function("accelerometer", "y", symbolic[5:], 2)
    return "\n".join(
        [
            "// High-yaw-rate model of the MBBR: accelerations and accelerometer rows with their Jacobians.",
            "// x: theta_x, theta_y, their rates, theta_z', phi_x*', phi_y*'. a: theta_x'', theta_y'', theta_z'' and the",
            "// ball's inertial accelerations resolved in the yaw frame. y: gravity minus acceleration, body x and y.",
            "// GENERATED by tools/derive/mbbr_model.py, DO NOT EDIT. RT-safe.",
            "#pragma once",
            "",
            "#include <cmath>",
            "",
            "namespace equipoise::generated::mbbr {",
            "",
            *lines,
            "}  // namespace equipoise::generated::mbbr",
            "",
        ]
    )


if __name__ == "__main__":
    import pathlib
    import subprocess

    target = pathlib.Path(__file__).resolve().parents[2] / "config" / "generated" / "mbbr_model.hpp"
    target.parent.mkdir(parents=True, exist_ok=True)
    target.write_text(render())
    subprocess.run(["clang-format-14", "-i", str(target)], check=True)
