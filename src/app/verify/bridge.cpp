#include "app/verify/rows.hpp"
#include "equipoise/actuate/drive_coast.hpp"

namespace equipoise::app {
namespace {

nlohmann::json evaluate(const nlohmann::json& row) {
  const double T_r = number_at(row, "T_r");
  const double omega_r = number_at(row, "omega_r");
  if (T_r < 0.0) throw InputError("T_r: must not be negative");
  if (std::abs(omega_r) > 1.0) throw InputError("omega_r: allowed: -1 to 1");
  nlohmann::json out{{"T_r", T_r}, {"omega_r", omega_r}};
  if (row.contains("u")) {
    const double u = number_at(row, "u");
    if (std::abs(u) > 1.0) throw InputError("u: allowed: -1 to 1");
    out["u"] = u;
    out["i_over_is"] = drive_coast_mean_current(T_r, omega_r, u);
  } else {
    const double target = number_at(row, "i_over_is");
    const DriveCoastSolution solution = drive_coast_invert(T_r, omega_r, target);
    out["i_over_is"] = target;
    out["u"] = solution.u;
    out["iterations"] = solution.iterations;
    out["reachable"] = solution.reachable;
  }
  return out;
}

}  // namespace

void add_bridge(Subcommand app) {
  const Subcommand command =
      app.subcommand("bridge", "Mean current of a drive/coast bridge, and its inverse, on rows of JSON")
          .example("equipoise bridge --in rows.json --json -");
  add_rows(command, "rows of {T_r, omega_r, u} or {T_r, omega_r, i_over_is}", [] { return evaluate; });
}

}  // namespace equipoise::app
