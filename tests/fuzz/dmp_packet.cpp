// Any packet is refused or holds a unit quaternion.
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "dmp.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  dmp_packet_t packet;
  if (dmp_parse(data, size, &packet) != 0) return 0;
  double squared = 0.0;
  for (const double q : packet.attitude_wxyz) squared += q * q;
  if (!(std::abs(squared - 1.0) < 0.1)) std::abort();
  return 0;
}
