// Pulses on the stand: wiring faults are found, corrected in the board file, and motors end up off.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "app/board/calibration_file.hpp"
#include "app/cli/commands.hpp"
#include "app/cli/interrupt.hpp"
#include "app/commission/board_edit.hpp"
#include "app/commission/simulated_stand.hpp"
#include "app/text/files.hpp"
#include "equipoise/config.hpp"
#include "robots/mbbr/config.hpp"
#include "robots/mip/config.hpp"
#include "support/assign.hpp"
#include "support/mock.hpp"

namespace equipoise::app {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::string kSource = EQUIPOISE_SOURCE_DIR;
const std::string kMbbrBoard = kSource + "/config/boards/robotics_cape_mbbr.toml";

StandSetup mbbr_setup(const std::vector<std::string>& set = {}) {
  const MbbrConfig config = load_mbbr(kSource + "/config/mbbr.toml", set).config;
  return {layout_of(config.robot, config.motor, config.calibration), Vec3::UnitY(), config.motor,
          config.calibration, config.world[static_cast<std::size_t>(Fidelity::kNominal)].common};
}

StandSetup mip_setup() {
  const MipConfig config = load_mip(kSource + "/config/edumip.toml", {}).config;
  return {layout_of(config.robot, config.motor, config.calibration), Vec3::UnitX(), config.motor,
          config.calibration, config.world[static_cast<std::size_t>(Fidelity::kNominal)].common};
}

std::vector<WheelFinding> pulses(const StandSetup& setup, SimulatedStand& robot) {
  ManualDrive manual(robot.io(), robot.ask());
  return pulse_all(manual, setup.layout, setup.calibration);
}

std::string complaint_with(const StandSetup& setup, const std::vector<std::string>& faults) {
  SimulatedStand robot(setup, parse_faults(faults, setup.layout.wheels));
  try {
    return complaint(pulses(setup, robot));
  } catch (const JobError& error) {
    return error.what();
  }
}

TEST(Pulses, FindNothingWrongWithARobotWiredAsItsBoardFileSays) {
  EXPECT_THAT(complaint_with(mbbr_setup(), {}), IsEmpty());
  EXPECT_THAT(complaint_with(mip_setup(), {}), IsEmpty());
}

TEST(Pulses, FindEveryFaultOfOrderAndSign) {
  const StandSetup mbbr = mbbr_setup();
  EXPECT_EQ(complaint_with(mbbr, {"motor-2-reversed"}), "motor 2 turns backwards");
  EXPECT_EQ(complaint_with(mbbr, {"encoder-3-reversed"}), "encoder 3 counts backwards");
  EXPECT_EQ(complaint_with(mbbr, {"encoders-1-3-swapped"}),
            "motor 1 moves encoder 3; motor 3 moves encoder 1");
  EXPECT_EQ(complaint_with(mbbr, {"motors-1-2-swapped"}),
            "motor 1 turns wheel 2; motor 1 moves encoder 2; motor 2 turns wheel 1; motor 2 moves encoder 1");
  EXPECT_EQ(complaint_with(mip_setup(), {"motor-1-reversed"}), "motor 1 turns backwards");
  EXPECT_EQ(complaint_with(mip_setup(), {"encoder-2-reversed"}), "encoder 2 counts backwards");
}

TEST(Pulses, NameAnAzimuthThatIsNotTheConfigured) {
  for (const double off_deg : {40.0, 60.0, -75.0}) {
    const std::string set = "robot.wheel_azimuth_deg=" + std::to_string(-100.0 - off_deg);
    const StandSetup built = mbbr_setup({"robot.wheel_azimuth_deg=-100"});
    SimulatedStand robot(built, {});
    try {
      pulses(mbbr_setup({set}), robot);
      ADD_FAILURE() << off_deg;
    } catch (const JobError& error) {
      EXPECT_THAT(error.what(),
                  HasSubstr("robot.wheel_azimuth_deg is off: add " + std::to_string(std::lround(off_deg))));
    }
  }
  SimulatedStand robot(mbbr_setup({"robot.wheel_azimuth_deg=-130"}), {});
  EXPECT_THAT(complaint(pulses(mbbr_setup(), robot)), IsEmpty());  // 10 degrees: the gyro is not surer
}

TEST(Pulses, OfADeadMotorSayWhereToLook) {
  EXPECT_THAT(complaint_with(mbbr_setup(), {"motor-3-dead"}), HasSubstr("motor 3: no encoder moves"));
}

TEST(Pulses, TellTheWheelsOfTheMbbrApartByTheKickAloneAndThoseOfTheMipByAsking) {
  EXPECT_TRUE(mbbr_setup().layout.told_apart_by_gyro());
  EXPECT_FALSE(mip_setup().layout.told_apart_by_gyro());
}

/// A backend that remembers the last command of another one.
struct Watch {
  rio_t inner;
  double largest = 0.0;
  int driven_ticks = 0;
  bool on = false;
  int stop_after = -1;  // Ctrl-C in this driven tick

