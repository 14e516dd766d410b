// Any frame, error frames included, leaves the port in one of its four states.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include "can.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  can_port_t port{};
  port.fd = -1;
  for (; size >= sizeof(can_frame); data += sizeof(can_frame), size -= sizeof(can_frame)) {
    can_frame frame{};
    std::memcpy(&frame, data, sizeof frame);
    can_update_state(&port, &frame);
    if (port.state < CAN_BUS_ACTIVE || port.state > CAN_BUS_OFF) std::abort();
  }
  return 0;
}
