// `equipoise bench`: what a tick costs here, and how punctually this machine wakes the loop.
#include <linux/perf_event.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <vector>

#include "app/cli/commands.hpp"
#include "app/cli/progress.hpp"
#include "app/io/plant_backend.hpp"
#include "app/run/realtime_session.hpp"
#include "app/text/json.hpp"
#include "app/trial/firmware.hpp"
#include "equipoise/no_copy.hpp"
#include "equipoise/runtime/loop.hpp"
#include "equipoise/runtime/recorded_samples.hpp"

namespace equipoise::app {
namespace {

struct BenchArguments {
  std::string config = "config/mbbr.toml";
  std::string json;
  int ticks = 2000;
  int wakes = 400;
};

/// Retired instructions of this thread in user space; absent where the kernel does not let us count.
class Instructions : NoCopy {
 public:
  Instructions() {
    perf_event_attr what{};
    what.type = PERF_TYPE_HARDWARE;
    what.size = sizeof what;
    what.config = PERF_COUNT_HW_INSTRUCTIONS;
    what.exclude_kernel = 1;
    what.exclude_hv = 1;
    fd_ = static_cast<int>(syscall(SYS_perf_event_open, &what, 0, -1, -1, 0));
  }
  ~Instructions() {
    if (fd_ >= 0) close(fd_);
  }
  nlohmann::json count() const {
    std::uint64_t n = 0;
    if (fd_ < 0 || read(fd_, &n, sizeof n) != sizeof n) return nullptr;
    return n;
  }

 private:
  int fd_ = -1;
};

/// Samples of a short run, then loop and firmware alone on them.
nlohmann::json bench_tick(const BenchArguments& a) {
  const auto robot = load_robot(a.config, {});
  Choice choice;
  complete(*robot->type, &choice);
  choice.fidelity = "nominal";
  const auto commands = [](std::int64_t tick, std::int64_t /*now_ns*/) {
    Command command;
    command.arm = tick >= 100;
    return command;
  };
  std::atomic<bool> done{false};
  runtime::RecordedSamples recording;
  recording.samples.reserve(static_cast<std::size_t>(a.ticks));
  const auto world = robot->world(choice, 1);
  PlantBackend backend(*world);
  Hardware simulated(backend.io());
  const auto record = [&](std::int64_t tick, std::int64_t, const RawSample& raw, const auto&...) {
    recording.samples.push_back(raw);
    done = tick + 1 >= a.ticks;
  };
  (void)runtime::run_loop(simulated, *robot->firmware(choice), commands, record, done);
  const auto fresh = robot->firmware(choice);
  const Instructions instructions;
  const nlohmann::json before = instructions.count();
  const std::int64_t start_ns = runtime::monotonic_now_ns();
  done = false;
  (void)runtime::run_loop(
      recording, *fresh, commands, [](const auto&...) {}, done);
  const std::int64_t end_ns = runtime::monotonic_now_ns();
  const nlohmann::json after = instructions.count();
  nlohmann::json out{{"robot", robot->type->name},
                     {"estimator", choice.estimator},
                     {"controller", choice.controller},
                     {"tick_ns", static_cast<double>(end_ns - start_ns) / a.ticks},
                     {"tick_instructions", nullptr}};
  if (before.is_number() && after.is_number()) {
    const auto n = after.get<std::uint64_t>() - before.get<std::uint64_t>();
    out["tick_instructions"] = static_cast<double>(n) / a.ticks;
  }
  return out;
}

nlohmann::json quantiles(std::vector<std::int64_t> late_ns) {
  std::sort(late_ns.begin(), late_ns.end());
  const auto at = [&](double share) {
    const auto i = static_cast<std::size_t>(share * static_cast<double>(late_ns.size() - 1));
    return 1e-3 * static_cast<double>(late_ns[i]);
  };
  return {{"p50_us", at(0.5)}, {"p99_us", at(0.99)}, {"max_us", at(1.0)}, {"wakes", late_ns.size()}};
}

/// Ours and a bare loop take turns, so that both meet the same neighbours.
nlohmann::json bench_wake(const BenchArguments& a) {
  constexpr std::int64_t kPeriod_ns = 5'000'000;
  const int turn = std::min(a.wakes, 40);
  runtime::HeartbeatPage page{};
  runtime::Supervisor supervisor({&page, 0, nullptr, false});
  std::vector<std::int64_t> ours;
  std::vector<std::int64_t> bare;
  for (auto* late : {&ours, &bare}) late->reserve(2 * static_cast<std::size_t>(a.wakes));
  std::int64_t due_ns = runtime::monotonic_now_ns() + kPeriod_ns;
  Progress progress("bench");
  for (int i = 0; i < 2 * a.wakes; ++i) {
    progress.at(0.5 * i / a.wakes);
    const bool is_ours = i / turn % 2 == 0;
    runtime::sleep_until(due_ns);
    const std::int64_t now_ns = runtime::monotonic_now_ns();
    (is_ours ? ours : bare).push_back(now_ns - due_ns);
    if (is_ours) {
      RawSample raw{};
      raw.t_ns = due_ns;
      (void)supervisor.begin(now_ns, raw);
      supervisor.end(true, 0);
    }
    due_ns += kPeriod_ns;
    if (now_ns > due_ns) due_ns = now_ns + kPeriod_ns;
  }
  return {{"loop", quantiles(ours)}, {"clock_nanosleep", quantiles(bare)}};
}

int run(const BenchArguments& a) {
  nlohmann::json out = bench_tick(a);
  {
    const runtime::Realtime realtime(runtime::RealtimeWish{});
    out["realtime"] = to_json(realtime);
    out["realtime_complete"] = realtime.complete();
    out["wake"] = bench_wake(a);
  }
  std::FILE* const text = a.json == "-" ? stderr : stdout;
  std::fprintf(text, "tick %.0f ns; wake-up p50 %.0f us, p99 %.0f us; bare clock_nanosleep %.0f, %.0f us\n",
               out["tick_ns"].get<double>(), out["wake"]["loop"]["p50_us"].get<double>(),
               out["wake"]["loop"]["p99_us"].get<double>(),
               out["wake"]["clock_nanosleep"]["p50_us"].get<double>(),
               out["wake"]["clock_nanosleep"]["p99_us"].get<double>());
  if (!a.json.empty()) write_json(out, a.json);
  return 0;
}

}  // namespace

void add_bench(Subcommand app) {
  const Subcommand command =
      app.subcommand("bench", "Measures the cost of a tick and the punctuality of wake-ups")
          .example("equipoise bench --config config/mbbr.toml");
  auto a = std::make_shared<BenchArguments>();
  command.option("--config", a->config, "robot configuration").file().show_default();
  command.option("--ticks", a->ticks, "ticks to measure").show_default().range(200, 1000000);
  command
      .option("--wakes", a->wakes,
              "wake-ups to measure, 5 ms apart, of the loop and of a bare clock_nanosleep")
      .show_default()
      .range(10, 100000);
  command.option("--json", a->json, "results as JSON, - for stdout").file();
  command.action([=] { return run(*a); });
}

}  // namespace equipoise::app
