// No bytes on the serial line or the CAN bus that were not signed are ever a command.
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "equipoise/runtime/command_auth.hpp"
#include "equipoise/runtime/frames.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace equipoise::runtime;
  static CommandGate gate(CommandKeys::of_robot("robot", CommandKey({1, 2, 3})), 500);
  FrameReader reader;
  reader.push(data, size, [](const std::uint8_t* message, std::size_t length) {
    equipoise::signed_command_t command;
    const int whole = static_cast<int>(length);
    if (command.decode(message, 0, whole) == whole &&
        gate.accept(command, 0) != CommandGate::Verdict::kRefused)
      std::abort();
  });
  return 0;
}
