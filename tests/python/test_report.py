"""The report finds in a known log what was put there, and draws it."""

import base64
import json
import os
import re
import subprocess
import sys

import equipoise_tools.figures as figures
import matplotlib.image
import numpy as np
import pytest
import synthetic
from driven import every_float, rewritten
from equipoise_robot.log import read_log
from equipoise_tools import names, report
from equipoise_tools.interactive import Run, plots_of
from equipoise_tools.metrics import fault_events, outcome, summarise


@pytest.fixture(scope="module")
def log(known_log):
    return read_log(known_log)


@pytest.fixture(scope="module")
def summary(log):
    return summarise(log)


def test_errors_against_truth_are_those_put_in(summary):
    assert list(summary.estimators) == ["ekf", "ekf13"]
    ekf, ekf13 = summary.estimators.values()
    assert ekf.attitude_rmse_rad == pytest.approx(synthetic.ATTITUDE_ERROR_RAD, rel=1e-12)
    assert ekf13.attitude_rmse_rad == pytest.approx(
        synthetic.OTHER_FACTOR * synthetic.ATTITUDE_ERROR_RAD, rel=1e-12
    )
    assert ekf.speed_rmse_m_s == pytest.approx(synthetic.RATE_ERROR_RAD_S * synthetic.RADIUS_M, rel=1e-12)
    assert summary.position_rmse_m == pytest.approx(synthetic.POSITION_ERROR_M, rel=1e-12)


def test_motion_duty_and_timing_are_those_put_in(summary):
    assert summary.robot == "mbbr"
    assert summary.ticks == 2000
    assert summary.duration_s == pytest.approx(9.995)
    assert summary.yaw_rate_mean_hz == pytest.approx(synthetic.YAW_HZ)
    assert summary.duty_max == 0.75
    assert summary.saturated_fraction == 0.25
    assert summary.compute_us == pytest.approx((2.0, 2.0, 9.0))
    assert (summary.overruns, summary.dropped_records) == (3, 4)
    assert summary.armed_s == pytest.approx(9.5, abs=0.01)
    assert summary.fell_at_s is None


def test_the_permission_to_move_is_told_in_words(tmp_path):
    summary = summarise(read_log(synthetic.write_log(tmp_path / "fall.lcm", fall_at_s=8.0)))
    assert (summary.ended, summary.reasons) == ("fell", ["tilt"])
    assert summary.fell_at_s == pytest.approx(8.0)
    assert outcome(summary) == "fell at 8.00 s: tilt"
    assert summary.events == [(0.0, "disarmed, not requested"), (0.5, "armed"), (8.0, "fault, tilt")]


@pytest.fixture(scope="module")
def judged_log(tmp_path_factory):
    path = tmp_path_factory.mktemp("judged") / "judged.lcm"
    return read_log(synthetic.write_log(path, faulty=(3.0, 6.5)))


def test_verdicts_on_sensors_are_events_with_their_numbers(judged_log, log):
    said = "encoder_2, log-likelihood ratio 21.4, bound 18.6, runner-up spin 3.0"
    verdicts = [(3.0, f"verdict: {said}"), (6.5, f"verdict taken back: {said}")]
    assert fault_events(judged_log) == verdicts
    assert [event for event in summarise(judged_log).events if "verdict" in event[1]] == verdicts
    assert fault_events(log) == []  # an older one's


def test_the_leading_ratio_is_drawn_against_its_bound(judged_log, log):
    highest = {"leading": 21.44, "runner-up": 3.0, "bound": 18.6}
    (plot,) = (p for p in plots_of(Run("", judged_log, summarise(judged_log)), False) if "Fault" in p.title)
    assert {s.label: s.values.max() for s in plot.series} == highest
    assert not any("Fault" in p.title for p in plots_of(Run("", log, summarise(log)), False))
    figure = figures.draw_report(judged_log, summarise(judged_log))
    (axes,) = (axes for axes in figure.axes if axes.get_title(loc="left") == "Fault hypotheses")
    assert {line.get_label(): max(line.get_ydata()) for line in axes.lines} == highest
    figures.plt.close(figure)


def test_a_disarmed_run_is_not_called_upright(tmp_path):
    summary = summarise(read_log(synthetic.write_log(tmp_path / "off.lcm", disarmed_at_s=7.0)))
    assert (summary.ended, summary.reasons) == ("disarmed", ["imu stale"])
    assert outcome(summary) == "motors went off at 7.00 s: imu stale"


def test_a_robot_that_was_refused_is_told_so(tmp_path):
    summary = summarise(read_log(synthetic.write_log(tmp_path / "no.lcm", disarmed_at_s=0.5)))
    assert summary.ended == "disarmed"
    assert outcome(summary) == "never armed: imu stale"


