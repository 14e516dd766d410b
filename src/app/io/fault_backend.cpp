#include "app/io/fault_backend.hpp"

#include <algorithm>
#include <cmath>

namespace equipoise::app {

int FaultBackend::stall(int ticks, std::int64_t* now_ns) {
  for (int i = 1; i <= ticks; ++i) {
    if (i == kGuardTicks) (void)rio_motors_off(&inner_);  // the guard's part
    const int status = rio_wait_tick(&inner_, now_ns);
    if (status != 0) return status;
  }
  return 0;
}

int FaultBackend::wait_tick(void* p, std::int64_t* now_ns) {
  FaultBackend& b = self(p);
  int status = rio_wait_tick(&b.inner_, now_ns);
  if (b.left_ > 0 && b.age_ > 0) --b.left_;
  ++b.age_;
  b.log_failed_ = b.is(FaultKind::kLogFull);
  if (status == 0 && b.first(FaultKind::kStall20ms)) status = b.stall(4, now_ns);
  if (status == 0 && b.first(FaultKind::kStall50ms)) status = b.stall(10, now_ns);
  if (status == 0 && b.first(FaultKind::kStall1ms)) *now_ns += 1'000'000;
  if (status == 0 && b.first(FaultKind::kBusHang)) status = b.stall(12, now_ns);
  return status;
}

void FaultBackend::spoil(rio_sensors_t* s) {
  const auto gaussian = [this](double sigma) {
    return std::normal_distribution<double>(0.0, sigma)(engine_);
  };
  constexpr double kCountsPerRad_s = 16.4 * 180.0 / 3.14159265358979323846;
  switch (kind_) {
    case FaultKind::kImuOff:
      s->valid &= ~static_cast<unsigned>(RIO_IMU);
      std::fill(std::begin(s->gyro_counts), std::end(s->gyro_counts), 0.0);
      std::fill(std::begin(s->accel_counts), std::end(s->accel_counts), 0.0);
      break;
    case FaultKind::kImuStuck:
      std::copy(std::begin(frozen_.gyro_counts), std::end(frozen_.gyro_counts), s->gyro_counts);
      std::copy(std::begin(frozen_.accel_counts), std::end(frozen_.accel_counts), s->accel_counts);
      break;
    case FaultKind::kNoiseBurst:
      for (double& g : s->gyro_counts) g += gaussian(20.0 * 16.4);
      for (double& a : s->accel_counts) a += gaussian(0.5 * 4096.0);
      break;
    case FaultKind::kNotANumber:
      s->gyro_counts[1] = NAN;
      break;
    case FaultKind::kBiasJump:
      for (double& g : s->gyro_counts) g += 0.2 * kCountsPerRad_s;
      break;
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
    case FaultKind::kEncoderReversal:
      s->encoder_counts[0] = 2.0 * encoder_at_start_[0] - s->encoder_counts[0];
      break;
    case FaultKind::kCountJump:
      s->encoder_counts[1] += 500.0;
      break;
    case FaultKind::kWheelLoss:
      s->encoder_counts[0] = encoder_at_start_[0];
      break;
    case FaultKind::kBatterySag:
      s->battery_counts *= 5.0 / 8.0;
      break;
    case FaultKind::kAdcOpen:
      s->battery_counts = 0.0;
      break;
    default:
      break;  // not of the sensors
  }
}

int FaultBackend::read_sensors(void* p, rio_sensors_t* out) {
  FaultBackend& b = self(p);
  const int status = rio_read_sensors(&b.inner_, out);
  if (status != 0) return status;
  if (b.first(FaultKind::kClockJump)) b.clock_offset_ns_ += kClockJump_ns;
  out->t_ns += b.clock_offset_ns_;
  for (std::size_t i = b.history_.size() - 1; i > 0; --i) b.history_[i] = b.history_[i - 1];
  b.history_[0] = *out;
  if (b.left_ <= 0) {
    b.frozen_ = *out;
    std::copy(std::begin(out->encoder_counts), std::end(out->encoder_counts), b.encoder_at_start_.begin());
  } else {
    b.spoil(out);
  }
  return 0;
}

}  // namespace equipoise::app
