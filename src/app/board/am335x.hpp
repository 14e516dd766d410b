// The AM335x's pads as the BeagleBone Black brings them out: which pad control register selects the function
// that a board file asks for. In: device and channel, or gpio line -> out: header pin, register, mode.
// Source: TI SPRS717 table 4-1 (pin attributes), SPRUH73 table 9-7 (control module). Facts of the chip, not
// wiring. Start-up only.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace equipoise::app {

struct Pad {
  std::string pin;       // "P9.14"
  std::uint32_t offset;  // of conf_*, in the control module at 44e10000
  std::uint32_t mode;    // bits 2..0
  bool input = false;    // the receiver must be on, bit 5
};

constexpr std::uint32_t kPadGpio = 7;
constexpr std::uint32_t kPadReceiver = 1U << 5;

/// Pads of an EHRPWM channel ("48302200", 0), an eQEP ("48300180"), a bus ("/dev/i2c-2"), a UART or CAN
/// controller ("48022000", "481d0000"; the BeagleBone Blue's CAN is on other pads); empty: not known.
std::vector<Pad> pads_of_pwm(const std::string& device, std::uint32_t channel);
std::vector<Pad> pads_of_encoder(const std::string& device);
std::vector<Pad> pads_of_port(const std::string& port, bool blue = false);
/// Pad of gpio line `line` of the chip at this address; empty: not on a header.
std::vector<Pad> pads_of_gpio(const std::string& chip, std::uint32_t line, bool input);

}  // namespace equipoise::app
