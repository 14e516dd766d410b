"""The field's benchmark: its peers, its runs in both engines, its scores, resuming and interruption."""

import json
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

pytest.importorskip("mujoco", reason="tools/requirements-optional.txt")
from equipoise_tools.benchmark import __main__ as benchmark
from equipoise_tools.benchmark import peers, picture, policy, runs, score, sensing, tuning

NO_TINYMPC = pytest.mark.skipif(not peers.available("mpc"), reason="tools/requirements-tinympc.txt")
OTHERS = [
    pytest.param(name, marks=NO_TINYMPC) if name == "mpc" else name
    for name, peer in peers.PEERS.items()
    if peer.make
]


def lone(peer):
    return dict.fromkeys(peers.PEERS[peer].knobs, 1.0)


def exact(root, tmp_path, kind, row):
    request = tmp_path / "rows.json"
    request.write_text(json.dumps({"rows": [row]}))
    command = [root / "build/host/equipoise", "model", "--robot", kind, "--in", request, "--json", "-"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=True)
    return json.loads(done.stdout)["rows"][0]["qdd"]


def test_the_planes_are_those_of_the_exact_dynamics(root, tmp_path):
    tilt, u = 0.01, 0.05
    ball = sensing.known(runs.config_path("mbbr"))
    still = {"theta_dot": [0.0] * 3, "phi_star_dot": [0.0] * 2}
    k1 = sensing.shipped(runs.config_path("mbbr"))["robot"]["k1_N_m"]
    qdd = exact(root, tmp_path, "mbbr", {"theta_xy": [tilt, 0.0], "tau_B": [k1 * u, 0, k1 * u], **still})
    told = ball.a @ [tilt, 0, 0, 0] + ball.b * u
    assert told[2:] == pytest.approx([qdd[0], qdd[3]], rel=0.01)
    assert ball.yaw_gain * u == pytest.approx(qdd[2], rel=0.02)
    wheels = sensing.known(runs.config_path("mip"))
    still = {"theta_dot": 0.0, "phi_dot": 0.0, "psi_dot": 0.0}
    theta, phi, psi = exact(root, tmp_path, "mip", {"theta": tilt, "u_x": u, "u_z": u, **still})
    told = wheels.a @ [tilt, 0, 0, 0] + wheels.b * u
    assert told[2:] == pytest.approx([theta, phi + theta], rel=0.01)
    assert wheels.yaw_gain * u == pytest.approx(psi, rel=0.02)


def test_the_sliding_modes_error_is_the_quaternions():
    from scipy.spatial.transform import Rotation

    there, wanted = [0.3, -0.2], [-0.1, 0.25]
    q = Rotation.from_euler("YX", there[::-1]).inv() * Rotation.from_euler("YX", wanted[::-1])
    assert peers.Sliding.vector(wanted, there) == pytest.approx(2 * q.as_quat()[:2], abs=1e-12)
    assert peers.Sliding.vector([0.2], [0.1]) == pytest.approx([2 * np.sin(0.05), 0.0])


def test_the_quaternion_peers_error_is_the_whole_attitudes():
    from scipy.spatial.transform import Rotation

    x, y, heading = 0.3, -0.2, 2.0
    q = (Rotation.from_euler("YX", [y, x]).inv() * Rotation.from_euler("Z", heading)).as_quat()
    assert peers.Quaternion.error(x, y, heading) == pytest.approx([q[3], *q[:3]], abs=1e-12)


def test_the_quaternion_peers_gains_are_the_planes_and_couple_as_it_spins():
    ball = sensing.known(runs.config_path("mbbr"))
    told = peers.Quaternion(ball, lone("quaternion"))
    still = told.solve(0.0)
    assert still[0, [0, 6, 3, 8, 10]] == pytest.approx(
        peers.lqr(ball, {**lone("lqr"), "tilt": 2.0}), rel=1e-6
    )
    assert still[0, 1] == pytest.approx(0.0, abs=1e-9)
    assert abs(told.solve(12.0)[0, 1]) > 0.05 * abs(still[0, 0])


@NO_TINYMPC
def test_the_mpc_is_the_lqr_within_its_limits():
    wheels = sensing.known(runs.config_path("mip"))
    told = peers.Predictive(wheels, lone("mpc"))
    told.restart()
    a, b = peers.discrete(wheels)
    p = peers.solve_discrete_are(a, b, peers.weights(lone("lqr")), np.eye(1))
    k = np.linalg.solve(1 + b.T @ p @ b, b.T @ p @ a)[0]
    error = np.array([0.01, 0.05, 0.02, 0.1])
    assert told.axis(0, tuple(error), 0.0) == pytest.approx(k @ a @ error, rel=0.05)
    assert told.axis(0, (0.3, 0.0, 3.0, 0.0), 0.0) == -peers.MOST_U


