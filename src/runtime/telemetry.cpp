#include "equipoise/runtime/telemetry.hpp"

#include <lcm/lcm.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <equipoise/command_t.hpp>
#include <equipoise/health_t.hpp>
#include <equipoise/motors_t.hpp>
#include <equipoise/run_t.hpp>
#include <equipoise/sensors_t.hpp>
#include <equipoise/state_t.hpp>
#include <equipoise/timing_t.hpp>
#include <stdexcept>

namespace equipoise::runtime {
namespace {

constexpr std::size_t kQueueTicks = 1024;  // five seconds at 200 Hz
constexpr auto kIdle = std::chrono::milliseconds(2);

template <std::size_t N>
void copy(const std::array<double, N>& from, double (&to)[N]) {
  std::copy(from.begin(), from.end(), to);
}

state_t to_message(const StateRecord& s) {
  state_t m{};
  copy(s.theta_rad, m.theta_rad);
  copy(s.omega_B_rad_s, m.omega_B_rad_s);
  copy(s.phi_rad, m.phi_rad);
  copy(s.phi_dot_rad_s, m.phi_dot_rad_s);
  copy(s.position_W_m, m.position_W_m);
  m.normalized_innovation = s.normalized_innovation;
  return m;
}

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

}  // namespace

/// Log file and LCM connection; used by the telemetry thread only.
class Telemetry::Writer {
 public:
  Writer(const TelemetryOptions& options, TelemetryReport* report, std::atomic<bool>* log_failed)
      : options_(options), report_(report), log_failed_(log_failed) {
    if (!options.log_path.empty()) {
      log_ = lcm_eventlog_create(options.log_path.c_str(), "w");
      if (log_ == nullptr) {
        throw std::runtime_error(options.log_path + ": log cannot be created: " + std::strerror(errno));
      }
    }
    if (!options.url.empty()) {
      lcm_ = lcm_create(options.url.c_str());
      report_->publishing = lcm_ != nullptr;
      if (lcm_ == nullptr) {
        report_->warning =
            "telemetry " + options.url +
            " cannot be opened (is there a route for multicast? ip route add 224.0.0.0/4 dev lo); "
            "going on without it";
      }
    }
    for (const std::string& name : options.estimators) channels_.push_back("EQUIPOISE_STATE_" + upper(name));
    announce(options.run);
  }

  ~Writer() {
    close_log();
    if (lcm_ != nullptr) lcm_destroy(lcm_);
  }
  Writer(const Writer&) = delete;
  Writer& operator=(const Writer&) = delete;

  void write(const TickRecord& r) {
    const auto now = std::chrono::steady_clock::now();
    publish_now_ = lcm_ != nullptr && now >= next_publish_;
    if (publish_now_) {
      next_publish_ = now + std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                                std::chrono::duration<double>(1.0 / options_.max_publish_hz));
    }
    utime_ = r.now_ns / 1000;
    tick_ = r.tick;
    sensors(r);
    command(r);
    state("EQUIPOISE_STATE", r.estimate);
    for (std::size_t i = 0; i < channels_.size() && i < kMaxEstimators; ++i) {
      if ((r.compared & (1U << i)) != 0) state(channels_[i].c_str(), r.others[i]);
    }
    state("EQUIPOISE_REFERENCE", r.reference);
    if (r.has_truth) state("EQUIPOISE_TRUTH", r.truth);
    motors(r);
    health(r);
    timing(r);
    ++report_->records;
  }

  /// Flushes; a log on a full disk is cut back to its last whole event.
  void close_log() {
    if (log_ == nullptr) return;
    if (std::fflush(log_->f) != 0) fail_log(errno);
    if (log_failed_->load()) {
      // What the buffer could not write must not be appended after the cut.
      const int fd = dup(fileno(log_->f));
      lcm_eventlog_destroy(log_);
      if (fd >= 0) {
        if (ftruncate(fd, static_cast<off_t>(whole_bytes_)) != 0)
          report_->log_error += "; its last event is torn";
        close(fd);
      }
    } else {
      lcm_eventlog_destroy(log_);
    }
    log_ = nullptr;
  }

 private:
  template <class Message>
  void emit(const char* channel, Message& message) {
    message.utime = utime_;
    if constexpr (!std::is_same_v<Message, run_t>) message.tick = tick_;
    const int size = message.getEncodedSize();
    buffer_.resize(static_cast<std::size_t>(size));
    message.encode(buffer_.data(), 0, size);
    if (log_ != nullptr && !log_failed_->load(std::memory_order_relaxed)) log(channel, size);
    if (publish_now_) lcm_publish(lcm_, channel, buffer_.data(), static_cast<unsigned>(size));
  }

  void log(const char* channel, int size) {
    lcm_eventlog_event_t event{};
    event.eventnum = event_number_++;
    event.timestamp = utime_;
    event.channellen = static_cast<std::int32_t>(std::strlen(channel));
    event.datalen = size;
    event.channel = const_cast<char*>(channel);
    event.data = buffer_.data();
    errno = 0;
    const bool written = lcm_eventlog_write_event(log_, &event) == 0;
    pending_bytes_ += kEventHeaderBytes + static_cast<std::size_t>(event.channellen + size);
    ++pending_events_;
    const bool flush = pending_events_ >= kFlushEvents;
    if (!written || (flush && std::fflush(log_->f) != 0)) {
      fail_log(errno);
    } else if (flush) {
      whole_bytes_ += pending_bytes_;
      pending_bytes_ = 0;
      pending_events_ = 0;
    }
  }