  rio_t io() {
    static const rio_ops_t ops{
        [](void* p, std::int64_t* now) { return rio_wait_tick(&self(p).inner, now); },
        [](void* p, rio_sensors_t* out) { return rio_read_sensors(&self(p).inner, out); },
        [](void* p, const rio_motors_t* m) {
          for (const double duty : m->duty) self(p).largest = std::max(self(p).largest, std::abs(duty));
          self(p).on = m->enable;
          if (++self(p).driven_ticks == self(p).stop_after) interrupted = true;
          return rio_write_motors(&self(p).inner, m);
        },
        [](void* p) {
          self(p).on = false;
          return rio_motors_off(&self(p).inner);
        },
        [](void* p) { self(p).on = false; }};
    return {&ops, this};
  }
  static Watch& self(void* p) { return *static_cast<Watch*>(p); }
};

TEST(Pulses, AreTinyAndShortAndEndWithMotorsOff) {
  const StandSetup setup = mip_setup();  // drive/brake: duty is the share of the stall torque
  SimulatedStand robot(setup, {});
  Watch watch{robot.io()};
  ManualDrive manual(watch.io(), robot.ask());
  pulse(manual, setup.layout, setup.calibration, 0);
  EXPECT_GT(watch.largest, 0.05);
  EXPECT_LE(watch.largest, 0.35);
  EXPECT_LE(watch.driven_ticks, 100 + 48);  // a ramp of 0.5 s, four strokes of 60 ms
  EXPECT_FALSE(watch.on);
}

TEST(Pulses, OnCtrlCLeaveTheMotorsOff) {
  const StandSetup setup = mbbr_setup();
  for (const int tick : {1, 20, 60}) {
    SimulatedStand robot(setup, {});
    Watch watch{robot.io()};
    watch.stop_after = tick;
    {
      ManualDrive manual(watch.io(), robot.ask());
      EXPECT_THROW(pulse(manual, setup.layout, setup.calibration, 0), JobError);
      EXPECT_FALSE(watch.on) << "in tick " << tick;
    }
    interrupted = false;
    EXPECT_EQ(watch.driven_ticks, tick);
  }
}

/// An encoder whose phase B is stuck: A alone goes up and down with every second edge.
struct DeadPhaseB {
  rio_t inner;
  std::size_t encoder;

