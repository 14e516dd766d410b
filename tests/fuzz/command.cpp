// No bytes that were not signed are ever a command.
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "equipoise/runtime/command_auth.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static equipoise::runtime::CommandGate gate(equipoise::runtime::CommandKey({1, 2, 3}));
  equipoise::signed_command_t message;
  const auto length = static_cast<int>(size);
  equipoise::Command command;
  if (message.decode(data, 0, length) == length && gate.accept(message, &command)) std::abort();
  return 0;
}
