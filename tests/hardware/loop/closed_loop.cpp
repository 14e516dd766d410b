#include "closed_loop.hpp"

#include <cmath>
#include <cstring>
#include <equipoise/runtime/monotonic.hpp>

using equipoise::MotorCommand;
using equipoise::RawSample;

namespace {
constexpr int kMotors = 3;
constexpr std::int64_t kPeriod_ns = 5'000'000;

equipoise::MbbrWorldParams worldOf(const equipoise::MbbrConfig& config, std::uint64_t seed) {
  equipoise::MbbrWorldParams params = config.world[static_cast<std::size_t>(equipoise::Fidelity::kNominal)];
  params.common.seed = seed;
  return params;
}
}  // namespace

PinWorld::PinWorld(Bench& bench, const equipoise::app::Board& board, const equipoise::MbbrConfig& config,
                   std::uint64_t seed)
    : bench_(bench),
      wiring_(board.wiring),
      world_(config.robot, config.motor, config.calibration, worldOf(config, seed)) {
  for (const bbb_motor_t& motor : wiring_.motor) {
    if (motor.fault.used) bench_.drivePin(motor.fault.chip, motor.fault.line, true);  // no bridge complains
  }
  show(world_.sense());
}

MotorCommand PinWorld::pins() const {
  MotorCommand command{};
  const auto channels = bench_.pwm();
  command.enable = bench_.pin(wiring_.enable.chip, wiring_.enable.line);
  for (int i = 0; i < kMotors; ++i) {
    const std::size_t module = std::strcmp(wiring_.motor[i].pwm, "48302200") == 0 ? 0 : 2;
    const Bench::Channel& channel = channels[module + wiring_.motor[i].pwm_channel];
    const bool in1 = bench_.pin(wiring_.motor[i].in1.chip, wiring_.motor[i].in1.line);
    const bool in2 = bench_.pin(wiring_.motor[i].in2.chip, wiring_.motor[i].in2.line);
    const double direction = (in1 ? 1.0 : 0.0) - (in2 ? 1.0 : 0.0);
    const double on = channel.enabled == 0 ? 0.0 : static_cast<double>(channel.duty_ns);
    const double period = static_cast<double>(channel.period_ns);
    command.duty[static_cast<std::size_t>(i)] = period > 0.0 ? direction * on / period : 0.0;
  }
  return command;
}

bool PinWorld::motorsOff() const {
  for (const Bench::Channel& channel : bench_.pwm()) {
    if (channel.enabled != 0 && channel.duty_ns != 0) return false;
  }
  return !bench_.pin(wiring_.enable.chip, wiring_.enable.line);
}

void PinWorld::show(const RawSample& raw) {
  const auto counts = [](double value) {
    return static_cast<int16_t>(std::lround(std::fmin(std::fmax(value, -32768.0), 32767.0)));
  };
  std::array<int16_t, 3> accel{};
  std::array<int16_t, 3> gyro{};
  std::array<int64_t, 3> wheels{};
  for (std::size_t i = 0; i < 3; ++i) {
    accel[i] = counts(raw.accel_counts[i]);
    gyro[i] = counts(raw.gyro_counts[i]);
    wheels[i] = std::llround(raw.encoder_counts[i]);
  }
  bench_.setImu(accel, gyro);
  bench_.setCounts(wheels);
  bench_.setAdc(wiring_.battery_channel, static_cast<uint32_t>(std::lround(raw.battery_counts)));
}

void PinWorld::tick(bool data_ready) {
  const std::int64_t now_ns = equipoise::runtime::monotonic_now_ns();
  if (due_ns_ == 0) due_ns_ = now_ns;
  due_ns_ += kPeriod_ns;
  if (now_ns > due_ns_) {
    ++late_;
    due_ns_ = now_ns;
  }
  equipoise::runtime::sleep_until(due_ns_);
  world_.advance(pins());
  show(world_.sense());
  if (data_ready) bench_.dataReady();
}
