// No bytes on the serial line or the CAN bus that were not signed are ever a command.
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "equipoise/runtime/command_auth.hpp"
#include "equipoise/runtime/frames.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static equipoise::runtime::CommandGate gate(equipoise::runtime::CommandKey({1, 2, 3}));
  equipoise::runtime::FrameReader reader;
  reader.push(data, size, [](const std::uint8_t* message, std::size_t length) {
    equipoise::signed_command_t command;
    equipoise::Command out;
    const int whole = static_cast<int>(length);
    if (command.decode(message, 0, whole) == whole && gate.accept(command, &out)) std::abort();
  });
  return 0;
}
