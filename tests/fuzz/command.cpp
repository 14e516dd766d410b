// No bytes that were not signed are ever a command.
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "equipoise/runtime/command_auth.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace equipoise::runtime;
  static CommandGate gate(CommandKeys::of_robot("robot", CommandKey({1, 2, 3})), 500);
  equipoise::signed_command_t message;
  const auto length = static_cast<int>(size);
  if (message.decode(data, 0, length) == length && gate.accept(message, 0) != CommandGate::Verdict::kRefused)
    std::abort();
  return 0;
}
