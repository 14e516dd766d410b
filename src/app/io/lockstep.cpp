#include "app/io/lockstep.hpp"

#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cerrno>
#include <cstring>

#include "app/text/errors.hpp"
#include "equipoise/lockstep_motors_t.hpp"

namespace equipoise::app {
namespace {

constexpr std::size_t kLargestMessage = 512;
constexpr int kFarewell_ms = 1000;

sockaddr_un address_of(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path) {
    throw InputError("--socket " + path + ": must have 1 to " + std::to_string(sizeof address.sun_path - 1) +
                     " characters");
  }
  std::memcpy(address.sun_path, path.c_str(), path.size());
  return address;
}

/// Whether a process still listens there.
bool answered(const sockaddr_un& address) {
  const int probe = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (probe < 0) return true;
  const bool refused = connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 &&
                       errno == ECONNREFUSED;
  ::close(probe);
  return !refused;
}

void clear_stale(const std::string& path, const sockaddr_un& address) {
  struct stat what {};
  if (lstat(path.c_str(), &what) != 0) return;
  if (!S_ISSOCK(what.st_mode)) {
    throw InputError("--socket " + path + ": exists and is no socket; choose another path");
  }
  if (answered(address)) {
    throw InputError("--socket " + path + ": another process listens there; stop it or choose another path");
  }
  unlink(path.c_str());
}

ino_t inode_of(const std::string& path) {
  struct stat what {};
  return lstat(path.c_str(), &what) == 0 ? what.st_ino : 0;
}

/// 1 readable, 0 timeout, -errno.
int wait_readable(int fd, int timeout_ms) {
  pollfd wanted{fd, POLLIN, 0};
  const int ready = poll(&wanted, 1, timeout_ms);
  return ready < 0 ? -errno : ready;
}

int milliseconds(double seconds) { return static_cast<int>(seconds * 1e3); }

}  // namespace

LockstepServer::LockstepServer(const std::string& path) : path_(path) {
  const sockaddr_un address = address_of(path);
  clear_stale(path, address);
  fd_ = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0);
  const mode_t mask = umask(0077);
  const bool bound = fd_ >= 0 && bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  const int error = errno;
  umask(mask);
  if (!bound || listen(fd_, 1) != 0) {
    if (fd_ >= 0) ::close(fd_);
    throw InputError("--socket " + path + ": " + std::strerror(bound ? errno : error));
  }
  inode_ = inode_of(path);
}

LockstepServer::~LockstepServer() {
  if (inode_of(path_) == inode_) unlink(path_.c_str());  // an open socket's number is nobody else's
  ::close(fd_);
}

int LockstepServer::accept_engine(double timeout_s) const {
  const int ready = wait_readable(fd_, milliseconds(timeout_s));
  if (ready <= 0) return ready == 0 ? -ETIMEDOUT : ready;
  const int fd = accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC);
  return fd < 0 ? -errno : fd;
}

Lockstep::Lockstep(int fd, const Calibration& calibration, double timeout_s)
    : fd_(fd), calibration_(calibration), timeout_ms_(milliseconds(timeout_s)) {}

Lockstep::~Lockstep() {
  if (fd_ >= 0) ::close(fd_);
}

int Lockstep::stop(LockstepEnd end, int code, const std::string& why) {
  if (end_ == LockstepEnd::kRunning) {
    end_ = end;
    error_ = why;
  }
  return code;
}

bool decode_lockstep_sensors(const void* data, std::size_t size, lockstep_sensors_t* out) {
  constexpr std::int64_t kLastStep = INT64_MAX / 5'000'000;  // its time in ns still fits
  const auto length = static_cast<int>(size);
  return size <= kLargestMessage && length == out->getEncodedSize() &&
         out->decode(data, 0, length) == length && out->step >= -kLastStep && out->step <= kLastStep;
}

int Lockstep::receive() {
  const int ready = wait_readable(fd_, timeout_ms_);
  if (ready == -EINTR) return stop(LockstepEnd::kFinished, -ESHUTDOWN, "");
  if (ready == 0) {
    return stop(LockstepEnd::kTimeout, -ETIMEDOUT,
                "the physics engine sent nothing for " + std::to_string(timeout_ms_) + " ms");
  }
  std::array<std::uint8_t, kLargestMessage> bytes{};
  const ssize_t size = ready < 0 ? ready : recv(fd_, bytes.data(), bytes.size(), MSG_TRUNC);
  if (size <= 0) {
    return stop(LockstepEnd::kPeerGone, -ECONNRESET,
                "the physics engine hung up before step " + std::to_string(next_step_));
  }
  if (!decode_lockstep_sensors(bytes.data(), static_cast<std::size_t>(size), &sensors_)) {
    return stop(LockstepEnd::kProtocol, -EBADMSG,
                "a message of " + std::to_string(size) + " bytes is no lockstep_sensors_t, which has " +
                    std::to_string(sensors_.getEncodedSize()) + " (same lcm/*.lcm on both sides?)");
  }
  if (sensors_.step != next_step_) {
    return stop(
        LockstepEnd::kProtocol, -EBADMSG,
        "step " + std::to_string(sensors_.step) + " where " + std::to_string(next_step_) + " was due");
  }
  ++next_step_;
  owes_answer_ = true;
  return 0;
}

