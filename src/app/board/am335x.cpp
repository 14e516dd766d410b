#include "app/board/am335x.hpp"

#include <array>

namespace equipoise::app {
namespace {

struct GpioPad {
  const char* chip;
  std::uint32_t line;
  const char* pin;
  std::uint32_t offset;
};

constexpr const char* kGpio0 = "44e07000";
constexpr const char* kGpio1 = "4804c000";
constexpr const char* kGpio2 = "481ac000";
constexpr const char* kGpio3 = "481ae000";

// Lines of the robots' headers and their neighbours; a pad that no header has goes by its ball's name.
constexpr std::array<GpioPad, 33> kGpioPads{{
    {kGpio0, 10, "P8.31", 0x8d8}, {kGpio0, 11, "P8.32", 0x8dc}, {kGpio2, 0, "gpmc_csn3", 0x888},
    {kGpio0, 20, "P9.41", 0x9b4}, {kGpio0, 22, "P8.19", 0x820}, {kGpio0, 23, "P8.13", 0x824},
    {kGpio0, 26, "P8.14", 0x828}, {kGpio0, 27, "P8.17", 0x82c}, {kGpio0, 30, "P9.11", 0x870},
    {kGpio0, 31, "P9.13", 0x874}, {kGpio1, 12, "P8.12", 0x830}, {kGpio1, 13, "P8.11", 0x834},
    {kGpio1, 16, "P9.15", 0x840}, {kGpio1, 17, "P9.23", 0x844}, {kGpio1, 18, "P9.14", 0x848},
    {kGpio1, 19, "P9.16", 0x84c}, {kGpio1, 28, "P9.12", 0x878}, {kGpio1, 29, "P8.26", 0x87c},
    {kGpio2, 1, "P8.18", 0x88c},  {kGpio2, 2, "P8.7", 0x890},   {kGpio2, 3, "P8.8", 0x894},
    {kGpio2, 4, "P8.10", 0x898},  {kGpio2, 5, "P8.9", 0x89c},   {kGpio2, 6, "P8.45", 0x8a0},
    {kGpio2, 7, "P8.46", 0x8a4},  {kGpio2, 8, "P8.43", 0x8a8},  {kGpio2, 9, "P8.44", 0x8ac},
    {kGpio2, 17, "P8.34", 0x8cc}, {kGpio3, 15, "P9.29", 0x994}, {kGpio3, 16, "P9.30", 0x998},
    {kGpio3, 17, "P9.28", 0x99c}, {kGpio3, 19, "P9.27", 0x9a4}, {kGpio3, 21, "P9.25", 0x9ac},
}};

}  // namespace

std::vector<Pad> pads_of_pwm(const std::string& device, std::uint32_t channel) {
  if (device == "48302200") return {channel == 0 ? Pad{"P9.14", 0x848, 6} : Pad{"P9.16", 0x84c, 6}};
  if (device == "48304200") return {channel == 0 ? Pad{"P8.19", 0x820, 4} : Pad{"P8.13", 0x824, 4}};
  return {};
}

std::vector<Pad> pads_of_encoder(const std::string& device) {
  if (device == "48300180") return {{"P9.42", 0x9a0, 1, true}, {"P9.27", 0x9a4, 1, true}};
  if (device == "48302180") return {{"P8.35", 0x8d0, 2, true}, {"P8.33", 0x8d4, 2, true}};
  if (device == "48304180") return {{"P8.12", 0x830, 4, true}, {"P8.11", 0x834, 4, true}};
  return {};
}

std::vector<Pad> pads_of_port(const std::string& port, bool blue) {
  if (port == "/dev/i2c-2") return {{"P9.20", 0x978, 3, true}, {"P9.19", 0x97c, 3, true}};
  if (port == "48022000") return {{"P9.26", 0x980, 0, true}, {"P9.24", 0x984, 0}};
  if (port == "481a8000") return {{"P9.11", 0x870, 6, true}};  // its transmitter is another robot's business
  if (port == "481aa000") return {{"P8.37", 0x8c0, 4}, {"P8.38", 0x8c4, 4, true}};
  if (port == "481d0000" && blue) return {{"uart0_ctsn", 0x968, 2}, {"uart0_rtsn", 0x96c, 2, true}};
  if (port == "481d0000") return {{"P9.26", 0x980, 2}, {"P9.24", 0x984, 2, true}};
  return {};
}

std::vector<Pad> pads_of_gpio(const std::string& chip, std::uint32_t line, bool input) {
  for (const GpioPad& pad : kGpioPads) {
    if (chip == pad.chip && line == pad.line) return {{pad.pin, pad.offset, kPadGpio, input}};
  }
  return {};
}

}  // namespace equipoise::app
