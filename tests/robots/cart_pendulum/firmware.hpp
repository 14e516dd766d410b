// The cart-pendulum's words and configuration reader. In: TOML -> out: what the pipeline and the world take.
// Tests only.
#pragma once

#include "app/trial/firmware_of.hpp"
#include "config/common_config.hpp"
#include "robots/cart_pendulum/world.hpp"
#include "support/trial.hpp"

namespace equipoise {

struct CartPendulumConfig {
  CartPendulumParameters robot;
  MotorParameters motor;
  Calibration calibration;
  CartPendulumEstimators::Params estimators;
  CartPendulumReferenceStage::Params reference;
  CartPendulumFeedback::Params feedback;
  SafetyParams safety;
  AttitudeFilterParams attitude;
  WorldParams world;
};

struct CartPendulumFirmware {
  using Robot = CartPendulum;
  using Config = CartPendulumConfig;
  using Loaded = equipoise::Loaded<CartPendulumConfig>;
  using World = CartPendulumWorld;
  static constexpr const char* kName = "cart_pendulum";
  static constexpr const char* kDefaultEstimator = "complementary";
  static constexpr const char* kDefaultController = "lqr";
  static constexpr const char* kSpeedRmseKey = "wheel_speed_rmse_rad_s";
  static constexpr const char* kSpeedLabel = "wheel speed RMSE";
  static constexpr const char* kSpeedUnit = "rad/s";
  static constexpr double kSpeedScale = 1.0;
  static constexpr bool kDrivesSideways = false;
  static constexpr double kForward_rad = 0.0;

  static Loaded load(const std::string& path, const Overrides& overrides) {
    return read(config::Document(path, overrides));
  }
  static Loaded parse(const std::string& text, const std::string& origin,
                      const std::vector<std::string>& set = {}) {
    return read(config::Document::parse(text, origin, set));
  }
  static std::vector<std::string> estimators() {
    return {CartPendulumEstimators::kNames.begin(), CartPendulumEstimators::kNames.end()};
  }
  static std::vector<std::string> controllers() { return {"lqr"}; }
  static double rolling_radius_m(const Config& c) { return c.robot.wheel_radius_m; }

  static Config apply(const Config& configured, const app::Choice& choice) {
    Config config = configured;
    if (choice.estimator == "truth") config.estimators.active = CartPendulumEstimators::Id::kTruth;
    config.estimators.compare = choice.compare;
    return config;
  }

  template <class F>
  static auto with_pipeline(const Config& c, const std::string& /*controller*/, F&& f) {
    CartPendulumPipeline pipeline({c.robot, c.calibration, c.estimators, c.reference, c.feedback,
                                   FrictionCompensation{}, c.motor, c.safety, c.attitude});
    return f(pipeline);
  }

  static World world(const Config& config, std::size_t /*level*/, std::uint64_t seed) {
    WorldParams params = config.world;
    params.seed = seed;
    return World(config.robot, config.motor, config.calibration, params);
  }

 private:
  static Loaded read(const config::Document& document) {
    config::Section root(document, document.root(), "");
    Loaded loaded;
    Config& c = loaded.config;
    config::Section robot = root.table("robot");
    config::expect_robot(robot, kName);
    robot.text("type");
    c.robot.cart_mass_kg = robot.number("cart_mass_kg", 0.01, 100.0);
    c.robot.pendulum_mass_kg = robot.number("pendulum_mass_kg", 0.01, 100.0);
    c.robot.com_height_m = robot.number("com_height_m", 0.005, 5.0);
    c.robot.inertia_kg_m2 = robot.number("inertia_kg_m2", 1e-7, 100.0);
    c.robot.wheel_radius_m = robot.number("wheel_radius_m", 0.002, 1.0);
    robot.finish();
    c.motor = config::read_motor(root.table("motor"));
    c.calibration = config::read_calibration(root.table("calibration"), CartPendulum::kWheels);
    config::Section estimator = root.table("estimator");
    c.estimators.gyro_weight = estimator.number("gyro_weight", 0.5, 1.0);
    estimator.finish();
    config::Section reference = root.table("reference");
    c.reference.max_acceleration_m_s2 = reference.number("max_acceleration_m_s2", 0.01, 100.0);
    c.reference.wheel_radius_m = c.robot.wheel_radius_m;
    reference.finish();
    config::Section controller = root.table("controller");
    c.feedback.lean = controller.number("lean", -1e3, 1e3);
    c.feedback.wheel = controller.number("wheel", -1e3, 1e3);
    c.feedback.lean_rate = controller.number("lean_rate", -1e3, 1e3);
    c.feedback.wheel_rate = controller.number("wheel_rate", -1e3, 1e3);
    controller.finish();
    c.safety = config::read_safety(root.table("safety"));
    c.attitude = config::read_attitude(root.table("attitude"), Vec3::Zero());
    BridgeType bridge{};
    c.world = config::read_world(root.table("world"), &bridge);
    root.finish();
    loaded.sha256 = document.sha256();
    loaded.toml = document.canonical();
    return loaded;
  }
};

template <>
inline std::string config_file<CartPendulumFirmware>() {
  return std::string(EQUIPOISE_SOURCE_DIR) + "/tests/robots/cart_pendulum/cart_pendulum.toml";
}

template <>
inline const app::RobotType& type_of<CartPendulumFirmware>() {
  return app::ConfiguredRobotOf<CartPendulumFirmware>::robot_type();
}

}  // namespace equipoise