def test_the_drive_phase_is_the_commanded_one(log):
    ((start, end),) = figures.drive_phases(log)
    assert (start, end) == pytest.approx((synthetic.DRIVE_FROM_S, synthetic.DRIVE_TO_S))


def test_ball_speed_is_the_slope_of_the_position(log):
    speed = figures.velocity_W_m_s(log, names.TRUTH)
    t_s = log.seconds(names.TRUTH)
    driving = (t_s > 6.1) & (t_s < 8.9)
    np.testing.assert_allclose(speed[driving], [[synthetic.DRIVE_M_S, 0.0]] * driving.sum(), atol=1e-9)
    assert not speed[t_s < 5.9].any()


def test_smoothing_neither_shifts_nor_scales():
    t_s = np.arange(0, 60, 0.005)
    slow = np.sin(0.5 * t_s)  # far below 10 rad/s: passes
    fast = np.sin(100 * t_s)  # far above: the mean of both ways is 1 / (1 + (100 / 10)^2)
    inner = (t_s > 10) & (t_s < 50)
    np.testing.assert_allclose(figures.smoothed(slow, 0.005)[inner], slow[inner], atol=0.01)
    assert np.abs(figures.smoothed(fast, 0.005)[inner]).max() == pytest.approx(1 / 101, rel=0.1)
    np.testing.assert_allclose(figures.smoothed(np.full(50, 3.0), 0.005), 3.0)


def test_the_command_writes_a_picture_and_a_page_that_stands_alone(known_log, tmp_path, capsys):
    assert report.main([str(known_log), "--out", str(tmp_path / "out")]) == 0
    printed = capsys.readouterr().out
    assert re.search(r"^ekf +0\.00300 +2\.000$", printed, re.M)
    assert re.search(r"^ekf13 +0\.01500 +10\.000$", printed, re.M)
    assert "mean yaw rate:                  0.500 Hz" in printed
    picture = matplotlib.image.imread(tmp_path / "out" / "report.png")
    assert picture.shape[1] > 1000
    assert picture[..., :3].std() > 0.05  # something is drawn
    page = (tmp_path / "out" / "report.html").read_text()
    (embedded,) = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    assert base64.b64decode(embedded) == (tmp_path / "out" / "report.png").read_bytes()
    assert not re.search(r'(?:src|href)="(?!data:)', page)
    for number in ("0.00300", "10.000", "upright to the end", "0.750", "ab" * 32):
        assert number in page


def titles(path):
    log = read_log(path)
    figure = figures.draw_report(log, summarise(log))
    found = [axes.get_title(loc="left") for axes in figure.axes]
    figures.plt.close(figure)
    return found


def test_panels_follow_the_robot(known_log, tmp_path):
    mbbr = titles(known_log)
    assert mbbr[:2] == ["Tilt about x, $\\theta_x$", "Tilt about y, $\\theta_y$"]
    assert {"Ball speed along x", "Ball position y", "Track on the floor", "Yaw rate", "Duty"} <= set(mbbr)
    mip = titles(synthetic.write_log(tmp_path / "mip.lcm", robot="mip"))
    assert mip[:2] == ["Tilt, $\\theta$", "Wheel speed"]
    assert "Wheel speed error, smoothed" in mip
    assert not any("Ball" in title or "about y" in title for title in mip)


@pytest.mark.parametrize(("robot", "motors"), [("mbbr", 3), ("mip", 2)])
def test_every_motor_is_drawn_also_one_that_rests_and_no_other(tmp_path, robot, motors):
    log = read_log(synthetic.write_log(tmp_path / "run.lcm", robot=robot))
    log[names.MOTORS]["duty"][:, motors - 1] = 0.0
    figure = figures.draw_report(log, summarise(log))
    (axes,) = (axes for axes in figure.axes if axes.get_title(loc="left") == "Duty")
    drawn = [line.get_label() for line in axes.lines if line.get_label().startswith("motor")]
    figures.plt.close(figure)
    assert drawn == [f"motor {i + 1}" for i in range(motors)]


def test_a_cut_off_log_is_reported_with_a_note(known_log, tmp_path, capsys):
    cut = tmp_path / "cut.lcm"
    cut.write_bytes(known_log.read_bytes()[:-777])
    assert report.main([str(cut)]) == 0
    assert "note: cut off after" in capsys.readouterr().out
    assert "cut off after" in (tmp_path / "report.html").read_text()


def test_a_log_of_a_real_robot_has_no_truth_and_still_reports(known_log, tmp_path, capsys):
    import lcm

    path = tmp_path / "robot.lcm"
    out = lcm.EventLog(str(path), "w")
    for event in lcm.EventLog(str(known_log)):
        if event.channel not in (names.TRUTH, names.RUN):
            out.write_event(event.timestamp, event.channel, event.data)
    out.close()
    assert report.main([str(path)]) == 0
    printed = capsys.readouterr().out
    assert "RMSE" not in printed
    assert "mean yaw rate:                  0.500 Hz" in printed


