#include "closed_loop.hpp"

#include <unistd.h>

#include <cmath>

using equipoise::MotorCommand;
using equipoise::RawSample;

namespace {
constexpr int kMotors = 3;
constexpr int kPoll_us = 200;
constexpr int kPatiencePolls = 5000;

equipoise::MbbrWorldParams worldOf(const equipoise::MbbrConfig& config, std::uint64_t seed) {
  equipoise::MbbrWorldParams params = config.world[static_cast<std::size_t>(equipoise::Fidelity::kFull)];
  params.common.seed = seed;
  return params;
}
}  // namespace

PinWorld::PinWorld(Bench& bench, const equipoise::MbbrConfig& config, std::uint64_t seed,
                   const std::atomic<std::uint32_t>& firmware_ticks)
    : bench_(bench),
      firmware_ticks_(firmware_ticks),
      world_(config.robot, config.motor, config.calibration, worldOf(config, seed)) {
  show(world_.sense());
}

MotorCommand PinWorld::pins() const {
  MotorCommand command;
  const auto channels = bench_.pwm();
  const std::size_t channel_of[kMotors] = {0, 1, 2};
  command.enable = bench_.pin(board_.enable.chip, board_.enable.line);
  for (int i = 0; i < kMotors; ++i) {
    const Bench::Channel& channel = channels[channel_of[i]];
    const bool in1 = bench_.pin(board_.motor[i].in1.chip, board_.motor[i].in1.line);
    const bool in2 = bench_.pin(board_.motor[i].in2.chip, board_.motor[i].in2.line);
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
  return !bench_.pin(board_.enable.chip, board_.enable.line);
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
  bench_.setAdc(board_.battery_channel, static_cast<uint32_t>(std::lround(raw.battery_counts)));
}

bool PinWorld::tick(bool data_ready) {
  world_.advance(pins());
  show(world_.sense());
  const std::uint32_t before = firmware_ticks_;
  if (data_ready) bench_.dataReady();
  for (int poll = 0; poll < kPatiencePolls; ++poll) {
    if (firmware_ticks_ != before) return true;
    usleep(kPoll_us);
  }
  return false;
}
