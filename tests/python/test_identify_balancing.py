"""Rotor inertia, friction, delay from a log of balancing: of a known machine, and of a real one in halves."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from driven import real_log
from equipoise_tools import planar_model as planar
from equipoise_tools.foreign_log import configuration
from equipoise_tools.identify_balancing import identify
from equipoise_tools.paths import UserError
from scipy.linalg import solve_continuous_are

# Of a pendulum on a ball of about rob311's size.
KNOWN = planar.Planar(
    body_mass=2.6, rolling_mass=0.62, rolling_inertia=0.0036, body_inertia=0.0115, height=0.23, radius=0.121,
    rotor=0.05, k1=2.65, k2=0.8, coulomb=0.2, viscous=0.05, delay_s=0.015, offset=0.01,
)  # fmt: skip


def balanced(duration_s: float) -> planar.Motion:
    """Lagrange's equations by a finer integrator, held up by an LQR and shaken by sines."""
    p, n, fine = KNOWN, round(duration_s / planar.STEP_S), 10
    rolls = p.rolling_inertia + (p.rolling_mass + p.body_mass) * p.radius**2
    arm = p.body_mass * p.radius * p.height
    upright = rolls + 2 * arm + p.body_inertia + p.body_mass * p.height**2
    inverse = np.linalg.inv([[upright, rolls + arm], [rolls + arm, rolls + p.rotor]])
    weight = p.body_mass * planar.GRAVITY * p.height
    A, B = np.zeros((4, 4)), np.zeros((4, 1))  # tilt, rolling, and their rates
    A[:2, 2:] = np.eye(2)
    A[2:, 0], A[2:, 3], B[2:, 0] = inverse[:, 0] * weight, -inverse[:, 1] * p.k2, inverse[:, 1] * p.k1
    K = (B.T @ solve_continuous_are(A, B, np.diag([100.0, 0.1, 1.0, 0.1]), np.eye(1)))[0]
    x, u, rows = np.array([0.01, 0.0, 0.0, 0.0]), np.zeros(n), []
    for k in range(n):
        t = k * planar.STEP_S
        u[k] = np.clip(-K @ x + 0.2 * np.sin(9.0 * t + 2.0 * np.sin(t)), -1, 1)
        drive = u[max(k - round(p.delay_s / planar.STEP_S), 0)]
        rows.append(x)
        for _ in range(fine):
            friction = p.coulomb * np.tanh(x[3] / planar.STICKS_RAD_S) + (p.viscous + p.k2) * x[3]
            rates = x[2:] + inverse @ [weight * x[0], p.k1 * drive - friction] * planar.STEP_S / fine
            x = np.concatenate([x[:2] + rates * planar.STEP_S / fine, rates])
    y = np.array(rows).T
    assert np.abs(y[0]).max() < 0.5
    theta = y[0] + p.offset + 1e-4 * np.random.default_rng(3).standard_normal(n)
    return planar.Motion(theta[None], y[1][None], u[None], np.ones(n, bool))


@pytest.fixture(scope="module")
def log():
    return balanced(16.0)


def test_a_known_machine_is_found_within_its_intervals(log):
    start = replace(KNOWN, rotor=0.2, coulomb=0.0, viscous=0.0, delay_s=0.0, offset=0.0)
    found = identify(start, log).estimates
    for name, true in (
        ("rotor", 0.05),
        ("coulomb", 0.2),
        ("viscous", 0.05),
        ("delay_s", 0.015),
        ("offset_x", 0.01),
    ):
        e = found[name]
        assert abs(e.value - true) < max(e.half_width_95, 0.1 * true), name
        assert e.half_width_95 < 0.5 * max(true, 0.02), name


def test_wrong_signs_and_short_logs_are_refused(log):
    with pytest.raises(UserError, match=r"R2.*the sign of drive is flipped"):
        identify(KNOWN, replace(log, u=-log.u))
    with pytest.raises(UserError, match=r"R2.*the sign of wheels is flipped"):
        identify(KNOWN, replace(log, phi=-log.phi))
    with pytest.raises(UserError, match=r"R2.*order or units"):
        identify(KNOWN, replace(log, u=np.roll(log.u, 500)))
    with pytest.raises(UserError, match="at least"):
        identify(KNOWN, log.part(np.arange(len(log.used)) < 400))


def test_friction_does_not_throw_a_light_robots_wheels(root):
    """REGBOT's stops them within a step or two: predictions that begin a hair apart stay together."""
    regbot = planar.of_configuration(configuration(root / "config/real/regbot.toml"))
    for begins in (0.0, 0.5, 1.0):
        at = [np.full(2, 0.01), np.zeros(2), np.zeros(2), np.array([begins, begins + 1e-6])]
        theta, phi = regbot.predict(*at, np.full((20, 2), 0.02))
        assert abs(phi[1] - phi[0]) < 1e-7 and abs(theta[1] - theta[0]) < 1e-7


def test_intervals_from_a_real_ball_bot_hold_on_its_next_24_s(root):
    map_file = root / "config/real/maps/rob311_main_control_1.toml"
    log = real_log(root, map_file)
    command = [sys.executable, "-m", "equipoise_tools.identify_balancing", "--json", "--map", map_file]

    def result(*arguments, table=log):
        full = [*map(str, command), str(table), *arguments]
        done = subprocess.run(full, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout)

    first, second = result("--check-from-s", "32"), result("--from-s", "32", "--check-from-s", "55")
    for name in ("rotor", "coulomb", "viscous", "delay_s"):
        a, b = first["estimates"][name], second["estimates"][name]
        assert abs(a["value"] - b["value"]) < np.hypot(a["half_width_95"], b["half_width_95"]), name
        assert a["half_width_95"] < 0.4 * a["value"]
    other = result(table=log.with_name("main_control_autotune_1.txt"))  # nothing was fitted to it
    for log in (first, other):
        for which in ("ahead_configured", "ahead_identified"):
            assert log[which]["model"]["wheel"] < 0.4 * log[which]["constant_rate"]["wheel"]
        ahead = log["ahead_identified"]
        assert ahead["model"]["tilt"] < min(ahead[n]["tilt"] for n in ("persistence", "constant_rate"))


@pytest.mark.parametrize(
    ("table", "change", "complaint"),
    [
        ("", ("", ""), "no row of numbers"),
        ("t,x,y\n1,2,3\n", ('robot = "', 'name = "'), "robot: missing"),
        ("t,x,y\n1,2,3\n2,2,3\n", ('["x"]', '["x", "y"]'), "tilt.axes of the map names 2 columns"),
        ("t,x,y\n1,2,3\n2,2,3\n", ('["x"]', '["z"]'), 'no column "z"'),
    ],
)
def test_what_is_no_table_and_no_map_is_said_in_a_line(root, tmp_path, table, change, complaint):
    wheels = 'axes = ["x", "y"]\n'
    settings = f'robot = "{root}/config/edumip.toml"\n[time]\ncolumn = "t"\nunit = "s"\n'
    settings += '[tilt]\naxes = ["x"]\nunit = "rad"\n[battery]\nvolts = 7.4\n'
    settings += (
        f'[wheels]\nkind = "angle"\nunit = "rad"\n{wheels}[drive]\nkind = "volts"\nunit = "V"\n{wheels}'
    )
    (tmp_path / "t.csv").write_text(table)
    (tmp_path / "m.toml").write_text(settings.replace(*change))
    command = [sys.executable, "-m", "equipoise_tools.identify_balancing", tmp_path / "t.csv"]
    command += ["--map", tmp_path / "m.toml"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    assert done.returncode == 2 and complaint in done.stderr and done.stderr.count("\n") == 1
