"""The live viewer hears what is published and says what it means."""

import subprocess
import sys

import equipoise
import pytest
from equipoise_tools import view

import lcm

pytestmark = pytest.mark.live


def state(theta_x=0.1):
    message = equipoise.state_t()
    message.utime = 12_340_000
    message.theta_rad = [theta_x, -0.05, 0.0]
    message.omega_B_rad_s = [0, 0, 6.283185307179586]
    message.position_W_m = [0.5, -0.25]
    return message


def motors():
    message = equipoise.motors_t()
    message.motors, message.duty, message.enable = 3, [0.5, -0.25, 1.0, 0.0], True
    return message


def health(arm_state=2, reasons=1 << 1 | 1 << 5):
    message = equipoise.health_t()
    message.arm_state, message.reasons, message.battery_V = arm_state, reasons, 7.5
    return message


@pytest.fixture
def latest():
    latest = view.Latest()
    latest.take("EQUIPOISE_STATE", state().encode())
    latest.take("EQUIPOISE_MOTORS", motors().encode())
    latest.take("EQUIPOISE_HEALTH", health().encode())
    return latest


def test_one_line_tells_tilt_yaw_place_duty_battery_and_why_it_stands_still(latest):
    assert view.one_line(latest) == (
        "t 12.34 s  tilt +5.73, -2.86 deg  yaw +1.00 Hz  at +50.0, -25.0 cm  "
        "duty +0.50, -0.25, +1.00  7.50 V  fault/tilt/battery low"
    )


def test_the_screen_shows_the_same_and_the_rates(latest):
    screen = "\n".join(view.panel(latest, {"EQUIPOISE_STATE": 200.0}, "memq://"))
    for part in ("+5.73 deg", "motor 3", "fault, tilt, battery low", "7.50 V", "EQUIPOISE_STATE", "200.0 Hz"):
        assert part in screen
    assert "motor 4" not in screen


def test_bars_point_the_right_way_and_doubt_is_visible():
    half = view.BAR_WIDTH // 2
    assert view.bar(0.5, 1.0) == " " * view.BAR_WIDTH + "│" + "█" * half + " " * half
    assert view.bar(-9.0, 1.0) == "█" * view.BAR_WIDTH + "│" + " " * view.BAR_WIDTH
    assert set(view.bar(float("nan"), 1.0)) == {"?"}


def test_foreign_and_torn_messages_are_counted(latest):
    latest.take("EQUIPOISE_STATE", b"nonsense")
    latest.take("EQUIPOISE_STATE", state().encode()[:-5])
    assert latest.unknown == 2
    assert latest.messages["EQUIPOISE_STATE"].theta_rad[0] == 0.1


def test_lines_come_from_a_live_source(capsys):
    source = lcm.LCM("memq://")
    source.subscribe("EQUIPOISE_STATE", lambda *_: None)  # memq keeps only what somebody waits for
    for _ in range(10):
        source.publish("EQUIPOISE_STATE", state().encode())
        source.publish("UNRELATED", b"x")
    assert view.view(source, "memq://", once=True, seconds=0.3) == 0
    assert capsys.readouterr().out == "t 12.34 s  tilt +5.73, -2.86 deg  yaw +1.00 Hz  at +50.0, -25.0 cm\n"


def test_silence_is_a_failed_job_with_a_hint(capsys):
    assert view.view(lcm.LCM("memq://"), "memq://", once=True, seconds=0.1) == 1
    assert "is equipoise running" in capsys.readouterr().err


def test_a_wrong_url_is_bad_usage(capsys):
    assert view.main(["--url", "nonsense://"]) == 2
    assert capsys.readouterr().err.startswith("error: cannot open nonsense://")


def test_it_hears_another_process_over_multicast(root):
    """In a network namespace of its own: a publisher here, the viewer as its users start it."""
    script = (
        "import lcm, sys, time\n"
        "url, data = sys.argv[1], bytes.fromhex(sys.argv[2])\n"
        "source = lcm.LCM(url)\n"
        "while True:\n"
        "    source.publish('EQUIPOISE_STATE', data)\n"
        "    time.sleep(0.02)\n"
    )
    url = "udpm://239.255.76.67:7667?ttl=0"
    shell = (
        '"$0" -c "$1" "$2" "$3" & publisher=$!; '
        '"$0" -m equipoise_tools.view --url "$2" --once --seconds 3; status=$?; '
        "kill $publisher; exit $status"
    )
    command = [
        root / "tools/lib/multicast",
        "sh",
        "-c",
        shell,
        sys.executable,
        script,
        url,
        state().encode().hex(),
    ]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60)
    if result.returncode == 77:
        pytest.skip(result.stderr.strip())
    assert result.returncode == 0, result.stderr
    assert "t 12.34 s  tilt +5.73, -2.86 deg  yaw +1.00 Hz" in result.stdout
