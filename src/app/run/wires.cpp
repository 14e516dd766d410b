#include "app/run/wires.hpp"

#include <algorithm>
#include <cstring>

#include "app/run/can_wire.hpp"
#include "app/text/errors.hpp"
#include "can.h"
#include "serial.h"

namespace equipoise::app {
namespace {

using runtime::WireSide;

class SerialStream final : public runtime::ByteStream {
 public:
  SerialStream(const std::string& device, std::uint32_t baud) : baud_(baud) {
    const int status = serial_open(&serial_, device.c_str(), baud);
    if (status == -EINVAL) throw InputError("serial: " + std::to_string(baud) + " baud: 1200 to 115200");
    if (status < 0)
      throw std::runtime_error("serial: " + device + ": " + std::strerror(-status) +
                               "; serial:DEVICE:BAUD takes the port's path (/dev/rfcomm0)");
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

class SocketCanBus final : public CanBus {
 public:
  explicit SocketCanBus(const std::string& interface) {
    const int status = can_open(&port_, interface.c_str());
    if (status < 0)
      throw std::runtime_error("can: " + interface + ": " + std::strerror(-status) + " (ip link set " +
                               interface + " up type can bitrate 500000)");
  }
  ~SocketCanBus() override { can_close(&port_); }
  bool receive(can_frame* out) override { return can_receive(&port_, out) == 0; }
  bool send(const can_frame& frame) override { return can_send(&port_, &frame) == 0; }

 private:
  can_port_t port_{};
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
    return std::make_unique<CanWire>(std::make_unique<SocketCanBus>(name.substr(4)), side);
  return runtime::open_lcm_wire(name, side);
}

}  // namespace equipoise::app
