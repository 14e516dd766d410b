#include <cstdio>

#include "app/cli/commands.hpp"
#include "app/cli/progress.hpp"
#include "app/design/analysis.hpp"

namespace equipoise::app {
namespace {

struct Arguments {
  DesignRequest request;
  std::string json;
};

nlohmann::json with_progress(DesignRequest request) {
  Progress progress("design");
  request.progress = [&progress](double share) { progress.at(share); };
  return design(request);
}

void print_complex(const char* name, const nlohmann::json& list) {
  std::printf("%s", name);
  for (const nlohmann::json& value : list) {
    std::printf("  %.5g", value[0].get<double>());
    if (std::abs(value[1].get<double>()) > 1e-9) std::printf("%+.3gi", value[1].get<double>());
  }
  std::printf("\n");
}

/// Of the scheduled or LQR design; what one controller has and the other has not is in the JSON.
void print_gains(const nlohmann::json& d) {
  std::printf("yaw, Hz  u = -K (tilt, travel, their rates; u before)\n");
  for (const nlohmann::json& row : d["rows"]) {
    std::printf("%7.2f  ", row["yaw_hz"].get<double>());
    print_complex("K    ", row["lqr"]["K"]);
    print_complex("         poles", row["lqr"]["poles"]);
  }
}

void print(const nlohmann::json& d) {
  std::printf("%s, %s on %s\n", d["robot"].get<std::string>().c_str(),
              d["controller"].get<std::string>().c_str(), d["estimator"].get<std::string>().c_str());
  print_gains(d);
  std::printf("yaw, Hz  broken at       gain, dB        phase, deg   delay margin, ms  disk\n");
  for (const nlohmann::json& row : d["rows"]) {
    for (const char* place : kBrokenAt) {
      const nlohmann::json& m = row["margins"][place];
      std::printf("%7.2f  %-9s  %+7.1f  %+7.1f    %10.1f  %17.1f  %5.2f%s\n", row["yaw_hz"].get<double>(),
                  place, -std::fabs(m["gain_down_dB"].get<double>()), m["gain_up_dB"].get<double>(),
                  m["phase_deg"].get<double>(), m["delay_ms"].get<double>(), m["disk"].get<double>(),
                  row["stable"].get<bool>() ? "" : "  UNSTABLE");
    }
  }
}

}  // namespace

void add_design(Subcommand app) {
  const Subcommand command =
      app.subcommand("design",
                     "Gains of a configuration, and the margins of the loop with filter and delays in it")
          .example("equipoise design --config config/mbbr.toml --last-hz 2");
  auto a = std::make_shared<Arguments>();
  DesignRequest& r = a->request;
  command.option("--config", r.config, "robot configuration, TOML").file().required();
  command.option("--set", r.set, "override a configuration key");
  command.option("--estimator", r.estimator, "filter in the loop (default: ekf)");
  command.option("--controller", r.controller, "mbbr: thesis, scheduled; mip: slc, lqr");
  command.option("--last-hz", r.last_hz, "highest yaw rate").show_default().range(0.0, 10.0);
  command.option("--step-hz", r.step_hz, "step between yaw rates").show_default().range(0.01, 10.0);
  command.flag("--bode", r.bode, "with the frequency responses, in the JSON");
  command.option("--json", a->json, "output file, - for stdout").file();
  command.action([a] {
    const nlohmann::json design = with_progress(a->request);
    if (!a->json.empty()) write_json(design, a->json);
    if (a->json != "-") print(design);
    return 0;
  });
}

}  // namespace equipoise::app
