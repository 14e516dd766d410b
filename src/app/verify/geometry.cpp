#include "app/verify/rows.hpp"
#include "robots/mbbr/omniwheels.hpp"

namespace equipoise::app {

void add_geometry(Subcommand app) {
  const Subcommand command =
      app.subcommand("geometry", "Orthogonal omniwheel placement: tilt, axes, load, torque shares")
          .example("equipoise geometry --alpha-deg 60");
  auto alpha_deg = std::make_shared<double>(60.0);
  auto azimuth_deg = std::make_shared<double>(-140.0);
  auto json = std::make_shared<std::string>();
  command.option("--alpha-deg", *alpha_deg, "wheel latitude from the ball's north pole, 35.27 to 89")
      .required()
      .range(35.27, 89.0);
  command.option("--azimuth-deg", *azimuth_deg, "rotation of all wheels about the vertical")
      .show_default()
      .range(-180.0, 180.0);
  command.option("--json", *json, "output file, - for stdout").file();
  command.action([=] {
    const double degrees = kPi / 180.0;
    const double alpha = *alpha_deg * degrees;
    const double beta = orthogonal_beta_rad(alpha);
    const Mat3 T_ob = wheel_axes(alpha, beta, *azimuth_deg * degrees);
    nlohmann::json matrix = nlohmann::json::array();
    for (int i = 0; i < 3; ++i) matrix.push_back(array_of(T_ob.row(i).transpose()));
    const double yaw_share = T_ob(2, 0);
    const nlohmann::json result{{"alpha_deg", *alpha_deg},
                                {"beta_deg", beta / degrees},
                                {"azimuth_deg", *azimuth_deg},
                                {"T_ob", matrix},
                                {"orthonormality_error", (T_ob * T_ob.transpose() - Mat3::Identity()).norm()},
                                {"normal_force_over_weight", normal_force_over_weight(alpha)},
                                {"yaw_torque_share", yaw_share},
                                {"translation_torque_share", std::sqrt(1.0 - yaw_share * yaw_share)}};
    if (!json->empty()) {
      write_json(result, *json);
    } else {
      std::printf("alpha %.3f deg  beta %.3f deg\n", *alpha_deg, beta / degrees);
      for (int i = 0; i < 3; ++i) std::printf("  %9.5f %9.5f %9.5f\n", T_ob(i, 0), T_ob(i, 1), T_ob(i, 2));
      std::printf("wheel load / weight %.4f, torque share yaw %.4f, translation %.4f\n",
                  normal_force_over_weight(alpha), yaw_share, std::sqrt(1.0 - yaw_share * yaw_share));
    }
    return 0;
  });
}

}  // namespace equipoise::app
