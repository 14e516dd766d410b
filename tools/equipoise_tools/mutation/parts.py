"""Which tests speak for which sources."""

from __future__ import annotations

from dataclasses import dataclass
from fnmatch import fnmatch
from pathlib import Path


@dataclass(frozen=True)
class Stage:
    """A binary of the build, of only these of its tests. Cheap ones go first: most mutants get no further."""

    binary: str
    tests: tuple[str, ...]  # sources under tests/ that are linked; the binary's fixtures, too
    sources: tuple[
        str, ...
    ] = ()  # of the libraries, which hold a header's code; compiled anew for its mutants
    filter: str = "*"
    program: bool = False  # the tests start `equipoise`: it is linked anew, too
    only: tuple[str, ...] = ("*",)  # files whose mutants it is for
    never: tuple[str, ...] = ()
    twice: bool = False  # in real time: a mutant is killed by two failures in a row, not by one

    def is_for(self, file: str) -> bool:
        return any(fnmatch(file, p) for p in self.only) and not any(fnmatch(file, p) for p in self.never)


@dataclass(frozen=True)
class Part:
    files: tuple[str, ...]
    stages: tuple[Stage, ...]
    target: float = 0.8

    def paths(self, root: Path) -> list[Path]:
        """Sources of the build: of two versions of a library's interface one is."""
        built = (root / "build" / "host" / "build.ninja").read_text()
        every = {path for pattern in self.files for path in root.glob(pattern)}
        return sorted(path for path in every if path.suffix != ".c" or f"/{path.name}.o" in built)


DRIVER_FIXTURES = ("drivers/testbed.cpp", "drivers/fake_imu.cpp", "drivers/syscall_journal.cpp")
# Whose tests are asked first; all others, too, when those do not notice.
DRIVER_TESTS = {
    **{
        name: name
        for name in ("adc", "cutoff", "eqep", "events", "i2c_dev", "led", "mpu9250", "pwm", "serial", "sysfs")
    },
    **{name: f"{name}*" for name in ("can", "dmp")},
    **dict.fromkeys(("bbb", "bbb_open", "bbb_error"), "bbb*"),
    **dict.fromkeys(("hbridge", "mc33926", "tb6612"), "bridge"),
}
DRIVER_BINARY = "tests/drivers/driver_tests"
DRIVER_OWN = (*DRIVER_FIXTURES, "drivers/fake_gpio.cpp", "drivers/fake_can.cpp", "drivers/board_fixture.cpp")
ALLOCATION = "runtime/allocation_watch.cpp"  # the runtime tests' binary is linked for it
COMMANDS = (
    *(
        "command_auth",
        "command_key",
        "command_receiver",
        "command_sender",
        "command_follower",
        "command_wire",
    ),
)

ESTIMATORS = (*("heun", "kalman", "motor_error", "rest_bias", "sensor_faults", "slow_drift", "time_base"),)
# Where the filters of the robots are instantiated, once for all who use them.
FILTERS = ("src/robots/mbbr/ekf.cpp", "src/robots/mip/ekf.cpp")
CONTROL_TESTS = {
    **dict.fromkeys(("allocate", "governor"), "governor"),
    **dict.fromkeys(("friction", "gain_schedule"), "gain_schedule"),
    **{name: name for name in ("margins", "plausible")},
}
# Of the application what has tests in C++; commands and files are tested from outside, in Python.
APP_TESTS = {
    "trial/path": "app/path",
    "trial/verdict": "unit/app/verdict",
    "run/relay": "app/relay",
    "run/status_indicator": "app/status_indicator",
    "guard/service_notify": "app/service_notify",
    "commission/calibrate_imu": "app/calibrate_imu",
    **{
        f"remote/{n}": "app/remote*" for n in ("hand_remote", "frame_learning", "event_device", "remote_file")
    },
}

