#include "closed_loop.hpp"

#include <cmath>
#include <equipoise/runtime/monotonic.hpp>
#include <fstream>
#include <regex>
#include <sstream>

#include "app/board/board.hpp"
#include "equipoise/imu_parts.h"
#include "robots/robot_list.hpp"
#include "support/pin.hpp"

using equipoise::MotorCommand;
using equipoise::RawSample;

namespace {
constexpr std::int64_t kPeriod_ns = 5'000'000;
constexpr const char *kGpio0 = "44e07000", *kGpio1 = "4804c000", *kGpio2 = "481ac000", *kGpio3 = "481ae000";
constexpr std::size_t kPwm1A = 0, kPwm1B = 1, kPwm2A = 2;

std::string text_of(const std::string& path) {
  std::ostringstream text;
  text << std::ifstream(path).rdbuf();
  return text.str();
}

// The robot's files with an IMU that the kernel serves, at 200 Hz or the next rate that its driver has.
void serve_by_kernel(PinRobot* robot) {
  const std::string name = robot->imu_driver.substr(robot->imu_driver.find(':') + 1);  // without the bus
  int part = 0;
  while (imu_part(part)->name != name) ++part;
  int setting = 0;
  for (int i = 1; i <= IMU_LOW_PASS_MAX; ++i) {
    const int rate_hz = imu_low_pass(part, i)->rate_hz;
    if (rate_hz >= 200 && (setting == 0 || rate_hz < imu_low_pass(part, setting)->rate_hz)) setting = i;
  }
  const std::regex ours("\n(bus|address|interrupt|interrupt_active_low|dmp_firmware|low_pass) =[^\n]*");
  const std::string imu =
      "[imu]\ndriver = \"iio\"\npart = \"" + name + "\"\nlow_pass = " + std::to_string(setting);
  const std::string board = std::regex_replace(text_of(robot->board), ours, "");
  robot->board = "/tmp/board.toml";
  std::ofstream(robot->board) << std::regex_replace(board, std::regex("\\[imu\\][^\n]*"), imu);
  std::string config = text_of(robot->config);
  const auto set = [&config](const std::string& key, double value) {
    config = std::regex_replace(config, std::regex("\n" + key + " = [^ \n]*"),
                                "\n" + key + " = " + std::to_string(value));
  };
  set("gyro_delay_s", imu_low_pass(part, setting)->gyro_delay_s);
  set("accel_delay_s", imu_low_pass(part, setting)->accel_delay_s);
  robot->config = "/tmp/config.toml";
  std::ofstream(robot->config) << config;
}
}  // namespace

PinRobot PinRobot::mbbr() {
  return {"Mbbr",
          "/mnt/config/mbbr.toml",
          "/mnt/config/boards/robotics_cape_mbbr.toml",
          {{kPwm1A, pin_of(kGpio1, 28), pin_of(kGpio0, 31), +1, 0, +1},
           {kPwm1B, pin_of(kGpio1, 16), pin_of(kGpio2, 17), +1, 1, +1},
           {kPwm2A, pin_of(kGpio2, 9), pin_of(kGpio2, 8), +1, 2, +1}},
          {pin_of(kGpio1, 17), pin_of(kGpio3, 17), pin_of(kGpio3, 16)}};
}

PinRobot PinRobot::mbbr_mpu6500() {
  PinRobot robot = mbbr();
  robot.name = "MbbrMpu6500";
  robot.imu_driver = "mpu6500";
  return robot;
}

PinRobot PinRobot::mbbr_mpu6500_on_spi() {
  PinRobot robot = mbbr();
  robot.name = "MbbrMpu6500OnSpi";
  robot.imu_driver = "spi:mpu6500";
  return robot;
}

PinRobot PinRobot::mbbr_lsm6dso() {
  PinRobot robot = mbbr();
  robot.name = "MbbrLsm6dso";
  robot.imu_driver = "lsm6dso";
  robot.own_pace = true;
  return robot;
}

PinRobot PinRobot::edumip() {
  return {"Edumip",
          "/mnt/config/edumip.toml",
          "/mnt/config/boards/robotics_cape_edumip.toml",
          {{kPwm1B, pin_of(kGpio1, 16), pin_of(kGpio2, 17), +1, 1, -1},
           {kPwm2A, pin_of(kGpio2, 9), pin_of(kGpio2, 8), -1, 2, +1}},
          {}};
}

PinRobot PinRobot::edumip_blue() {
  PinRobot robot = edumip();
  robot.name = "EdumipBlue";
  robot.board = "/mnt/config/boards/beaglebone_blue_edumip.toml";
  robot.wheels[0].in2 = pin_of(kGpio0, 10);
  return robot;
}

