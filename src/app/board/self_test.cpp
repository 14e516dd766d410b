#include "app/board/self_test.hpp"

#include <cmath>
#include <cstring>

namespace equipoise::app {
namespace {

constexpr int kTicks = 40;

std::string imu_complaint(std::uint32_t health) {
  if ((health & RIO_IMU_LATE) != 0)
    return "the IMU's samples do not come; check [imu] interrupt, with IIO its trigger";
  if ((health & RIO_IMU_BUS_ERROR) != 0)
    return "the IMU does not answer; check [imu] bus and address, with IIO dmesg";
  if ((health & RIO_IMU_STUCK) != 0) return "the IMU repeats one sample; power-cycle it";
  return "the IMU delivers no valid sample";
}

}  // namespace

std::string self_test(const rio_t& io) {
  int imu = 0;
  int encoders = 0;
  int battery = 0;
  double force = 0.0;
  std::uint32_t health = 0;
  if (rio_motors_off(&io) != 0) return "the bridges cannot be switched off; check [bridges] and [[motor]]";
  for (int i = 0; i < kTicks; ++i) {
    std::int64_t now_ns = 0;
    rio_sensors_t s{};
    int status = rio_wait_tick(&io, &now_ns);
    if (status == 0) status = rio_read_sensors(&io, &s);
    if (status != 0) return std::string("no tick: ") + std::strerror(-status);
    health |= s.health;
    imu += (s.valid & RIO_IMU) != 0 ? 1 : 0;
    encoders += (s.valid & RIO_ENCODERS) != 0 ? 1 : 0;
    battery += (s.valid & RIO_BATTERY) != 0 ? 1 : 0;
    if ((s.valid & RIO_IMU) != 0) force = std::hypot(s.accel_counts[0], s.accel_counts[1], s.accel_counts[2]);
  }
  if (imu < kTicks - kMayMiss) return imu_complaint(health);
  if (encoders < kTicks) return "an encoder cannot be read; check [[motor]] encoder";
  if (battery < kTicks) return "the battery voltage cannot be read; check [battery]";
  // 4096 counts per g at the boundary: held by hand or on its stand, the robot feels about one g.
  if (force < 0.5 * 4096.0 || force > 2.0 * 4096.0)
    return "the accelerometer does not measure gravity; check [imu] accel_range_g and the mounting";
  return "";
}

}  // namespace equipoise::app