@pytest.mark.parametrize("kind", runs.CONFIGS)
def test_the_policy_keeps_robots_upright_that_it_was_not_trained_on(kind):
    for robot in range(901, 905):
        assert policy.stays_upright(kind, runs.config_path(kind), robot, "mujoco", "built2025")


@pytest.mark.slow
def test_an_edumips_estimate_is_not_led_astray_by_the_evidence():
    """Turning on a slope, the evidence errs by 50 mrad in tilt; when an event led, the control took it."""
    for robot in (19, 143, 151, 229, 342):  # all were lost
        assert policy.stays_upright("mip", runs.config_path("mip"), robot, "mujoco", "built2025")


def test_a_policy_is_read_as_it_was_written(tmp_path):
    net = [(np.full((3, 2), 0.5), np.arange(3.0)), (np.ones((1, 3)), np.zeros(1))]
    for kind in runs.CONFIGS:
        policy.write(kind, net, {"seed": 1}, tmp_path / "policy.json")
    back = policy.read("mbbr", tmp_path / "policy.json")
    assert [layer.shape for pair in back for layer in pair] == [(3, 2), (3,), (1, 3), (1,)]
    assert policy.action(back, np.array([1.0, -1.0])) == pytest.approx(min(np.tanh(np.arange(3)).sum(), 1.0))


def test_the_trainer_ends_episodes_where_the_environment_does():
    """A robot that is lost is worth nothing from there; one whose time is over is not lost."""
    pytest.importorskip("stable_baselines3", reason="tools/requirements-training.txt")
    from equipoise_tools.benchmark import training

    robots = training.Robots("mip", "nominal", seed=1, engines=["own"])
    robots.reset()
    ended = []
    while not robots.over[0].any():
        _, reward, done, infos = robots.step(np.ones((robots.num_envs, 2)))
        ended = np.flatnonzero(done)
    assert all(reward[ended] <= 0.0)
    assert not any(infos[i]["TimeLimit.truncated"] for i in ended)
    _, reward, done, infos = robots.step(np.zeros((robots.num_envs, 2)))
    assert all(done[ended]) and all(reward[ended] == 0.0)
    assert all(np.array_equal(infos[i]["terminal_observation"], robots.seen[i]) for i in ended)


@pytest.mark.parametrize("engine", runs.ENGINES)
@pytest.mark.parametrize("kind", runs.CONFIGS)
@pytest.mark.parametrize("peer", OTHERS)
def test_a_peer_drives_and_turns_the_typical_robot(peer, kind, engine):
    """As its designer left it: a wrong sign of an axis, rate or heading misleads it."""
    told = runs.run(runs.Trial(0, kind, peer, "turn", engine), "built2025", lone(peer))
    assert told["ended"] == "finished", told
    assert told["yaw_rate_mean_hz"] == pytest.approx(1.0, abs=0.05)
    assert told["position_rmse_m"] < 0.6  # of 2 m


@pytest.mark.parametrize("engine", runs.ENGINES)
def test_faults_and_pushes_reach_the_robot_in_both_engines(engine, monkeypatch):
    point = runs.Point("encoder fault", runs.everywhere(0.0), 0.2, faults=("not_a_number",))
    monkeypatch.setitem(runs.POINTS, point.name, point)
    lost = runs.run(runs.Trial(0, "mbbr", "lqr", point.name, engine), "built2025", lone("lqr"))
    assert runs.FAULT_AT_S <= lost["fell_at_s"] < runs.FAULT_AT_S + 1.0
    monkeypatch.setattr(runs, "PUSH_N", (40.0, 40.0))
    pushed = runs.run(runs.Trial(0, "mbbr", "lqr", "pushes", engine), "built2025", lone("lqr"))
    assert runs.PUSHES_AT_S[0] <= pushed["fell_at_s"] < runs.PUSHES_AT_S[0] + 1.0


def test_a_controller_that_raises_ends_the_run_in_the_other_engine_too(monkeypatch):
    def broken(self, tick):
        raise ZeroDivisionError("planted")

    monkeypatch.setattr(peers.Lqr, "__call__", broken)
    with pytest.raises(ZeroDivisionError, match="planted"):
        runs.run(runs.Trial(0, "mip", "lqr", "drive", "mujoco"), "built2025", lone("lqr"))


def row(peer, robot, ended, point="drive", engine="own"):
    told = {"fell_at_s": 3.0, "position_rmse_m": 0.1, "yaw_rate_mean_hz": 0.0}
    return told | {
        "kind": "mip",
        "peer": peer,
        "robot": robot,
        "point": point,
        "engine": engine,
        "ended": ended,
    }


