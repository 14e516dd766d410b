#include "python/simulated.hpp"

namespace equipoise::python {
namespace {

struct MipAccess {
  using Reference = MipReference;

  static std::vector<std::string> error_names() {
    return {"theta", "theta_dot", "phi", "phi_dot", "psi", "psi_dot"};
  }
  static std::vector<std::string> reference_names() { return {"reference_phi_dot", "reference_psi_dot"}; }
  static Vec<6> error(const MipReference& r) {
    Vec<6> e;
    e << r.d_theta, r.d_theta_dot, r.d_phi, r.d_phi_dot, r.d_psi, r.d_psi_dot;
    return e;
  }
  static Vec2 wanted(const MipReference& r) { return {r.phi_dot, r.psi_dot}; }
  static nlohmann::json dimensions(const MipParameters& nominal, const MipWorldParams& world) {
    const MipParameters p = as_built(nominal, world.common.actual);
    return {{"body_mass_kg", p.m_b},
            {"com_height_m", p.l},
            {"body_inertia_kg_m2", {p.I_b1, p.I_b2, p.I_b3}},
            {"wheel_mass_kg", p.m_w},
            {"wheel_radius_m", p.r},
            {"track_m", p.d},
            {"wheel_inertia_kg_m2", {p.I_w1, p.I_w2, p.I_w3}},
            {"rotor_inertia_kg_m2", p.I_r},
            {"imu_position_m", {p.l_a.x(), p.l_a.y(), p.l_a.z()}},
            {"floor_slope_rad", {world.common.floor_slope_rad.x(), world.common.floor_slope_rad.y()}},
            {"step_s", world.common.step_s}};
  }
  static MipEstimate estimate(const StateView& v, const MipParameters&) {
    MipEstimate x;
    x.theta = v.theta_rad.x();
    x.phi = v.phi_rad.x();
    x.psi = v.theta_rad.z();
    x.theta_dot = v.omega_B_rad_s.x();
    x.phi_dot = v.phi_dot_rad_s.x();
    x.psi_dot = v.omega_B_rad_s.z() / std::cos(x.theta);
    x.position_W_m = v.position_W_m;
    x.normalized_innovation = v.normalized_innovation;
    return x;
  }
};

}  // namespace

const Simulated& simulated_as(MipFirmware) {
  static const SimulatedOf<MipFirmware, MipAccess> robot;
  return robot;
}

}  // namespace equipoise::python
