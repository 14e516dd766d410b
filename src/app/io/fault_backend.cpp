#include "app/io/fault_backend.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace equipoise::app {

int FaultBackend::stall(int ticks, std::int64_t* now_ns) {
  for (int i = 1; i <= ticks; ++i) {
    if (i == kGuardTicks) {  // the guard's part
      cut_ = true;
      (void)rio_motors_off(&inner_);
    }
    const int status = rio_wait_tick(&inner_, now_ns);
    if (status != 0) return status;
  }
  return 0;
}

int FaultBackend::wait_tick(std::int64_t* now_ns) {
  int status = rio_wait_tick(&inner_, now_ns);
  if (left_ > 0 && age_ > 0) --left_;
  ++age_;
  log_failed_ = is(FaultKind::kLogFull);
  if (status == 0 && first(FaultKind::kStall20ms)) status = stall(4, now_ns);
  if (status == 0 && first(FaultKind::kStall50ms)) status = stall(10, now_ns);
  if (status == 0 && first(FaultKind::kStall1ms)) *now_ns += 1'000'000;
  if (status == 0 && first(FaultKind::kBusHang)) status = stall(12, now_ns);
  return status;
}

int FaultBackend::write_motors(const rio_motors_t& motors) {
  if (cut_) return 0;  // the guard holds them
  // A bridge that does not obey keeps its last duty until the guard or the next try stops it.
  if (is(FaultKind::kWriteError)) return -EIO;
  rio_motors_t done = motors;
  if (is(FaultKind::kMotorDead)) done.duty[0] = 0.0;
  if (is(FaultKind::kMotorsSwapped)) std::swap(done.duty[0], done.duty[1]);
  if (is(FaultKind::kMotorStuck)) done.duty[0] = 0.6;
  return rio_write_motors(&inner_, &done);
}

void FaultBackend::spoil_gyro(rio_sensors_t* s) const {
  const auto since = [this](FaultKind first) {
    return static_cast<std::size_t>(kind_) - static_cast<std::size_t>(first);
  };
  double(&gyro)[3] = s->gyro_counts;
  if (kind_ >= FaultKind::kGyroXYSwapped) {
    const std::size_t axis = since(FaultKind::kGyroXYSwapped);
    std::swap(gyro[axis], gyro[(axis + 1) % 3]);
  } else if (kind_ >= FaultKind::kGyroXFlipped) {
    gyro[since(FaultKind::kGyroXFlipped)] *= -1.0;
  } else if (kind_ >= FaultKind::kGyroXZero) {
    gyro[since(FaultKind::kGyroXZero)] = 0.0;
  } else {
    const std::size_t axis = since(FaultKind::kGyroXFrozen);
    gyro[axis] = frozen_.gyro_counts[axis];
  }
}

void FaultBackend::spoil_imu(rio_sensors_t* s) {
  const auto gaussian = [this](double sigma) {
    return std::normal_distribution<double>(0.0, sigma)(engine_);
  };
  const auto uniform = [this](double limit) {
    return std::floor(std::uniform_real_distribution<double>(-limit, limit)(engine_));
  };
  constexpr double kCountsPerRad_s = 16.4 * 180.0 / 3.14159265358979323846;
  switch (kind_) {
    case FaultKind::kImuOff:
    case FaultKind::kImuGap:
    case FaultKind::kAllGap:
      s->valid &= ~static_cast<unsigned>(RIO_IMU);
      if (kind_ == FaultKind::kAllGap) s->valid = 0;
      std::fill(std::begin(s->gyro_counts), std::end(s->gyro_counts), 0.0);
      std::fill(std::begin(s->accel_counts), std::end(s->accel_counts), 0.0);
      break;
    case FaultKind::kImuStuck:
      std::copy(std::begin(frozen_.gyro_counts), std::end(frozen_.gyro_counts), s->gyro_counts);
      std::copy(std::begin(frozen_.accel_counts), std::end(frozen_.accel_counts), s->accel_counts);
      break;
    case FaultKind::kBadSamples:
      if (age_ % 10 != 1) break;
      for (double& g : s->gyro_counts) g = uniform(32767.0);
      for (double& a : s->accel_counts) a = uniform(32767.0);
      break;
    case FaultKind::kNoiseBurst:
      for (double& g : s->gyro_counts) g += gaussian(20.0 * 16.4);
      for (double& a : s->accel_counts) a += gaussian(0.5 * 4096.0);
      break;
    case FaultKind::kNotANumber:
      s->gyro_counts[1] = std::numeric_limits<double>::quiet_NaN();
      break;
    case FaultKind::kBiasJump:
      for (double& g : s->gyro_counts) g += 0.2 * kCountsPerRad_s;
      break;
    case FaultKind::kGyroRamp:
      for (double& g : s->gyro_counts) g += 0.2 * kCountsPerRad_s * 0.005 * age_;
      break;
    case FaultKind::kAccelFrozen:
      std::copy(std::begin(frozen_.accel_counts), std::end(frozen_.accel_counts), s->accel_counts);
      break;
    case FaultKind::kHalfRate:
      if (age_ % 2 == 0) break;
      std::copy(std::begin(history_[1].gyro_counts), std::end(history_[1].gyro_counts), s->gyro_counts);
      std::copy(std::begin(history_[1].accel_counts), std::end(history_[1].accel_counts), s->accel_counts);
      s->t_ns = history_[1].t_ns;
      break;
    case FaultKind::kNack:
    case FaultKind::kBusHang:
      s->valid &= ~static_cast<unsigned>(RIO_IMU | RIO_ATTITUDE);
      s->health |= RIO_IMU_BUS_ERROR;
      break;
    case FaultKind::kLostInterrupt:
      s->valid &= ~static_cast<unsigned>(RIO_IMU | RIO_ATTITUDE);
      s->health |= RIO_IMU_LATE;
      s->t_ns = frozen_.t_ns;
      break;
    default:
      if (kind_ >= FaultKind::kGyroXFrozen && kind_ <= FaultKind::kGyroZXSwapped) spoil_gyro(s);
      break;
  }
}