PARTS: dict[str, Part] = {
    "safety": Part(
        (
            "src/actuate/safety.cpp",
            "include/equipoise/actuate/degraded.hpp",
            "include/equipoise/actuate/encoder_check.hpp",
            "include/equipoise/actuate/encoder_probe.hpp",
        ),
        (
            Stage(
                "tests/unit_tests",
                (
                    "unit/safety*_test.cpp",
                    "unit/actuate/degraded_test.cpp",
                    "unit/actuate/encoder_check_test.cpp",
                    "unit/actuate/encoder_probe_test.cpp",
                ),
            ),
            Stage("tests/scenario_tests", ("scenario/reasons_test.cpp",), only=("*safety.cpp",)),
        ),
        target=0.9,
    ),
    "guard": Part(
        ("src/app/guard/guard.cpp", "src/app/guard/guard_bridges.cpp"),
        (
            Stage("tests/unit_tests", ("unit/app/guard_loop_test.cpp", "unit/app/guard_bridges_test.cpp")),
            Stage(
                "tests/runtime/runtime_tests",
                ("runtime/guard_test.cpp", "runtime/guard_command_test.cpp", ALLOCATION),
                program=True,
                twice=True,
            ),
        ),
        target=0.9,
    ),
    "heartbeat": Part(
        (
            "src/runtime/heartbeat.cpp",
            *(f"include/equipoise/runtime/{n}.hpp" for n in ("heartbeat", "supervisor")),
        ),
        (
            Stage("tests/unit_tests", ("unit/app/guard_loop_test.cpp",)),
            Stage(
                "tests/runtime/runtime_tests",
                ("runtime/heartbeat_test.cpp", ALLOCATION),
                twice=True,
            ),
        ),
        target=0.9,
    ),
    "command_auth": Part(
        tuple(f"src/runtime/{name}.cpp" for name in COMMANDS),
        (
            Stage(
                "tests/unit_tests",
                tuple(f"unit/runtime/{name}_test.cpp" for name in COMMANDS[:5]),
            ),
            Stage("tests/app_tests", ("app/wires_test.cpp",)),
        ),
        target=0.9,
    ),
    "drivers": Part(
        ("drivers/*.c",),
        (
            Stage(
                "tests/drivers/gpio_tests",
                ("drivers/gpio_test.cpp", *DRIVER_FIXTURES),
                only=("drivers/gpio.c",),
            ),
            *(
                Stage(DRIVER_BINARY, (f"drivers/{test}_test.cpp", *DRIVER_OWN), only=(f"drivers/{name}.c",))
                for name, test in DRIVER_TESTS.items()
            ),
            Stage(
                DRIVER_BINARY,
                ("drivers/*_test.cpp", *DRIVER_OWN),
                never=("drivers/gpio*.c",),  # a fake stands in their place
            ),
        ),
        target=0.9,
    ),
    "log": Part(
        (
            *(f"src/runtime/{name}.cpp" for name in ("log_writer", "log_parts")),
            *(f"src/app/log/{name}.cpp" for name in ("log_reader", "run_log")),
        ),
        (
            Stage(
                "tests/unit_tests", ("unit/runtime/log_writer*_test.cpp", "unit/runtime/log_parts_test.cpp")
            ),
            Stage("tests/app_tests", ("app/run_log_test.cpp", "app/log_reader_test.cpp")),
        ),
    ),
    "replay": Part(
        ("src/app/log/replay.cpp",),
        tuple(
            Stage("tests/replay_tests", (f"replay/{test}_test.cpp",))
            for test in ("replay_parts", "replay_result", "fault_replay")
        ),
    ),
    "bridge": Part(
        ("include/equipoise/actuate/bridge.hpp", "src/actuate/drive_coast.cpp"),
        (Stage("tests/unit_tests", ("unit/actuate/drive_coast_test.cpp",)),),
    ),
    "estimators": Part(
        ("include/equipoise/estimate/*.hpp", "include/equipoise/sense/freshness.hpp"),
        (
            *(
                Stage(
                    "tests/unit_tests",
                    (f"unit/estimate/{name}_test.cpp",),
                    only=(f"include/equipoise/estimate/{name}.hpp",),
                )
                for name in ESTIMATORS
            ),
            Stage(
                "tests/unit_tests",
                ("unit/sense/freshness_test.cpp",),
                only=("include/equipoise/sense/freshness.hpp",),
            ),
            Stage(
                "tests/unit_tests",
                ("unit/sense/calibrate_test.cpp",),
                only=("include/equipoise/estimate/rest_tilt.hpp",),
            ),
            Stage(
                "tests/unit_tests",
                ("unit/estimate/sensor_faults_test.cpp",),
                only=tuple(f"*/{name}.hpp" for name in ("evidence", "gross_samples", "used_sensors")),
            ),
            Stage(
                "tests/unit_tests",
                ("unit/estimate/packed_filter_test.cpp",),
                sources=FILTERS,
                only=("*/packed_filter.hpp", "*/downdate.hpp", "*/lanes.hpp"),
            ),
            Stage(
                "tests/unit_tests", ("unit/estimate/*_test.cpp",), sources=FILTERS, never=("*/freshness.hpp",)
            ),
        ),
    ),
    "control": Part(
        ("include/equipoise/control/*.hpp", "src/control/*.cpp"),
        (
            *(
                Stage(
                    "tests/unit_tests",
                    (f"unit/control/{test}_test.cpp",),
                    only=(f"include/equipoise/control/{name}.hpp",),
                )
                for name, test in CONTROL_TESTS.items()
            ),
            Stage("tests/unit_tests", ("unit/control/*_test.cpp",)),
            Stage(
                "tests/unit_tests",
                ("unit/config/config_test.cpp",),
                only=("*/chain.hpp", "src/control/*.cpp"),
            ),
        ),
        target=0.9,
    ),
    "robot_control": Part(
        (
            *(f"src/robots/mip/{n}" for n in ("reference.cpp", "lqr_feedback.hpp", "slc_feedback.hpp")),
            *(f"src/robots/mbbr/{n}" for n in ("reference.cpp", "scheduled_feedback.cpp")),
        ),
        (
            Stage("tests/unit_tests", ("unit/robots/*_test.cpp", "unit/control/mbbr_control_test.cpp")),
            Stage(
                "tests/scenario_tests",
                tuple(f"scenario/{n}_test.cpp" for n in ("mip_balance", "signs", "paths")),
            ),
        ),
        target=0.9,
    ),
    "app": Part(
        tuple(f"src/app/{name}.cpp" for name in APP_TESTS),
        (
            *(
                Stage(
                    "tests/unit_tests" if test.startswith("unit/") else "tests/app_tests",
                    (f"{test}_test.cpp",),
                    only=(f"src/app/{name}.cpp",),
                )
                for name, test in APP_TESTS.items()
            ),
            Stage(
                "tests/drivers/doctor_tests",
                ("drivers/status_lights_test.cpp", *DRIVER_FIXTURES),
                only=("src/app/run/status_indicator.cpp",),
            ),
        ),
        target=0.9,
    ),
    "pipeline": Part(
        ("include/equipoise/pipeline.hpp",),
        (
            Stage("tests/unit_tests", ("unit/pipeline/*_test.cpp",)),
            *(
                Stage("tests/scenario_tests", tuple(f"scenario/{test}_test.cpp" for test in tests))
                for tests in (("not_finite",), ("reasons",), ("encoder_check", "mip_balance", "signs"))
            ),
        ),
    ),
}