int Lockstep::answer(const rio_motors_t& motors, bool last) {
  if (!owes_answer_ || fd_ < 0) return 0;
  owes_answer_ = false;
  lockstep_motors_t m{};
  m.step = sensors_.step;
  m.t_s = sensors_.t_s;
  m.enable = motors.enable ? 1 : 0;
  m.last = last ? 1 : 0;
  for (int i = 0; i < RIO_MAX_MOTORS; ++i) m.duty[i] = motors.enable ? motors.duty[i] : 0.0;
  std::array<std::uint8_t, kLargestMessage> bytes{};
  const int size = m.encode(bytes.data(), 0, static_cast<int>(bytes.size()));
  if (send(fd_, bytes.data(), static_cast<std::size_t>(size), MSG_NOSIGNAL | MSG_DONTWAIT) != size) {
    return stop(LockstepEnd::kPeerGone, -errno,
                "the physics engine hung up in step " + std::to_string(sensors_.step));
  }
  return 0;
}

int Lockstep::wait_tick(std::int64_t* now_ns) {
  if (end_ != LockstepEnd::kRunning) return -ESHUTDOWN;
  if (sensors_.last != 0) return stop(LockstepEnd::kFinished, -ESHUTDOWN, "");
  const int status = receive();
  if (status != 0) return status;
  *now_ns = sensors_.step * static_cast<std::int64_t>(kTickS * 1e9);
  return 0;
}

int Lockstep::read_sensors(rio_sensors_t* out) {
  *out = counts_of(sensors_, calibration_);
  return 0;
}

/// An engine that is still there gets `last` as the answer to the step it is in.
void Lockstep::close() {
  if (fd_ < 0) return;
  if (end_ == LockstepEnd::kRunning && sensors_.last == 0 && !owes_answer_) {
    timeout_ms_ = std::min(timeout_ms_, kFarewell_ms);
    if (receive() != 0) end_ = LockstepEnd::kRunning;  // already stopping for another reason
  }
  owes_answer_ = true;
  (void)answer(rio_motors_t{}, true);
  ::close(fd_);
  fd_ = -1;
}

rio_sensors_t counts_of(const lockstep_sensors_t& s, const Calibration& c) noexcept {
  rio_sensors_t out{};
  const Vec3 gyro_S = c.R_BS.transpose() * (Eigen::Map<const Vec3>(s.gyro_B_rad_s) + c.gyro_bias_B_rad_s);
  const Vec3 force_S =
      (c.R_BS.transpose() * (Eigen::Map<const Vec3>(s.specific_force_B_m_s2) + c.accel_bias_B_m_s2))
          .cwiseQuotient(c.accel_scale_S);
  for (int i = 0; i < 3; ++i) {
    out.gyro_counts[i] = gyro_S(i) / c.gyro_rad_s_per_count;
    out.accel_counts[i] = force_S(i) / c.accel_m_s2_per_count;
  }
  const double counts_per_rad = c.encoder_counts_per_rev / (2.0 * kPi);
  for (std::size_t i = 0; i < RIO_MAX_MOTORS; ++i) {
    out.encoder_counts[i] = c.encoder_sign[i] * counts_per_rad * s.wheel_angle_rad[i];
  }
  out.battery_counts = (s.battery_V - c.battery_offset_V) / c.battery_V_per_count;
  out.t_ns = s.step * static_cast<std::int64_t>(kTickS * 1e9);
  out.valid = static_cast<unsigned>(RIO_IMU) | static_cast<unsigned>(RIO_ENCODERS) |
              static_cast<unsigned>(RIO_BATTERY);
  out.attitude_wxyz[0] = 1.0;
  if (s.has_attitude != 0) {
    const double* q = s.attitude_WB_wxyz;
    const Eigen::Quaterniond R_WS = Eigen::Quaterniond(q[0], q[1], q[2], q[3]) * Eigen::Quaterniond(c.R_BS);
    out.attitude_wxyz[0] = R_WS.w();
    out.attitude_wxyz[1] = R_WS.x();
    out.attitude_wxyz[2] = R_WS.y();
    out.attitude_wxyz[3] = R_WS.z();
    out.valid |= static_cast<unsigned>(RIO_ATTITUDE);
  }
  return out;
}

}  // namespace equipoise::app
