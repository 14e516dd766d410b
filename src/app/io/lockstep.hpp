// A rio_t whose robot is another process: a physics engine connects to a Unix SOCK_SEQPACKET socket, sends
// one lockstep_sensors_t per tick and gets one lockstep_motors_t back (docs/lockstep.md). In: SI, body axes
// -> out: device counts by the inverse of the calibration, so the pipeline runs as on the robot. An engine
// that dies, stalls or talks nonsense ends the ticks; error() says why. Not real-time: the engine's clock
// rules.
#pragma once

#include <sys/types.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "app/io/hardware.hpp"
#include "equipoise/lockstep_sensors_t.hpp"
#include "equipoise/no_copy.hpp"
#include "equipoise/sense/calibrate.hpp"

namespace equipoise::app {

/// Listens on the path, for its owner only. A socket nobody listens on any more is replaced; anything else in
/// the way is an InputError. Removes the path at the end, unless somebody else has it by then.
class LockstepServer : NoCopy {
 public:
  explicit LockstepServer(const std::string& path);
  ~LockstepServer();

  /// File descriptor of the next engine; -ETIMEDOUT, or -EINTR on a signal.
  int accept_engine(double timeout_s) const;

 private:
  std::string path_;
  int fd_ = -1;
  ino_t inode_ = 0;  // what this one has made there
};

enum class LockstepEnd : std::size_t { kRunning, kFinished, kPeerGone, kTimeout, kProtocol };
inline constexpr std::array<const char*, 5> kLockstepEndNames{"running", "finished", "peer_gone", "timeout",
                                                              "protocol"};

class Lockstep : public Backend {
 public:
  /// Owns the connection `fd`.
  Lockstep(int fd, const Calibration& calibration, double timeout_s);
  ~Lockstep() override;

  LockstepEnd end() const noexcept { return end_; }
  const std::string& error() const noexcept { return error_; }

 private:
  int wait_tick(std::int64_t* now_ns) override;
  int read_sensors(rio_sensors_t* out) override;
  int write_motors(const rio_motors_t& motors) override { return answer(motors, false); }
  int motors_off() override { return answer({}, false); }
  void close() override;

  int receive();
  int answer(const rio_motors_t& motors, bool last);
  int stop(LockstepEnd end, int code, const std::string& why);

  int fd_;
  Calibration calibration_;
  int timeout_ms_;
  lockstep_sensors_t sensors_{};
  std::int64_t next_step_ = 0;
  bool owes_answer_ = false;
  LockstepEnd end_ = LockstepEnd::kRunning;
  std::string error_;
};

/// Inverse of calibrate(): what the devices would have counted.
rio_sensors_t counts_of(const lockstep_sensors_t& sensors, const Calibration& calibration) noexcept;

/// Length and type checked; false leaves `out` undefined.
bool decode_lockstep_sensors(const void* data, std::size_t size, lockstep_sensors_t* out);

}  // namespace equipoise::app
