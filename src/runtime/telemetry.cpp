#include "equipoise/runtime/telemetry.hpp"

#include <lcm/lcm.h>

#include <cctype>
#include <chrono>
#include <stdexcept>

#include "equipoise/runtime/timing.hpp"
#include "equipoise/runtime/wire.hpp"
#include "log_writer.hpp"

namespace equipoise::runtime {
namespace {

constexpr std::size_t kQueueTicks = 1024;  // five seconds at 200 Hz
// Between looks at an empty queue: five ticks on a robot, where to wake up costs more than to write one, and
// a log that SIGKILL may cut by 100 ms has time; less for a simulation, which waits when the queue is full.
constexpr auto kIdle = std::chrono::milliseconds(25);
constexpr auto kIdleOfSimulation = std::chrono::milliseconds(2);

std::string upper(std::string text) {
  for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return text;
}

}  // namespace

/// Log file and LCM connection; used by the telemetry thread only.
class Telemetry::Writer : NoCopy {
 public:
  Writer(const TelemetryOptions& options, TelemetryReport* report, std::atomic<bool>* log_failed)
      : options_(options), report_(report), log_failed_(log_failed) {
    const LogLimits limits{options.max_log_bytes, options.min_free_bytes, options.sync,
                           options.keep_previous};
    if (!options.log_path.empty() && !log_.open(options.log_path, limits))
      throw std::runtime_error(log_.error());
    if (!options.url.empty()) {
      lcm_ = lcm_create(options.url.c_str());
      if (lcm_ == nullptr) {
        report_->warning =
            "telemetry " + options.url +
            " cannot be opened (is there a route for multicast? ip route add 224.0.0.0/4 dev lo); "
            "going on without it";
      }
    }
    for (const std::string& name : options.estimators)
      channels_.push_back(std::string(fields::kComparedChannel) + upper(name));
    announce(options.run);
  }

  ~Writer() {
    close_log();
    if (lcm_ != nullptr) lcm_destroy(lcm_);
  }

  void write(const TickRecord& r) {
    if (options_.watch) options_.watch(r);
    publish_now_ = lcm_ != nullptr && publish_due();
    utime_ = r.now_ns / 1000;
    tick_ = r.tick;
    if (log_.is_open() || publish_now_) messages(r);
    if (r.compute_ns > 0) histogram(r);  // simulated time takes no time
    ++report_->records;
  }

  /// `more`: another record is waiting.
  void end_tick(bool more) {
    log_.end_tick(more);
    note_failure();
  }

  void end(const EndRecord& end) {
    publish_now_ = lcm_ != nullptr;
    encode(fields::End{}, end, utime_, tick_, &buffer_);
    emit(fields::kEndChannel);
    log_.end_tick();
  }

  void close_log() {
    log_.close();
    note_failure();
  }

 private:
  bool publish_due() {
    const auto now = std::chrono::steady_clock::now();
    if (now < next_publish_) return false;
    next_publish_ = now + std::chrono::duration_cast<std::chrono::steady_clock::duration>(
                              std::chrono::duration<double>(1.0 / options_.max_publish_hz));
    return true;
  }

  void messages(const TickRecord& r) {
    const auto encoded = [this](auto message, const char* channel, const auto& record) {
      encode(message, record, utime_, tick_, &buffer_);
      emit(channel);
    };
    fields::each_message(r, encoded);
    for (std::size_t i = 0; i < channels_.size() && i < kMaxEstimators; ++i) {
      if ((r.compared & (1U << i)) != 0) encoded(fields::State{}, channels_[i].c_str(), r.others[i]);
    }
    if (r.has_truth) encoded(fields::State{}, fields::kTruthChannel, r.truth);
    if (r.faults.bound > 0.0) encoded(fields::Faults{}, fields::kFaultsChannel, r.faults);
  }

  /// What the buffer holds.
  void emit(const char* channel) {
    if (log_.is_open()) log_.event(utime_, channel, buffer_);
    if (publish_now_) publish(channel);
  }

  void publish(const char* channel) {
    lcm_publish(lcm_, channel, buffer_.data(), static_cast<unsigned>(buffer_.size()));
  }

  void note_failure() {
    if (log_.error().empty()) return;
    report_->log_error = log_.error();
    log_failed_->store(true);
  }

  void announce(const RunInfo& run) {
    encode(fields::Run{}, run, utime_, tick_, &buffer_);
    if (log_.is_open()) log_.preamble(utime_, fields::kRunChannel, buffer_);
    if (lcm_ != nullptr) publish(fields::kRunChannel);
  }

  /// Once a second of ticks.
  void histogram(const TickRecord& r) {
    wake_late_.add(r.wake_late_ns);
    compute_.add(r.compute_ns);
    if (wake_late_.total() % static_cast<std::int64_t>(kTickHz) != 0) return;
    fields::HistogramRecord record{{}, wake_late_.bins(), compute_.bins()};
    for (std::size_t i = 0; i < TimeHistogram::kBins; ++i) record.upper_ns[i] = TimeHistogram::upper_ns(i);
    publish_now_ = lcm_ != nullptr;
    encode(fields::Histogram{}, record, utime_, tick_, &buffer_);
    emit(fields::kHistogramChannel);
  }

  const TelemetryOptions& options_;
  TelemetryReport* report_;
  std::atomic<bool>* log_failed_;
  LogWriter log_;
  lcm_t* lcm_ = nullptr;
  std::vector<std::string> channels_;
  Bytes buffer_;
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

Telemetry::~Telemetry() { join(); }

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
  for (;;) {
    const bool stopping = stop_.load(std::memory_order_acquire);
    const TickRecord* record = queue_.front();
    const bool any = record != nullptr;
    while (record != nullptr) {
      writer_->write(*record);
      queue_.drop();
      record = queue_.front();
      writer_->end_tick(record != nullptr);
    }
    if (stopping) break;
    if (!any) std::this_thread::sleep_for(options_.wait_when_full ? kIdleOfSimulation : kIdle);
  }
  if (end_) writer_->end(*end_);
  writer_->close_log();
}

TelemetryReport Telemetry::finish(const EndRecord& end) {
  if (thread_.joinable()) end_ = end;
  return join();
}

TelemetryReport Telemetry::join() {
  stop_.store(true, std::memory_order_release);
  if (thread_.joinable()) thread_.join();
  report_.dropped = dropped_.load();
  return report_;
}

}  // namespace equipoise::runtime
