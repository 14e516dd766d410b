// Keys of the command protocol (docs/commands.md). A robot's file holds its name and one secret; keys of its
// holders and of its announcements are derived from that, so that a holder cannot speak for another.
// In: key file -> out: keys by purpose; runtime_error with the fix. libsodium. Not for the tick.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace equipoise::runtime {

/// A secret, wiped from memory at its end.
class CommandKey {
 public:
  static constexpr std::size_t kBytes = 32;
  static constexpr std::size_t kMacBytes = 16;
  using Bytes = std::array<std::uint8_t, kBytes>;

  explicit CommandKey(const Bytes& bytes) : bytes_(bytes) {}
  ~CommandKey();
  CommandKey(const CommandKey&) = default;
  CommandKey& operator=(const CommandKey&) = default;

  CommandKey derived(const std::string& purpose) const;
  void mac(const std::vector<std::uint8_t>& data, std::uint8_t* out) const;
  bool proves(const std::vector<std::uint8_t>& data, const std::uint8_t* claimed) const;
  std::string hex() const;

 private:
  Bytes bytes_;
};

/// What a key file holds: a robot's own, from which every key can be had, or that of one holder.
class CommandKeys {
 public:
  static constexpr std::size_t kLongestName = 16;

  static CommandKeys of_robot(const std::string& robot, const CommandKey& secret);
  CommandKeys of_holder(const std::string& holder) const;  // runtime_error unless this is a robot's

  /// Refuses what others can read, what is not ours, what is no key.
  static CommandKeys load(const std::string& path);
  /// New secret in a new file of its owner's; throws if the file exists.
  static void create(const std::string& path, const std::string& robot);
  /// New secret in the place of the robot's old one: what its holders have is worthless at its next start.
  /// Root renews anybody's.
  static void rotate(const std::string& path);
  void save(const std::string& path) const;  // as create()

  const std::string& robot() const { return robot_; }
  const std::string& holder() const { return holder_; }  // empty: a robot's file
  CommandKey announcements() const;
  /// Of this holder's commands; runtime_error when it cannot be had from a file of another holder's.
  CommandKey commands(const std::string& holder) const;

 private:
  CommandKeys(std::string robot, std::string holder, const CommandKey& secret,
              const CommandKey& announcements)
      : robot_(std::move(robot)),
        holder_(std::move(holder)),
        secret_(secret),
        announcements_(announcements) {}
  std::string text() const;
  static CommandKeys read(const std::string& path, const std::string& text);

  std::string robot_;
  std::string holder_;
  CommandKey secret_;  // the robot's, or of the holder's commands
  CommandKey announcements_;
};

/// Letters, digits, '-', '_' and '.', one to sixteen.
bool is_command_name(const std::string& name);

}  // namespace equipoise::runtime