def test_a_lead_needs_an_interval_and_has_the_right_sign():
    rows = [row("ours", n, "finished" if n < 2 else "fell") for n in range(20)]
    rows += [row("pid", n, "finished") for n in range(20)]
    rows += [row("lqr", n, "finished" if n < 3 else "disarmed") for n in range(20)]
    told = {(s["peer"], s["point"]): s for s in score.scores(rows)}
    gap, low, high = told["pid", "drive"]["ours_ahead"]
    assert (gap, told["pid", "drive"]["upright"]) == (-0.9, 20)
    assert low < -0.9 < high < 0
    _, low, high = told["lqr", "drive"]["ours_ahead"]
    assert low < 0 <= high  # one robot is chance
    assert told["ours", "all"]["fell_with_motors_on"] == 18
    assert all("pid" in line for line in score.lost(list(told.values())))
    few = score.scores([*rows[:4], *rows[20:24]])
    assert all(s["ours_ahead"] is None for s in few)


def test_the_runs_of_a_robot_are_one_draw():
    """Twelve runs of a robot that go alike say as much as one."""
    alone = {n: float(n % 2) for n in range(40)}
    zeros = dict.fromkeys(alone, 0.0)
    rows = [row("ours", n, "finished" if n % 2 else "fell", point=p) for n in alone for p in runs.POINTS]
    assert score.by_robot(rows) == alone
    _, low, high = score.difference(alone, zeros)
    assert high - low > 0.25  # 0.31 for 40 draws, 0.13 for 240


def test_the_search_prefers_who_lasts_and_keeps_its_place():
    place = {"ended": "finished", "position_rmse_m": 0.05, "fell_at_s": None}
    astray = {**place, "position_rmse_m": 5.0}
    late, early = ({"ended": "fell", "fell_at_s": t, "position_rmse_m": None} for t in (11.0, 1.0))
    costs = [tuning.cost(r) for r in (place, astray, late, early)]
    assert costs == sorted(costs)
    assert len(set(costs)) == 4


def test_every_peer_had_the_same_number_of_runs_and_none_of_the_robots_that_score():
    told = tuning.found()
    for kind in runs.CONFIGS:
        searched = {name for name, peer in peers.PEERS.items() if peers.knobs_of(peer, kind)}
        assert set(told[kind]) == searched
        assert len({result["runs"] for result in told[kind].values()}) == 1
        assert all(
            set(told[kind][n]["factors"]) == set(peers.knobs_of(peers.PEERS[n], kind)) for n in searched
        )
    trained = {trial.robot for trial in tuning.training("mip", "pid", 50)}
    assert max(trained) < benchmark.arguments([]).first_robot
    with pytest.raises(SystemExit):
        benchmark.arguments(["--first-robot", str(max(trained))])


SMALL = ("--kinds", "mip", "--peers", "ours", "lqr", "--points", "drive", "pushes", "--engines", "own")


def test_it_goes_on_where_it_was_interrupted(tmp_path):
    out, whole = tmp_path / "a", tmp_path / "b"
    command = [sys.executable, "-m", "equipoise_tools.benchmark", *SMALL, "--robots", "15", "--workers", "1"]
    started = subprocess.Popen([*command, "--out", out], stderr=subprocess.PIPE, text=True)
    kept = out / "runs.jsonl"
    until = time.monotonic() + 120
    while not (kept.exists() and kept.stat().st_size) and time.monotonic() < until:
        time.sleep(0.02)
    started.send_signal(signal.SIGINT)
    _, said = started.communicate(timeout=60)
    assert started.returncode == 1, said
    assert "goes on from here" in said
    assert "Traceback" not in said
    before = kept.read_text()
    assert 0 < len(before.splitlines()) < 60
    kept.write_text(before + '{"robot": 9')  # torn by a power cut
    assert benchmark.main([*SMALL, "--robots", "15", "--workers", "1", "--out", str(out)]) == 0
    assert kept.read_text().startswith(before)
    assert benchmark.main([*SMALL, "--robots", "15", "--workers", "2", "--out", str(whole)]) == 0
    for name in ("scores.json", "benchmark.md", "benchmark.png"):
        assert (out / name).read_bytes() == (whole / name).read_bytes()
    refused = benchmark.main([*SMALL, "--robots", "15", "--fidelity", "nominal", "--out", str(out)])
    assert refused == 2


def test_the_page_is_that_of_the_kept_scores(tmp_path):
    kept = json.loads(benchmark.KEPT.read_text())
    assert benchmark.PAGE.read_text() == score.page(kept["scores"], kept["about"])
    picture.draw(kept["scores"], tmp_path / benchmark.PAGE.name)
    drawn = benchmark.PAGE.with_suffix(".png")
    assert (tmp_path / drawn.name).read_bytes() == drawn.read_bytes()
