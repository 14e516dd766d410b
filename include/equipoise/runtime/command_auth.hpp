// Who may command the robot: whoever holds the pre-shared key. Without clocks: the receiver's random session
// makes recordings of earlier runs worthless, the growing sequence those of this one.
// In: key file, signed_command_t -> out: Command, or refused. libsodium crypto_auth. Not for the tick.
#pragma once

#include <array>
#include <cstdint>
#include <string>

#include "equipoise/command_session_t.hpp"
#include "equipoise/samples.hpp"
#include "equipoise/signed_command_t.hpp"

namespace equipoise::runtime {

class CommandKey {
 public:
  static constexpr std::size_t kBytes = 32;

  /// Throws std::runtime_error, with the fix: unreadable, readable by others, not ours, not a key.
  static CommandKey load(const std::string& path);
  /// New random key in a new file of its owner's; throws if the file exists.
  static void create(const std::string& path);
  explicit CommandKey(const std::array<std::uint8_t, kBytes>& bytes) : bytes_(bytes) {}
  ~CommandKey();
  CommandKey(const CommandKey&) = default;
  CommandKey& operator=(const CommandKey&) = default;

  void sign(signed_command_t* message) const;
  bool signed_by_it(const signed_command_t& message) const;

 private:
  std::array<std::uint8_t, kBytes> bytes_;
};

class CommandGate {
 public:
  explicit CommandGate(const CommandKey& key);

  /// False: forged, replayed, of another session, or not finite.
  bool accept(const signed_command_t& message, Command* out);
  command_session_t session() const { return session_; }

 private:
  CommandKey key_;
  command_session_t session_{};
};

}  // namespace equipoise::runtime
