#include "equipoise/runtime/telemetry.hpp"

#include <lcm/lcm.h>

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
#include <equipoise/timing_histogram_t.hpp>
#include <equipoise/timing_t.hpp>
#include <stdexcept>

#include "equipoise/runtime/timing.hpp"
#include "log_writer.hpp"

namespace equipoise::runtime {
namespace {

constexpr std::size_t kQueueTicks = 1024;  // five seconds at 200 Hz
constexpr auto kIdle = std::chrono::milliseconds(2);

template <class Array, class T, std::size_t N>
void copy(const Array& from, T (&to)[N]) {
  std::copy(std::begin(from), std::end(from), to);
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
    const LogLimits limits{options.max_log_bytes, options.min_free_bytes, options.sync};
    if (!options.log_path.empty() && !log_.open(options.log_path, limits)) {
      throw std::runtime_error(options.log_path + ": log cannot be created: " + std::strerror(errno));
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
    log_.end_tick();
    note_failure();
    ++report_->records;
  }

  /// Nothing to do: what is written so far goes to the kernel.
  void idle() {
    log_.flush();
    note_failure();
  }

  void close_log() {
    log_.close();
    note_failure();
  }

 private:
  template <class Message>
  void encode(const Message& message) {
    const int size = message.getEncodedSize();
    buffer_.resize(static_cast<std::size_t>(size));
    message.encode(buffer_.data(), 0, size);
  }

  template <class Message>
  void emit(const char* channel, Message& message) {
    message.utime = utime_;
    message.tick = tick_;
    encode(message);
    log_.write(utime_, channel, buffer_.data(), static_cast<int>(buffer_.size()));
    if (publish_now_) lcm_publish(lcm_, channel, buffer_.data(), static_cast<unsigned>(buffer_.size()));
  }

  void note_failure() {
    if (log_.error().empty()) return;
    report_->log_error = log_.error();
    log_failed_->store(true);
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
    m.backend = run.backend;
    m.board_toml = run.board_toml;
    m.attitude = run.attitude;
    encode(m);
    log_.preamble(utime_, "EQUIPOISE_RUN", buffer_);
    if (lcm_ != nullptr)
      lcm_publish(lcm_, "EQUIPOISE_RUN", buffer_.data(), static_cast<unsigned>(buffer_.size()));
  }

  void sensors(const TickRecord& r) {
    sensors_t m{};
    m.t_ns = r.raw.t_ns;
    copy(r.raw.gyro_counts, m.gyro_counts);
    copy(r.raw.accel_counts, m.accel_counts);
    copy(r.raw.encoder_counts, m.encoder_counts);
    copy(r.raw.attitude_wxyz, m.attitude_wxyz);
    m.battery_counts = r.raw.battery_counts;
    m.valid = static_cast<std::int32_t>(r.raw.valid);
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
    if (r.compute_ns > 0) histogram(r);  // simulated time takes no time
  }

  /// Once a second of ticks.
  void histogram(const TickRecord& r) {
    wake_late_.add(r.wake_late_ns);
    compute_.add(r.compute_ns);
    if (wake_late_.total() % static_cast<std::int64_t>(kTickHz) != 0) return;
    timing_histogram_t m{};
    for (std::size_t i = 0; i < TimeHistogram::kBins; ++i) m.upper_ns[i] = TimeHistogram::upper_ns(i);
    copy(wake_late_.bins(), m.wake_late);
    copy(compute_.bins(), m.compute);
    publish_now_ = lcm_ != nullptr;
    emit("EQUIPOISE_TIMING_HISTOGRAM", m);
  }

  const TelemetryOptions& options_;
  TelemetryReport* report_;
  std::atomic<bool>* log_failed_;
  LogWriter log_;
  lcm_t* lcm_ = nullptr;
  std::vector<std::string> channels_;
  std::vector<std::uint8_t> buffer_;
  std::chrono::steady_clock::time_point next_publish_{};
  bool publish_now_ = false;
  std::int64_t utime_ = 0;
  std::int64_t tick_ = 0;
  TimeHistogram wake_late_;
  TimeHistogram compute_;
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
    if (!any) {
      writer_->idle();
      std::this_thread::sleep_for(kIdle);
    }
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
