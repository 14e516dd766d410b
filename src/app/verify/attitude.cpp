#include "app/verify/rows.hpp"
#include "equipoise/sense/attitude_filter.hpp"

namespace equipoise::app {

void add_attitude(Subcommand app) {
  const Subcommand command = app.subcommand("attitude", "Runs our attitude filter on rows of IMU samples")
                                 .example("equipoise attitude --in samples.json --json -");
  auto params = std::make_shared<AttitudeFilterParams>();
  auto rate_hz = std::make_shared<double>(kTickHz);
  auto arm = std::make_shared<std::vector<double>>(3, 0.0);
  command.option("--rate-hz", *rate_hz, "sample rate of the rows, Hz").show_default().range(10.0, 10e3);
  command.option("--lever-arm-m", *arm, "from the point that moves least to the IMU: x y z").count(3);
  command
      .option("--accel-time-constant-s", params->accel_time_constant_s,
              "over which the specific force is averaged")
      .show_default()
      .range(0.1, 100.0);
  add_rows(command,
           "rows {gyro_rad_s, accel_m_s2}, body axes, specific force; mag, any unit, optional; becomes "
           "{q_wxyz, gyro_bias_rad_s}",
           [=] {
             params->tick_s = 1.0 / *rate_hz;
             params->lever_arm_B_m = Eigen::Map<const Vec3>(arm->data());
             return [filter = AttitudeFilter(*params)](const nlohmann::json& row) mutable -> nlohmann::json {
               filter.update(numbers_at(row, "gyro_rad_s", 3), numbers_at(row, "accel_m_s2", 3));
               if (row.contains("mag")) filter.update_magnetometer(numbers_at(row, "mag", 3));
               const Eigen::Quaterniond q = filter.q_EB();
               return {{"q_wxyz", {q.w(), q.x(), q.y(), q.z()}},
                       {"gyro_bias_rad_s", array_of(filter.gyro_bias_B_rad_s())}};
             };
           });
}

}  // namespace equipoise::app
