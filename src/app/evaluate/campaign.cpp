// `equipoise campaign`: every fault in every phase of a run, and the soak; docs/reliability.md from it.
#include <cstdio>
#include <fstream>
#include <memory>
#include <random>

#include "app/cli/commands.hpp"
#include "app/cli/reasons.hpp"
#include "app/evaluate/fault_run.hpp"

namespace equipoise::app {
namespace {

struct Arguments {
  std::string config;
  std::string json;
  std::string markdown;
  int seeds = 1;
  double soak_h = 0.0;
  std::uint64_t seed = 1;
};

struct Soak {
  double hours = 0.0;
  std::int64_t flights = 0;
  std::int64_t disarmed = 0;
  std::int64_t unexplained = 0;
  std::int64_t unsafe = 0;
  nlohmann::json to_explain = nlohmann::json::array();  // runs that are unsafe or ended without a fault
};

template <class Firmware>
FaultOutcome one(const typename Firmware::Config& config, const FaultPlan& plan, std::uint64_t seed) {
  auto world = Firmware::world(config, fidelity_level("nominal"), seed);
  return Firmware::with_pipeline(config, Firmware::kDefaultController, [&](auto& pipeline) {
    const auto unrecorded = [](const auto&...) {};
    return run_with_fault(world, pipeline, plan, seed, unrecorded);
  });
}

int fault_tick(Phase phase) {
  switch (phase) {
    case Phase::kDisarmed:
      return 50;
    case Phase::kArming:
      return kArmTick - 1;
    default:
      return 500;
  }
}

/// Runs with a random fault each, of random kind, time and length; between faults nothing may happen.
template <class Firmware>
Soak soak(const typename Firmware::Config& config, double hours, std::uint64_t seed) {
  std::mt19937_64 engine(seed);
  const auto pick = [&engine](int low, int high) {
    return std::uniform_int_distribution<int>(low, high)(engine);
  };
  Soak s;
  std::int64_t ticks = 0;
  const auto wanted = static_cast<std::int64_t>(hours * 3600.0 * kTickHz);
  while (ticks < wanted) {
    FaultPlan plan;
    plan.phase = static_cast<Phase>(pick(2, static_cast<int>(Phase::kCount) - 1));
    plan.fault = static_cast<FaultKind>(pick(0, static_cast<int>(FaultKind::kCount) - 1));
    plan.fault_at_tick = pick(300, 3000);
    plan.fault_ticks = pick(1, 200);
    plan.end_tick = plan.fault_at_tick + pick(200, 2000);
    const std::uint64_t run_seed = engine();
    const FaultOutcome v = one<Firmware>(config, plan, run_seed);
    ticks += plan.end_tick;
    ++s.flights;
    s.disarmed += v.disarmed ? 1 : 0;
    s.unsafe += v.unsafe ? 1 : 0;
    s.unexplained += v.off_without_fault ? 1 : 0;
    if (v.unsafe || v.off_without_fault) {
      s.to_explain.push_back({{"phase", kPhaseNames[static_cast<std::size_t>(plan.phase)]},
                              {"fault", kFaults[static_cast<std::size_t>(plan.fault)].name},
                              {"fault_at_tick", plan.fault_at_tick},
                              {"fault_ticks", plan.fault_ticks},
                              {"seed", run_seed},
                              {"off_after_ticks", v.off_after_ticks},
                              {"reasons", reasons_text(v.reasons)},
                              {"why", v.why}});
    }
  }
  s.hours = static_cast<double>(ticks) / kTickHz / 3600.0;
  return s;
}

template <class Firmware>
int campaign(const Arguments& a) {
  Choice choice;
  choice.estimator = Firmware::kDefaultEstimator;
  choice.controller = Firmware::kDefaultController;
  choice.fidelity = "nominal";
  const auto config = Firmware::apply(Firmware::load(a.config, {}).config, choice);

  nlohmann::json cases = nlohmann::json::array();
  std::string table = "| fault | ";
  for (const char* phase : kPhaseNames) table += std::string(phase) + " | ";
  table += "\n|---|---|---|---|---|---|\n";
  int unsafe = 0;
  for (std::size_t f = 0; f < kFaults.size(); ++f) {
    table += "| " + std::string(kFaults[f].name) + ": " + kFaults[f].why + " | ";
    for (std::size_t p = 0; p < kPhaseNames.size(); ++p) {
      std::string cell;
      for (int i = 0; i < a.seeds; ++i) {
        FaultPlan plan;
        plan.phase = static_cast<Phase>(p);
        plan.fault = static_cast<FaultKind>(f);
        plan.fault_at_tick = fault_tick(plan.phase);
        const FaultOutcome v = one<Firmware>(config, plan, a.seed + static_cast<std::uint64_t>(i));
        unsafe += v.unsafe ? 1 : 0;
        cases.push_back(
            {{"fault", kFaults[f].name},
             {"phase", kPhaseNames[p]},
             {"seed", a.seed + static_cast<std::uint64_t>(i)},
             {"unsafe", v.unsafe},
             {"why", v.why},
             {"disarmed", v.disarmed},
             {"off_after_ticks", v.disarmed ? nlohmann::json(v.off_after_ticks) : nlohmann::json(nullptr)},
             {"reasons", reasons_text(v.reasons)}});
        if (i > 0 && !v.unsafe) continue;
        cell = v.unsafe ? "**UNSAFE: " + std::string(v.why) + "**"
               : v.disarmed
                   ? "off in tick " + std::to_string(v.off_after_ticks) + ": " + reasons_text(v.reasons)
               : v.reasons != 0 ? "stays off: " + reasons_text(v.reasons)
                                : "flies on";
      }
      table += cell + " | ";
    }
    table += "\n";
  }
  nlohmann::json out{
      {"robot", Firmware::kName}, {"cases", cases}, {"case_count", cases.size()}, {"unsafe", unsafe}};
  std::string summary =
      std::to_string(cases.size()) + " fault x phase cases, " + std::to_string(unsafe) + " unsafe";
  if (a.soak_h > 0.0) {
    const Soak s = soak<Firmware>(config, a.soak_h, a.seed);
    out["soak"] = {{"hours", s.hours},   {"flights", s.flights},         {"disarmed", s.disarmed},
                   {"unsafe", s.unsafe}, {"unexplained", s.unexplained}, {"to_explain", s.to_explain}};
    char line[200];
    std::snprintf(line, sizeof line,
                  "; soak %.2f h of robot time, %lld flights, %lld disarmed by a fault, %lld unsafe, "
                  "%lld without a cause",
                  s.hours, static_cast<long long>(s.flights),
                  static_cast<long long>(s.disarmed - s.unexplained), static_cast<long long>(s.unsafe),
                  static_cast<long long>(s.unexplained));
    summary += line;
    unsafe += static_cast<int>(s.unsafe + s.unexplained);
  }
  if (!a.markdown.empty()) {
    std::ofstream file(a.markdown);
    file << "## " << Firmware::kName << "\n" << summary << ".\n\n" << table;
    if (!file.flush()) throw InputError(a.markdown + ": cannot be written");
  }
  std::fprintf(a.json == "-" ? stderr : stdout, "%s: %s\n", Firmware::kName, summary.c_str());
  if (!a.json.empty()) write_json(out, a.json);
  return unsafe == 0 ? 0 : 1;
}

}  // namespace

void add_campaign(Subcommand app) {
  const Subcommand command =
      app.subcommand("campaign", "break every part in every phase of a run, in simulated time");
  auto a = std::make_shared<Arguments>();
  command.option("--config", a->config, "robot configuration").required();
  command.option("--seeds", a->seeds, "runs per case").show_default().range(1, 1000);
  command.option("--seed", a->seed, "the first").show_default();
  command.option("--soak-hours", a->soak_h, "then random runs, hours of robot time")
      .show_default()
      .range(0.0, 10000.0);
  command.option("--markdown", a->markdown, "table for docs/reliability.md");
  command.option("--json", a->json, "cases as JSON, - for stdout");
  command.action([=] {
    return with_robot(robot_type(a->config), a->config,
                      [&](auto firmware) { return campaign<decltype(firmware)>(*a); });
  });
}

}  // namespace equipoise::app