def test_user_errors_are_one_line_and_status_2(tmp_path, capsys, known_log):
    assert report.main([str(tmp_path / "none.lcm")]) == 2
    assert capsys.readouterr().err == f"error: {tmp_path}/none.lcm: No such file or directory\n"
    blocked = tmp_path / "file"
    blocked.write_text("")
    assert report.main([str(known_log), "--out", str(blocked)]) == 2
    assert capsys.readouterr().err.startswith(f"error: {blocked}")


@pytest.mark.parametrize(
    "stamp",
    [lambda us: 0, lambda us: 10**9 - us, lambda us: us if us < 9_000_000 else 2**63 - 1],
    ids=["still", "backwards", "to the end of time"],
)
def test_a_log_whose_time_makes_no_sense_is_refused_in_one_line(known_log, tmp_path, capsys, stamp):
    def change(message):
        message.utime = stamp(message.utime)

    path = rewritten(tmp_path / "odd.lcm", known_log, change)
    assert report.main([str(path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f"error: {path}: EQUIPOISE_") and said.count("\n") == 1
    assert "its time stands still, goes back or lasts for 30 years" in said


@pytest.mark.filterwarnings("ignore")  # of NumPy and Matplotlib about such numbers
@pytest.mark.parametrize("number", [float("nan"), float("inf"), -1e308])
def test_a_log_of_numbers_that_are_none_is_reported_all_the_same(known_log, tmp_path, number):
    assert report.main([str(rewritten(tmp_path / "odd.lcm", known_log, every_float(number)))]) == 0


@pytest.mark.parametrize(
    "module", ["report", "tally", "view", "lockstep_client", "reliability", "lint", "experiments"]
)
def test_nobody_complains_when_the_output_is_not_read_on(module, known_log, tmp_path):
    arguments = [known_log, "--out", tmp_path] if module == "report" else ["--help"]
    if module == "tally":
        arguments = []
    command = [sys.executable, "-m", f"equipoise_tools.{module}", *map(str, arguments)]
    unread, end = os.pipe()
    os.close(unread)
    ended = subprocess.run(
        command,
        stdout=end,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": ":".join(sys.path)},
    )
    os.close(end)
    assert ended.stderr == ""
    assert ended.returncode in (0, 141)


def test_what_if_shows_a_changed_tuning_beside_the_run(root, tmp_path, capsys):
    """An encoder dies and is excluded; without detection it would not have been."""
    log = tmp_path / "run.lcm"
    run = [root / "build/host/equipoise", "run", "--backend", "sim", "--config", root / "config/mbbr.toml"]
    run += ["--telemetry", "off", "--speed", "50", "--arm", "--duration-s", "6", "--log", log]
    ran = subprocess.run([*map(str, run), "--fault", "encoder_dead@3"], capture_output=True, check=False)
    assert log.exists(), ran.stderr
    noise = "estimator.ekf.r=[2.08e-6, 2.08e-6, 2.08e-6, 8e-5, 8e-5, 8e-5, 1.41, 1.41]"
    changes = ["safety.detection=false", noise]
    asked = [str(log), "--out", str(tmp_path / "out")]
    assert report.main([*asked, *(word for change in changes for word in ("--set", change))]) == 0
    recorded, changed = capsys.readouterr().out.split(", ".join(changes))
    assert "without wheel" in alarms_in(recorded) and "without wheel" not in alarms_in(changed)

    was, beside = read_log(log), read_log(tmp_path / "out/what-if.lcm")
    assert beside.run.backend == "replay"
    for channel in (names.SENSORS, names.COMMAND):
        assert (was[channel] == beside[channel]).all()
    command = [root / "build/host/equipoise", "replay", log, "--json", "-"]
    command += [word for change in changes for word in ("--set", change)]
    said = json.loads(subprocess.run(list(map(str, command)), capture_output=True, check=True).stdout)
    for each, column in ((was, "recorded"), (beside, "changed")):  # counted from 5 s on
        nis = each[names.STATE]["normalized_innovation"]
        mean = said["retuned"][column]["normalized_innovation_mean"]
        assert nis[1000:].mean() == pytest.approx(mean, rel=1e-12)
        assert summarise(each).nis_mean == pytest.approx(nis[was[names.HEALTH]["arm_state"] == 1].mean())
    assert said["retuned"]["recorded"] != said["retuned"]["changed"]
    page = (tmp_path / "out/report.html").read_text()
    assert "The second column is no run" in page and "Normalised innovation" in page

    assert report.main([*asked, "--set", "safety.detecton=false"]) == 2
    assert report.main([str(log), *asked, "--set", changes[0]]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 2 and "safety.detecton" in said[0] and "--set: takes one log" in said[1]


def alarms_in(text):
    return next(line for line in text.splitlines() if line.startswith("alarms:"))