struct PinWorld::World {
  virtual ~World() = default;
  virtual void advance(const MotorCommand& command) = 0;
  virtual RawSample sense() = 0;
  virtual double tilt_rad() const = 0;
  virtual bool held() const = 0;
};

template <class Firmware>
struct PinWorld::WorldOf final : PinWorld::World {
  // With the delays of the chip's filter, which the firmware on the board counts on.
  WorldOf(const typename Firmware::Config& config, std::uint64_t seed)
      : world(Firmware::world(config, static_cast<std::size_t>(equipoise::Fidelity::kBuilt2025), seed)) {}
  void advance(const MotorCommand& command) override { world.advance(command); }
  RawSample sense() override { return world.sense(); }
  double tilt_rad() const override {
    return view(world.truth(), world.robot()).theta_rad.template head<2>().norm();
  }
  bool held() const override { return world.held(); }

  typename Firmware::World world;
};

PinWorld::PinWorld(Bench& bench, const PinRobot& robot, std::uint64_t seed) : bench_(bench), robot_(robot) {
  if (!robot_.imu_driver.empty()) {
    serve_by_kernel(&robot_);
    bench_.serveImu(robot_.imu_driver);
  }
  const equipoise::app::Board board = equipoise::app::load_board(robot_.board);
  battery_channel_ = board.wiring.battery_channel;
  world_ = equipoise::with_robot(board.robot, robot_.board, [&](auto firmware) -> std::unique_ptr<World> {
    using Firmware = decltype(firmware);
    const auto config = Firmware::load(robot_.config, equipoise::app::overrides_of(board)).config;
    safety_ = config.safety;
    return std::make_unique<WorldOf<Firmware>>(config, seed);
  });
  for (const bbb_pin_t& line : robot_.complaints) bench_.drivePin(line.chip, line.line, true);
  show(world_->sense());
}

PinWorld::~PinWorld() = default;

double PinWorld::tilt_rad() const { return world_->tilt_rad(); }
bool PinWorld::held() const { return world_->held(); }

MotorCommand PinWorld::pins() const {
  MotorCommand command{};
  const auto channels = bench_.pwm();
  command.enable = bench_.pin(kGpio0, 20);
  for (std::size_t i = 0; i < robot_.wheels.size(); ++i) {
    const PinWheel& wheel = robot_.wheels[i];
    const Bench::Channel& channel = channels[wheel.channel];
    const int in1 = bench_.pin(wheel.in1.chip, wheel.in1.line) ? 1 : 0;
    const int in2 = bench_.pin(wheel.in2.chip, wheel.in2.line) ? 1 : 0;
    const double on = channel.enabled == 0 ? 0.0 : static_cast<double>(channel.duty_ns);
    const double period = static_cast<double>(channel.period_ns);
    command.duty[i] = period > 0.0 ? wheel.turns * (in1 - in2) * on / period : 0.0;
  }
  return command;
}

bool PinWorld::motorsOff() const {
  for (const Bench::Channel& channel : bench_.pwm()) {
    if (channel.enabled != 0 && channel.duty_ns != 0) return false;
  }
  return !bench_.pin(kGpio0, 20);
}

void PinWorld::show(const RawSample& raw) {
  const auto counts = [](double value) {
    return static_cast<int16_t>(std::lround(std::fmin(std::fmax(value, -32768.0), 32767.0)));
  };
  std::array<int16_t, 3> accel{};
  std::array<int16_t, 3> gyro{};
  std::array<int64_t, 3> decoders{};
  for (std::size_t i = 0; i < 3; ++i) {
    accel[i] = counts(raw.accel_counts[i]);
    gyro[i] = counts(raw.gyro_counts[i]);
  }
  for (std::size_t i = 0; i < robot_.wheels.size(); ++i) {
    const PinWheel& wheel = robot_.wheels[i];
    decoders[wheel.decoder] = wheel.counts * std::llround(raw.encoder_counts[i]);
  }
  bench_.setImu(accel, gyro);
  bench_.setCounts(decoders);
  bench_.setAdc(battery_channel_, static_cast<uint32_t>(std::lround(raw.battery_counts)));
}

void PinWorld::advance(bool data_ready) {
  const std::int64_t now_ns = equipoise::runtime::monotonic_now_ns();
  if (due_ns_ == 0) due_ns_ = now_ns;
  due_ns_ += kPeriod_ns;
  if (now_ns > due_ns_) {
    ++late_;
    due_ns_ = now_ns;
  }
  equipoise::runtime::sleep_until(due_ns_);
  world_->advance(pins());
  show(world_->sense());
  if (data_ready) bench_.dataReady();
}
