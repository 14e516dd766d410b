// `equipoise campaign`: every fault in every phase of a run, and the soak.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <random>

#include "app/cli/commands.hpp"
#include "app/evaluate/fault_run.hpp"
#include "app/evaluate/parallel.hpp"
#include "app/text/format.hpp"
#include "app/text/json.hpp"
#include "app/text/reasons.hpp"
#include "app/trial/firmware.hpp"
#include "config/population.hpp"

namespace equipoise::app {
namespace {

struct CampaignArguments {
  std::string config;
  std::string json;
  std::string fidelity = "nominal";
  std::string controller;  // empty: the robot's default
  std::vector<std::string> set;
  std::vector<std::string> faults;  // empty: all
  std::vector<std::string> phases;
  int seeds = 1;
  int robots = 1;
  std::int64_t robot = 0;  // the first
  double after_s = 0.0;    // 0: 5.5 s in all
  double soak_h = 0.0;
  std::uint64_t seed = 1;
  int jobs = 0;
};

struct Soak {
  double hours = 0.0;
  int runs = 0;
  int disarmed = 0;
  int unexplained = 0;
  int unsafe = 0;
  nlohmann::json to_explain = nlohmann::json::array();  // runs that are unsafe or ended without a fault
};

/// One row of the table of cases.
struct Case {
  FaultPlan plan;
  std::int64_t robot = 0;
  std::uint64_t seed = 0;
};

int fault_tick(Phase phase) {
  if (phase == Phase::kDisarmed) return 50;
  return phase == Phase::kArming ? kArmTick - 1 : 500;
}

/// Runs with a random fault each, of random kind, time and length; between faults nothing may happen.
Soak soak(const ConfiguredRobot& robot, const Choice& choice, double hours, std::uint64_t seed) {
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
    const FaultOutcome v = run_with_fault(robot, choice, plan, run_seed);
    ticks += plan.end_tick;
    ++s.runs;
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

/// The robot as it was drawn.
std::unique_ptr<const ConfiguredRobot> configured(const CampaignArguments& a, std::int64_t robot) {
  const auto drawn = config::draw_robot(a.config, a.set, a.fidelity, robot);
  return load_robot(a.config, config::with_robot_drawn(drawn, a.fidelity, a.set));
}

bool chosen(const std::vector<std::string>& names, const char* name) {
  return names.empty() || std::find(names.begin(), names.end(), name) != names.end();
}

std::vector<Case> cases_of(const CampaignArguments& a) {
  std::vector<Case> cases;
  for (std::size_t f = 0; f < kFaults.size(); ++f) {
    for (std::size_t p = 0; p < kPhaseNames.size(); ++p) {
      if (!chosen(a.faults, kFaults[f].name) || !chosen(a.phases, kPhaseNames[p])) continue;
      for (int r = 0; r < a.robots; ++r) {
        for (int i = 0; i < a.seeds; ++i) {
          Case c;
          c.plan.phase = static_cast<Phase>(p);
          c.plan.fault = static_cast<FaultKind>(f);
          c.plan.fault_at_tick = fault_tick(c.plan.phase);
          if (a.after_s > 0.0) c.plan.end_tick = c.plan.fault_at_tick + static_cast<int>(a.after_s * kTickHz);
          c.robot = a.robot + r;
          c.seed = a.seed + static_cast<std::uint64_t>(r + a.robots * i);  // no two robots share one
          cases.push_back(c);
        }
      }
    }
  }
  return cases;
}

nlohmann::json row_of(const Case& c, const FaultOutcome& v) {
  const auto known = [](bool is, int value) { return is ? nlohmann::json(value) : nlohmann::json(nullptr); };
  return {{"fault", kFaults[static_cast<std::size_t>(c.plan.fault)].name},
          {"phase", kPhaseNames[static_cast<std::size_t>(c.plan.phase)]},
          {"robot", c.robot},
          {"seed", c.seed},
          {"unsafe", v.unsafe},
          {"why", v.why},
          {"upright", v.upright},
          {"disarmed", v.disarmed},
          {"off_after_ticks", known(v.disarmed, v.off_after_ticks)},
          {"found_after_ticks", known(v.found_after_ticks >= 0, v.found_after_ticks)},
          {"degraded", degraded_names(v.degraded)},
          {"reasons", reasons_text(v.reasons)}};
}

int campaign(const CampaignArguments& a) {
  const RobotType& type = robot_type_of(robot_type(a.config), a.config);
  Choice choice;
  choice.controller = a.controller;
  choice.fidelity = a.fidelity;
  complete(type, &choice);
  // To configure a robot takes as long as a second of its run: on all threads, too.
  std::vector<std::unique_ptr<const ConfiguredRobot>> robots(static_cast<std::size_t>(a.robots));
  Workers(threads_for(a.jobs)).each(a.robots, [&](int r) {
    robots[static_cast<std::size_t>(r)] = configured(a, a.robot + r);
  });
  const std::vector<Case> all = cases_of(a);
  std::vector<FaultOutcome> outcomes(all.size());
  in_parallel("campaign", all.size(), threads_for(a.jobs), [&](std::size_t i) {
    const Case& c = all[i];
    outcomes[i] =
        run_with_fault(*robots[static_cast<std::size_t>(c.robot - a.robot)], choice, c.plan, c.seed);
  });

  nlohmann::json cases = nlohmann::json::array();
  int unsafe = 0;
  for (std::size_t i = 0; i < all.size(); ++i) {
    cases.push_back(row_of(all[i], outcomes[i]));
    unsafe += outcomes[i].unsafe ? 1 : 0;
  }
  nlohmann::json out{
      {"robot", type.name}, {"cases", cases}, {"case_count", cases.size()}, {"unsafe", unsafe}};
  for (const FaultInfo& fault : kFaults) out["faults"][fault.name] = fault.why;
  std::string summary = format("%zu fault x phase cases, %d unsafe", cases.size(), unsafe);
  if (a.soak_h > 0.0) {
    const Soak s = soak(*robots[0], choice, a.soak_h, a.seed);
    out["soak"] = {{"hours", s.hours},
                   {"runs", s.runs},
                   {"disarmed", s.disarmed},
                   {"unsafe", s.unsafe},
                   {"unexplained", s.unexplained},
                   {"to_explain", s.to_explain}};
    summary +=
        format("; soak %.2f h of robot time, %d runs, %d disarmed by a fault, %d unsafe, %d without a cause",
               s.hours, s.runs, s.disarmed - s.unexplained, s.unsafe, s.unexplained);
    unsafe += s.unsafe + s.unexplained;
  }
  std::fprintf(a.json == "-" ? stderr : stdout, "%s: %s\n", type.name, summary.c_str());
  if (!a.json.empty()) write_json(out, a.json);
  return unsafe == 0 ? 0 : 1;
}

}  // namespace

void add_campaign(Subcommand app) {
  const Subcommand command =
      app.subcommand("campaign",
                     "Runs a fault-injection campaign: every fault in every phase of a simulated run")
          .example("equipoise campaign --config config/mbbr.toml --seeds 3 --fault imu_off");
  auto a = std::make_shared<CampaignArguments>();
  command.option("--config", a->config, "robot configuration").file().required();
  command.option("--seeds", a->seeds, "runs per case").show_default().range(1, 1000);
  command.option("--seed", a->seed, "seed of the first run; each robot and run takes the next")
      .show_default();
  command.option("--fidelity", a->fidelity, "the simulated world").show_default();
  command.option("--controller", a->controller,
                 "which controller balances (default: the robot's): " + known_controllers());
  command.option("--robot", a->robot, "first robot of the population; 0: the typical one").show_default();
  command.option("--robots", a->robots, "number of robots of the population").show_default().range(1, 100000);
  std::vector<std::string> faults;
  faults.reserve(kFaults.size());
  for (const FaultInfo& fault : kFaults) faults.emplace_back(fault.name);
  command.option("--fault", a->faults, "only these faults").one_of(faults);
  command.option("--phase", a->phases, "only these phases").one_of({kPhaseNames.begin(), kPhaseNames.end()});
  command.option("--set", a->set, "override a configuration key");
  command.option("--jobs", a->jobs, "threads; 0: one per core. The results do not depend on it")
      .show_default()
      .range(0, 1024);
  command.option("--after-s", a->after_s, "how long a run goes on after its fault; 0: until 5.5 s")
      .show_default()
      .range(0.0, 3600.0);
  command.option("--soak-hours", a->soak_h, "random runs afterwards, hours of robot time")
      .show_default()
      .range(0.0, 10000.0);
  command.option("--json", a->json, "cases as JSON, - for stdout").file();
  command.action([=] { return campaign(*a); });
}

}  // namespace equipoise::app
