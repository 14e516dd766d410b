#include "app/run/wires.hpp"

#include <algorithm>
#include <array>
#include <cstring>

#include "app/cli/commands.hpp"
#include "can.h"
#include "serial.h"

namespace equipoise::app {
namespace {

using runtime::WireSide;

constexpr std::uint32_t kCommandId = 0x1E1;  // towards the robot
constexpr std::uint32_t kSessionId = 0x1E2;  // from it

class SerialStream final : public runtime::ByteStream {
 public:
  SerialStream(const std::string& device, std::uint32_t baud) : baud_(baud) {
    const int status = serial_open(&serial_, device.c_str(), baud);
    if (status == -EINVAL) throw InputError("serial: " + std::to_string(baud) + " baud: 1200 to 115200");
    if (status < 0) throw std::runtime_error("serial: " + device + ": " + std::strerror(-status));
  }
  ~SerialStream() override { serial_close(&serial_); }
  std::size_t read(std::uint8_t* out, std::size_t size) override {
    return static_cast<std::size_t>(std::max(serial_read(&serial_, out, size), 0));
  }
  std::size_t write(const std::uint8_t* data, std::size_t size) override {
    return static_cast<std::size_t>(std::max(serial_write(&serial_, data, size), 0));
  }
  double bytes_per_s() const override { return baud_ / 10.0; }  // 8N1

 private:
  serial_t serial_{};
  std::uint32_t baud_;
};

/// Up to eight bytes of the stream per data frame.
class CanStream final : public runtime::ByteStream {
 public:
  CanStream(const std::string& interface, WireSide side)
      : heard_(side == WireSide::kRobot ? kCommandId : kSessionId),
        said_(side == WireSide::kRobot ? kSessionId : kCommandId) {
    const int status = can_open(&port_, interface.c_str());
    if (status < 0)
      throw std::runtime_error("can: " + interface + ": " + std::strerror(-status) + " (ip link set " +
                               interface + " up type can bitrate 500000)");
  }
  ~CanStream() override { can_close(&port_); }
  std::size_t read(std::uint8_t* out, std::size_t size) override {
    can_frame frame{};
    std::size_t count = 0;
    while (count + CAN_MAX_DLEN <= size && can_receive(&port_, &frame) == 0) {
      if (frame.can_id != heard_) continue;  // others', remote frames
      std::copy(frame.data, frame.data + frame.can_dlc, out + count);
      count += frame.can_dlc;
    }
    return count;
  }
  std::size_t write(const std::uint8_t* data, std::size_t size) override {
    can_frame frame{};
    frame.can_id = said_;
    frame.can_dlc = static_cast<std::uint8_t>(std::min<std::size_t>(size, CAN_MAX_DLEN));
    std::copy(data, data + frame.can_dlc, frame.data);
    return can_send(&port_, &frame) == 0 ? frame.can_dlc : 0;
  }
  double bytes_per_s() const override { return 10000.0; }  // 250 kbit/s, half of it ours

 private:
  can_port_t port_{};
  std::uint32_t heard_;
  std::uint32_t said_;
};

std::unique_ptr<runtime::ByteStream> open_serial(const std::string& name) {
  const std::size_t colon = name.rfind(':');
  const std::string baud = colon == std::string::npos ? "" : name.substr(colon + 1);
  const bool number = !baud.empty() && baud.size() < 8 &&
                      std::all_of(baud.begin(), baud.end(), [](char c) { return c >= '0' && c <= '9'; });
  if (!number || colon == 0) throw InputError("serial:" + name + ": expected serial:DEVICE:BAUD");
  return std::make_unique<SerialStream>(name.substr(0, colon), static_cast<std::uint32_t>(std::stoul(baud)));
}

}  // namespace

std::unique_ptr<runtime::CommandWire> open_wire(const std::string& name, WireSide side) {
  if (name.rfind("serial:", 0) == 0)
    return std::make_unique<runtime::StreamWire>(open_serial(name.substr(7)));
  if (name.rfind("can:", 0) == 0)
    return std::make_unique<runtime::StreamWire>(std::make_unique<CanStream>(name.substr(4), side));
  return runtime::open_lcm_wire(name, side);
}

}  // namespace equipoise::app
