#include "app/log/replay_as.hpp"

namespace equipoise::app {

void ReplayErrors::add(const runtime::StateRecord& x, const runtime::StateRecord& truth) {
  const auto square = [](double a) { return a * a; };
  for (std::size_t i = 0; i < 2; ++i) {
    attitude += square(x.theta_rad[i] - truth.theta_rad[i]) / 2.0;
    rate += square(x.phi_dot_rad_s[i] - truth.phi_dot_rad_s[i]) / 2.0;
    position += square(x.position_W_m[i] - truth.position_W_m[i]);
  }
  ++ticks;
}

nlohmann::json ReplayErrors::json(double radius_m) const {
  if (ticks == 0) return nullptr;
  const auto n = static_cast<double>(ticks);
  return {{"attitude_rmse_rad", std::sqrt(attitude / n)},
          {"rolling_rate_rmse_rad_s", std::sqrt(rate / n)},
          {"rolling_speed_rmse_m_s", radius_m * std::sqrt(rate / n)},
          {"position_rmse_m", std::sqrt(position / n)},
          {"ticks", ticks}};
}

nlohmann::json Retuned::Figures::json(std::int64_t ticks, double radius_m) const {
  if (ticks == 0) return nullptr;
  const auto n = static_cast<double>(ticks);
  return {{"errors", errors.json(radius_m)},
          {"duty_rms", std::sqrt(duty_squared / n)},
          {"normalized_innovation_mean", innovation / n},
          {"saturated_fraction", static_cast<double>(saturated) / n}};
}

Replay replay_log(RunLog& log, const std::string& origin, const Beside& beside) {
  return with_robot(log.run().robot, origin,
                    [&](auto firmware) { return replay_as<decltype(firmware)>(log, origin, beside); });
}

}  // namespace equipoise::app
