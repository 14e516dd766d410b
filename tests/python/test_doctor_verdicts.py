"""equipoise doctor: everything that it looks at, by verdict; limits on both sides."""

from pathlib import Path

import pytest
from made_up_machine import examine, made_up, write


@pytest.fixture
def robot(tmp_path) -> Path:
    return made_up(tmp_path / "robot")


MACHINE = {
    "kernel.preempt_rt",
    "device_tree.model",
    "clock.monotonic",
    "limits.rtprio",
    "limits.memlock",
    "lcm.route",
}
ROBOT = {
    *("device_tree.overlay", "device_tree.twin", "uenv.video", "uenv.audio", "uenv.cape_universal"),
    *(
        "kernel.cpu_frequency",
        "kernel.irq_threads",
        "kernel.watchdog",
        "limits.cpu_idle",
        "imu.dmp",
        "battery.adc",
    ),
    *("serial", "encoder.1", "encoder.2", "pwm.1", "pwm.2"),
}


def by_verdict(checks) -> dict:
    """Of what is looked at once, not for each pin."""
    names = [name for name in checks if not name.startswith(("gpio.", "pinmux.", "clock.wall"))]
    return {
        verdict: {name for name in names if checks[name]["verdict"] == verdict}
        for verdict in ("ok", "warn", "skipped", "fail")
    }


def test_everything_that_is_looked_at_has_its_verdict(root, robot, tmp_path):
    rest = {"warn": set(), "skipped": {"command.key", "can"}, "fail": {"imu.bus"}}
    checks, _ = examine(root, robot)
    assert by_verdict(checks) == {"ok": MACHINE | ROBOT | {"encoder.3", "pwm.3"}, **rest}
    assert len([name for name in checks if name.startswith("gpio.")]) == 19
    checks, _ = examine(root, robot, board="robotics_cape_edumip")
    assert by_verdict(checks) == {"ok": MACHINE | ROBOT, **rest}
    rest = {"warn": set(), "skipped": {"command.key", "board"}, "fail": set()}
    assert by_verdict(examine(root, robot, board=None)[0]) == {"ok": MACHINE, **rest}
    (tmp_path / "empty").mkdir()
    for board in (None, "robotics_cape_mbbr"):
        assert by_verdict(examine(root, tmp_path / "empty", board=board)[0]) == {
            "ok": {"clock.monotonic"},
            "warn": {"limits.rtprio", "limits.memlock", "lcm.route"},
            "skipped": {"kernel.preempt_rt", "device_tree.model", "command.key", "board"},
            "fail": set(),
        }


@pytest.mark.parametrize(
    ("limit", "check", "least"),
    [("Max realtime priority", "limits.rtprio", 90), ("Max locked memory", "limits.memlock", 256 << 20)],
)
def test_a_limit_is_enough_from_what_the_loop_needs_on(root, robot, limit, check, least):
    for value, verdict in ((least, "ok"), (least - 1, "fail"), (0, "fail"), ("unlimited", "ok")):
        write(robot / "proc/self/limits", f"Max cpu time 1 1\n{limit}     {value}     9     units\n")
        found = examine(root, robot)[0][check]
        assert found["verdict"] == verdict and f"{limit} " in found["what"] and str(value) in found["what"]


@pytest.mark.parametrize(
    ("route", "there"),
    [
        ("eth0 00000000 0100000A 0003 0 0 0 00000000", True),  # the default
        ("eth0 0000A8C0 00000000 0001 0 0 0 00FFFFFF", False),
        ("eth0 434CFFEF 00000000 0005 0 0 0 FFFFFFFF", True),
        ("eth0", False),
    ],
)
def test_a_route_takes_the_group_where_its_mask_says_so(root, robot, route, there):
    write(robot / "proc/net/route", f"Iface Destination\n{route} 0 0 0\n")
    assert examine(root, robot)[0]["lcm.route"]["verdict"] == ("ok" if there else "warn")


@pytest.mark.parametrize(
    ("file", "content", "check", "said"),
    [
        ("sys/class/pwm/pwmchip4/npwm", "1\n", "pwm.2", "has 1 channels, needs channel B"),
        ("sys/class/pwm/pwmchip7/npwm", "0\n", "pwm.3", "has 0 channels, needs channel A"),
        ("sys/class/pwm/pwmchip7/export", None, "pwm.3", "pwmchip7/export: No such file"),
        (
            "sys/bus/iio/devices/iio:device0/in_voltage6_raw",
            None,
            "battery.adc",
            "in_voltage6_raw: No such file",
        ),
        ("sys/bus/counter/devices/counter1/count0/enable", None, "encoder.2", "No such file"),
    ],
)
def test_a_device_that_lacks_something_fails_alone(root, robot, file, content, check, said):
    (robot / file).unlink() if content is None else (robot / file).write_text(content)
    checks, _ = examine(root, robot)
    assert by_verdict(checks)["fail"] == {"imu.bus", check}
    assert said in checks[check]["what"] and checks[check]["fix"]
    assert checks["pwm.1"]["what"] == "EHRPWM at 48302200 channel A"
