#include "app/log/run_log.hpp"

#include <algorithm>
#include <cctype>

#include "app/text/errors.hpp"
#include "equipoise/runtime/wire.hpp"

namespace equipoise::app {
namespace {

using runtime::TickRecord;
namespace fields = runtime::fields;

constexpr unsigned kWhole = 0x7F;  // the seven of each_message

std::string lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return out;
}

}  // namespace

std::string short_name(std::string_view channel) {
  constexpr std::string_view kStart = "EQUIPOISE_";
  return lower(channel.substr(0, kStart.size()) == kStart ? channel.substr(kStart.size()) : channel);
}

RunLog::RunLog(const std::string& path) : reader_(LogReader::open(path)) {
  find_run(LogReader::open(path), path);
}

RunLog::RunLog(const std::string& bytes, const std::string& origin) : reader_(LogReader::over(bytes)) {
  find_run(LogReader::over(bytes), origin);
}

/// Each part starts with it; the first may be damaged.
void RunLog::find_run(LogReader reader, const std::string& origin) {
  LogEvent event;
  std::int64_t utime = 0;
  std::int64_t none = 0;
  while (reader.next(&event)) {
    if (event.channel == fields::kRunChannel &&
        runtime::decode(fields::Run{}, event.data, &run_, &utime, &none))
      return;
  }
  throw InputError(origin + ": is no log of a run (no EQUIPOISE_RUN of this version in it)");
}

bool RunLog::finish(TickRecord* tick) {
  const bool whole = seen_ == kWhole && !torn_;
  if (seen_ != 0 && !whole) ++incomplete_ticks_;
  if (whole) *tick = tick_;
  seen_ = 0;
  torn_ = false;
  return whole;
}

bool RunLog::next(TickRecord* tick) {
  LogEvent event;
  while (reader_.next(&event)) {
    bool whole = false;
    if (event.channel == fields::kSensorsChannel) {
      whole = finish(tick);
      tick_ = TickRecord{};
      std::int64_t utime = 0;
      if (runtime::decode(fields::Sensors{}, event.data, &tick_, &utime, &tick_.tick)) seen_ = 1;
      tick_.now_ns = static_cast<std::int64_t>(static_cast<std::uint64_t>(utime) * 1000U);  // whatever it is
    } else if (seen_ != 0) {
      take(event);
    }
    if (whole) return true;
  }
  return finish(tick);
}

void RunLog::take(const LogEvent& event) {
  const auto decoded = [&](auto message, auto* record) {
    std::int64_t utime = 0;
    std::int64_t tick = 0;
    return runtime::decode(message, event.data, record, &utime, &tick) && tick == tick_.tick;
  };
  if (event.channel == fields::kTruthChannel) {
    tick_.has_truth = decoded(fields::State{}, &tick_.truth);
  } else if (event.channel == fields::kFaultsChannel) {
    if (!decoded(fields::Faults{}, &tick_.faults)) tick_.faults = {};
  } else if (event.channel == fields::kEndChannel) {
    runtime::EndRecord end;
    if (decoded(fields::End{}, &end)) end_ = end;
  } else if (event.channel.substr(0, fields::kComparedChannel.size()) == fields::kComparedChannel) {
    const std::string name = lower(event.channel.substr(fields::kComparedChannel.size()));
    const auto found = std::find(estimators_.begin(), estimators_.end(), name);
    const auto i = static_cast<std::size_t>(found - estimators_.begin());
    if (i >= runtime::kMaxEstimators || !decoded(fields::State{}, &tick_.others[i])) return;
    if (found == estimators_.end()) estimators_.push_back(name);
    tick_.compared |= 1U << i;
  } else {
    unsigned bit = 1;
    fields::each_message(tick_, [&](auto message, std::string_view channel, auto& record) {
      if (channel == event.channel) {
        torn_ = torn_ || !decoded(message, &record);
        seen_ |= bit;
      }
      bit <<= 1U;
    });
  }
}

Command command_of(const TickRecord& r) noexcept {
  Command c;
  c.velocity_W_m_s = Vec2(r.velocity_W_m_s[0], r.velocity_W_m_s[1]);
  c.yaw_rate_rad_s = r.yaw_rate_rad_s;
  c.arm = r.arm;
  c.heading_reset = r.heading_reset;
  c.age_s = r.command_age_s;
  return c;
}

}  // namespace equipoise::app