void FaultBackend::spoil(rio_sensors_t* s) {
  const auto three_of_ten = [this] { return engine_() % 10 < 3; };
  spoil_imu(s);
  switch (kind_) {
    case FaultKind::kDelayed:
      *s = history_[3];
      break;
    case FaultKind::kDuplicated:
      *s = frozen_;
      break;
    case FaultKind::kTornPacket:
      s->valid &= ~static_cast<unsigned>(RIO_ATTITUDE);
      s->health |= RIO_DMP_BAD_PACKET;
      break;
    case FaultKind::kFifoOverflow:
      s->valid &= ~static_cast<unsigned>(RIO_ATTITUDE);
      s->health |= RIO_DMP_OVERFLOW;
      break;
    case FaultKind::kEncoderReversal:
      s->encoder_counts[0] = 2.0 * encoder_at_start_[0] - s->encoder_counts[0];
      break;
    case FaultKind::kCountJump:
      s->encoder_counts[1] += 500.0;
      break;
    case FaultKind::kTwoEncodersDead:
      s->encoder_counts[1] = encoder_at_start_[1];
      s->encoder_counts[0] = encoder_at_start_[0];
      break;
    case FaultKind::kWheelLoss:
      s->encoder_counts[0] = encoder_at_start_[0];
      break;
    case FaultKind::kEncoderDead:
      s->encoder_counts[0] = 0.0;
      break;
    case FaultKind::kEncoderErrors:
      if (!three_of_ten()) break;
      s->valid &= ~static_cast<unsigned>(RIO_ENCODERS);
      s->health |= RIO_ENCODER_ERROR;
      std::fill(std::begin(s->encoder_counts), std::end(s->encoder_counts), 0.0);
      break;
    case FaultKind::kBatterySag:
      s->battery_counts *= 5.0 / 8.0;
      break;
    case FaultKind::kBatteryFlicker:
      if (three_of_ten()) s->battery_counts = 0.0;
      break;
    case FaultKind::kAdcOpen:
      s->battery_counts = 0.0;
      break;
    default:
      break;  // of the IMU, or not of the sensors
  }
}

int FaultBackend::read_sensors(rio_sensors_t* out) {
  const int status = rio_read_sensors(&inner_, out);
  if (status != 0) return status;
  if (first(FaultKind::kClockJump)) clock_offset_ns_ += kClockJump_ns;
  out->t_ns += clock_offset_ns_;
  for (std::size_t i = history_.size() - 1; i > 0; --i) history_[i] = history_[i - 1];
  history_[0] = *out;
  if (left_ <= 0) {
    frozen_ = *out;
    std::copy(std::begin(out->encoder_counts), std::end(out->encoder_counts), encoder_at_start_.begin());
  } else {
    spoil(out);
  }
  return 0;
}

}  // namespace equipoise::app