  rio_t io() {
    static const rio_ops_t ops{
        [](void* p, std::int64_t* now_ns) { return rio_wait_tick(&self(p).inner, now_ns); },
        [](void* p, rio_sensors_t* s) {
          const int status = rio_read_sensors(&self(p).inner, s);
          double& counts = s->encoder_counts[self(p).encoder];
          const auto edge = static_cast<std::int64_t>(std::floor(counts)) & 3;
          counts = edge == 1 || edge == 2 ? 1.0 : 0.0;
          return status;
        },
        [](void* p, const rio_motors_t* m) { return rio_write_motors(&self(p).inner, m); },
        [](void* p) { return rio_motors_off(&self(p).inner); }, [](void*) {}};
    return {&ops, this};
  }
  static DeadPhaseB& self(void* p) { return *static_cast<DeadPhaseB*>(p); }
};

TEST(Pulses, TellADeadEncoderPhaseFromAnEncoderThatDoesNotCount) {
  const StandSetup setup = mbbr_setup();
  const auto words = [&](rio_t io, Ask ask) -> std::string {
    ManualDrive manual(io, std::move(ask));
    try {
      pulse(manual, setup.layout, setup.calibration, 1);
    } catch (const JobError& error) {
      return error.what();
    }
    return "";
  };
  SimulatedStand robot(setup, {});
  DeadPhaseB half{robot.io(), 1};
  Watch watch{half.io()};
  EXPECT_NE(words(watch.io(), robot.ask()).find("encoder 2 counts one up and one down"), std::string::npos);
  EXPECT_FALSE(watch.on);
  SimulatedStand held(setup, parse_faults({"motor-2-dead"}, 3));
  EXPECT_NE(words(held.io(), held.ask()).find("no encoder moves"), std::string::npos);
}

TEST(ManualDrive, WithoutValidSamplesGivesUpWithMotorsOff) {
  rio_sensors_t blind{};
  blind.valid = RIO_ENCODERS;
  Mock mock(std::vector<rio_sensors_t>(20, blind));
  ManualDrive manual(mock.io(), [](const Request&, std::string*) { return true; });
  EXPECT_THROW(manual.drive({0.1, 0, 0, 0}), JobError);
  ASSERT_FALSE(mock.written.empty());
  EXPECT_FALSE(mock.written.back().enable);
}

// What turned no motor must not be measured.
TEST(ManualDrive, ATickThatTheGuardFoundTooLateEndsTheJob) {
  rio_sensors_t sample{};
  sample.valid = RIO_IMU | RIO_ENCODERS;
  Mock mock(std::vector<rio_sensors_t>(20, sample));
  runtime::HeartbeatPage page{};
  ManualDrive manual(
      mock.io(), [](const Request&, std::string*) { return true; }, &page);
  page.guard_ns = runtime::monotonic_now_ns();
  manual.drive({0.1, 0, 0, 0});
  page.cut = 1;
  EXPECT_THROW(manual.drive({0.1, 0, 0, 0}), JobError);
  EXPECT_FALSE(mock.written.back().enable);
  EXPECT_EQ(page.want_enable, 0U);
  manual.drive({0.1, 0, 0, 0});  // it has let go
  EXPECT_TRUE(mock.written.back().enable);
}

TEST(ManualDrive, WhoeverIsAskedMayStop) {
  Mock mock({});
  ManualDrive manual(mock.io(), [](const Request&, std::string*) { return false; });
  EXPECT_THROW(manual.ask({Request::kUpright, "upright?"}), JobError);
}

TEST(BoardEdit, MakesARobotThatIsWiredOtherwiseFit) {
  const StandSetup setup = mbbr_setup();
  const Board before = load_board(kMbbrBoard);
  SimulatedStand robot(setup, parse_faults({"motors-1-2-swapped", "encoders-2-3-swapped", "motor-1-reversed",
                                            "encoder-3-reversed"},
                                           3));
  const auto findings = pulses(setup, robot);
  EXPECT_FALSE(complaint(findings).empty());
  const std::string text = rewired(read_text(kMbbrBoard), findings);
  robot.rewire(before, parse_board(text, "corrected.toml"));
  EXPECT_THAT(complaint(pulses(setup, robot)), IsEmpty());
  EXPECT_THAT(text, HasSubstr("# EHRPWM1"));  // comments survive
}

TEST(BoardEdit, NamesTheCalibrationFileOnce) {
  const std::string once = with_calibration(read_text(kMbbrBoard), "a.toml");
  const std::string twice = with_calibration(once, "b.toml");
  EXPECT_EQ(parse_board(once, "once").calibration_file, "a.toml");
  EXPECT_EQ(parse_board(twice, "twice").calibration_file, "b.toml");
  EXPECT_EQ(once.size(), twice.size());
}

TEST(CalibrationFile, RoundTripsAndReachesTheConfigurationInBodyAxes) {
  CalibrationFile file;
  file.robot = "mbbr";
  file.wheel_count = 3;
  Mat3 turned;
  turned << 0, -1, 0, 1, 0, 0, 0, 0, 1;
  file.gyro = {{"2026-01-01T00:00:00Z", 31.5}, Vec3(0.01, 0.0, 0.0), Vec3::Constant(0.001)};
  file.accel = {{"2026-01-01T00:00:00Z", {}}, Vec3(1.01, 0.99, 1.0), Vec3(0.0, 0.1, 0.0), 0.02};
  file.mount = {{"2026-01-01T00:00:00Z", {}}, turned};
  file.motors = {{"2026-01-01T00:00:00Z", {}}, {1, 2, 3}, {3, 2, 1}, {0.1, 0.2, 0.3}};
  const CalibrationFile again = parse_calibration(to_toml(file), "c.toml");
  EXPECT_EQ(to_toml(again), to_toml(file));
  EXPECT_EQ(again.gyro->stamp.temperature_degC, 31.5);
  EXPECT_FALSE(again.accel->stamp.temperature_degC.has_value());

  Board board = load_board(kMbbrBoard);
  board.measured = measured_of(file, board.facts.R_BS);
  const Calibration c = load_mbbr(kSource + "/config/mbbr.toml", overrides_of(board)).config.calibration;
  EXPECT_EQ(c.R_BS, turned);
  EXPECT_LT((c.gyro_bias_B_rad_s - Vec3(0.0, 0.01, 0.0)).norm(), 1e-15);  // sensor x is body y
  EXPECT_LT((c.accel_bias_B_m_s2 - Vec3(-0.1, 0.0, 0.0)).norm(), 1e-15);
  EXPECT_EQ(c.accel_scale_S, Vec3(1.01, 0.99, 1.0));
  RawSample raw{};
  assign(raw.accel_counts, {0.0, 4096.0, 0.0});
  EXPECT_NEAR(calibrate<3>(raw, c).accel_B_m_s2.x(), 0.99 * kGravity_m_s2 - 0.1, 1e-12);  // [T] (5.26)
}

TEST(CalibrationFile, OfAnotherRobotOrVersionIsRefused) {
  const auto refusal = [](const std::string& text) -> std::string {
    try {
      parse_calibration(text, "c.toml");
    } catch (const ConfigError& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(refusal("version = 2\nrobot = \"mbbr\"\nwheels = 3\n"), HasSubstr("c.toml:1: version: 2"));
  EXPECT_THAT(refusal("version = 1\nrobot = \"mbbr\"\nwheels = 3\ngryo = 1\n"), HasSubstr("unknown key"));
  EXPECT_EQ(refusal("version = 1\nrobot = \"mbbr\"\nwheels = 3\n"), "accepted");
}

}  // namespace
}  // namespace equipoise::app
