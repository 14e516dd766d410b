#include "python/simulated.hpp"

namespace equipoise::python {
namespace {

struct MbbrAccess {
  using Reference = MbbrReference;

  static std::vector<std::string> error_names() {
    return {"theta_x", "theta_y",   "theta_dot_x", "theta_dot_y", "phi_x",
            "phi_y",   "phi_dot_x", "phi_dot_y",   "theta_z",     "yaw_rate"};
  }
  static std::vector<std::string> reference_names() {
    return {"reference_phi_dot_x", "reference_phi_dot_y", "reference_yaw_rate"};
  }
  static Vec<10> error(const MbbrReference& r) {
    Vec<10> e;
    e << r.d_theta, r.d_rate, r.d_phi, r.d_phi_dot, r.d_theta_z, r.d_yaw_rate;
    return e;
  }
  static Vec3 wanted(const MbbrReference& r) {
    Vec3 w;
    w << r.phi_dot_star, r.yaw_rate;
    return w;
  }
  static nlohmann::json dimensions(const MbbrParameters& nominal, const MbbrWorldParams& world) {
    const MbbrParameters p = without_loose_wheels(as_built(nominal, world.common.actual), world.drive);
    return {{"body_mass_kg", p.m_t},
            {"com_height_m", p.l},
            {"body_inertia_kg_m2", {p.I_t1, p.I_t2, p.I_t3}},
            {"ball_mass_kg", p.m_b},
            {"ball_radius_m", p.r},
            {"ball_inertia_kg_m2", p.I_b},
            {"wheel_inertia_about_ball_kg_m2", p.I_w},
            {"wheel_radius_m", p.r_w},
            {"wheel_axes", columns_of(p.wheel_axes())},
            {"wheel_contacts", columns_of(wheel_contacts(p))},
            {"imu_position_m", {p.l_a.x(), p.l_a.y(), p.l_a.z()}},
            {"floor_grip", world.floor.grip},
            {"floor_torsion_radius_m", world.floor.torsion_radius_m},
            {"floor_slope_rad", {world.common.floor_slope_rad.x(), world.common.floor_slope_rad.y()}},
            {"step_s", world.common.step_s}};
  }
  static nlohmann::json columns_of(const Mat3& matrix) {
    nlohmann::json columns;
    for (const auto& c : matrix.colwise()) columns.push_back({c.x(), c.y(), c.z()});
    return columns;
  }
  static MbbrEstimate estimate(const StateView& v, const MbbrParameters&) {
    MbbrEstimate x;
    (void)recall(v, &x);
    x.normalized_innovation = v.normalized_innovation;
    return x;
  }
};

}  // namespace

const Simulated& simulated_as(MbbrFirmware) {
  static const SimulatedOf<MbbrFirmware, MbbrAccess> robot;
  return robot;
}

}  // namespace equipoise::python