  void fail_log(int error) {
    if (log_failed_->exchange(true)) return;
    report_->log_error = options_.log_path + ": log stopped: " + std::strerror(error != 0 ? error : EIO);
  }

  void announce(const RunInfo& run) {
    run_t m{};
    m.seed = run.seed;
    m.rolling_radius_m = run.rolling_radius_m;
    m.robot = run.robot;
    m.estimator = run.estimator;
    m.controller = run.controller;
    m.fidelity = run.fidelity;
    m.version = run.version;
    m.config_sha256 = run.config_sha256;
    m.config_toml = run.config_toml;
    publish_now_ = lcm_ != nullptr;
    emit("EQUIPOISE_RUN", m);
  }

  void sensors(const TickRecord& r) {
    sensors_t m{};
    m.t_ns = r.raw.t_ns;
    copy(r.raw.gyro_counts, m.gyro_counts);
    copy(r.raw.accel_counts, m.accel_counts);
    copy(r.raw.encoder_counts, m.encoder_counts);
    copy(r.raw.attitude_wxyz, m.attitude_wxyz);
    m.battery_counts = r.raw.battery_counts;
    m.valid = (r.raw.imu_ok ? 1 : 0) | (r.raw.encoders_ok ? 2 : 0) | (r.raw.battery_ok ? 4 : 0) |
              (r.raw.attitude_ok ? 8 : 0);
    m.health = static_cast<std::int32_t>(r.raw.health);
    emit("EQUIPOISE_SENSORS", m);
  }

  void command(const TickRecord& r) {
    command_t m{};
    copy(r.velocity_W_m_s, m.velocity_W_m_s);
    m.yaw_rate_rad_s = r.yaw_rate_rad_s;
    m.arm = r.arm ? 1 : 0;
    m.heading_reset = r.heading_reset ? 1 : 0;
    m.age_s = r.command_age_s;
    emit("EQUIPOISE_COMMAND", m);
  }

  void state(const char* channel, const StateRecord& s) {
    state_t m = to_message(s);
    emit(channel, m);
  }

  void motors(const TickRecord& r) {
    motors_t m{};
    m.motors = kMaxMotors;
    copy(r.u_lin, m.u_lin);
    copy(r.u_friction, m.u_friction);
    copy(r.duty, m.duty);
    m.enable = r.enable ? 1 : 0;
    m.saturated = r.saturated ? 1 : 0;
    emit("EQUIPOISE_MOTORS", m);
  }

  void health(const TickRecord& r) {
    health_t m{};
    m.arm_state = r.arm_state;
    m.reasons = static_cast<std::int32_t>(r.reasons);
    m.sensor_health = static_cast<std::int32_t>(r.raw.health);
    m.battery_V = r.battery_V;
    m.inhibit = static_cast<std::int32_t>(r.inhibit);
    emit("EQUIPOISE_HEALTH", m);
  }

  void timing(const TickRecord& r) {
    timing_t m{};
    m.wake_late_ns = r.wake_late_ns;
    m.compute_ns = r.compute_ns;
    m.overruns = r.overruns;
    m.dropped_records = r.dropped_records;
    emit("EQUIPOISE_TIMING", m);
  }

  static constexpr std::size_t kEventHeaderBytes = 28;  // sync, event number, time stamp, two lengths
  static constexpr int kFlushEvents = 200;              // about 100 ms of ticks are at risk in a power cut

  const TelemetryOptions& options_;
  TelemetryReport* report_;
  std::atomic<bool>* log_failed_;
  lcm_eventlog_t* log_ = nullptr;
  lcm_t* lcm_ = nullptr;
  std::vector<std::string> channels_;
  std::vector<std::uint8_t> buffer_;
  std::chrono::steady_clock::time_point next_publish_{};
  bool publish_now_ = false;
  std::int64_t utime_ = 0;
  std::int64_t tick_ = 0;
  std::int64_t event_number_ = 0;
  std::size_t whole_bytes_ = 0;
  std::size_t pending_bytes_ = 0;
  int pending_events_ = 0;
};

Telemetry::Telemetry(const TelemetryOptions& options)
    : options_(options),
      queue_(kQueueTicks),
      writer_(std::make_unique<Writer>(options_, &report_, &log_failed_)),
      thread_([this] { run(); }) {}

Telemetry::~Telemetry() { finish(); }

void Telemetry::hand_over(const TickRecord& record) noexcept {
  while (!queue_.push(record)) {
    if (!options_.wait_when_full) {
      dropped_.fetch_add(1, std::memory_order_relaxed);
      return;
    }
    std::this_thread::yield();
  }
}

void Telemetry::run() {
  TickRecord record;
  for (;;) {
    const bool stopping = stop_.load(std::memory_order_acquire);
    bool any = false;
    while (queue_.pop(&record)) {
      writer_->write(record);
      any = true;
    }
    if (stopping) break;
    if (!any) std::this_thread::sleep_for(kIdle);
  }
  writer_->close_log();
}

TelemetryReport Telemetry::finish() {
  stop_.store(true, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
  report_.dropped = dropped_.load();
  return report_;
}

}  // namespace equipoise::runtime
