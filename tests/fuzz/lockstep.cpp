// Any packet is refused or becomes counts.
#include "app/io/lockstep.hpp"

#include <cstddef>
#include <cstdint>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  equipoise::lockstep_sensors_t sensors;
  if (equipoise::app::decode_lockstep_sensors(data, size, &sensors)) {
    const rio_sensors_t counts = equipoise::app::counts_of(sensors, equipoise::Calibration{});
    if ((counts.valid & RIO_IMU) == 0) __builtin_trap();
  }
  return 0;
}
