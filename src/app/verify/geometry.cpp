#include "app/import/wheel_order.hpp"
#include "app/verify/rows.hpp"
#include "robots/mbbr/omniwheels.hpp"

namespace equipoise::app {

void add_geometry(Subcommand app) {
  const Subcommand command =
      app.subcommand("geometry", "Omniwheel placement: tilt, axes, load, torque shares; does a model agree")
          .example("equipoise geometry --alpha-deg 60");
  auto alpha_deg = std::make_shared<double>(60.0);
  auto azimuth_deg = std::make_shared<double>(-140.0);
  auto tilt_deg = std::make_shared<double>(std::nan(""));
  auto axes = std::make_shared<std::vector<double>>();
  auto json = std::make_shared<std::string>();
  command.option("--alpha-deg", *alpha_deg, "wheel latitude from the ball's north pole, 35.27 to 89")
      .required()
      .range(35.27, 89.0);
  command.option("--azimuth-deg", *azimuth_deg, "rotation of all wheels about the vertical")
      .show_default()
      .range(-180.0, 180.0);
  command.option("--tilt-deg", *tilt_deg, "of the axes about the contact's normal; default: orthogonal axes")
      .range(-90.0, 90.0);
  command.option(
      "--axes", *axes,
      "the wheels' axes as x y z, wheel 1 first, as measured or of a 3-D model: names a wrong order, sign "
      "or azimuth (exit status 1)");
  command.option("--json", *json, "output file, - for stdout").file();
  command.action([=] {
    const double degrees = kPi / 180.0;
    const double alpha = *alpha_deg * degrees;
    const double beta = std::isnan(*tilt_deg) ? orthogonal_beta_rad(alpha) : *tilt_deg * degrees;
    const Mat3 T_ob = wheel_axes(alpha, beta, *azimuth_deg * degrees);
    nlohmann::json matrix = nlohmann::json::array();
    for (int i = 0; i < 3; ++i) matrix.push_back(array_of(T_ob.row(i).transpose()));
    const double yaw_share = T_ob(2, 0);
    if (!axes->empty() && axes->size() != 9)
      throw InputError("--axes wants x y z of three wheels: nine numbers");
    const std::string mistake =
        axes->empty() ? "" : wheel_order(T_ob, Eigen::Map<const Mat3>(axes->data())).mistake;
    const nlohmann::json result{
        {"alpha_deg", *alpha_deg},
        {"mistake", axes->empty() ? nlohmann::json(nullptr) : nlohmann::json(mistake)},
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
    if (!mistake.empty()) std::fprintf(stderr, "error: the axes do not agree%s\n", mistake.c_str());
    return mistake.empty() ? 0 : 1;
  });
}

}  // namespace equipoise::app
