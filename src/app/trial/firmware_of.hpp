// Firmware, world and configuration of one robot behind their interfaces. In: the robot's types (a struct of
// robots/robot_list.hpp) -> out: Firmware, World, ConfiguredRobot. Included where a robot is instantiated, by
// tests that bring one of their own, and by what wraps a pipeline (src/python).
#pragma once

#include <algorithm>
#include <utility>

#include "app/trial/firmware.hpp"
#include "equipoise/pipeline.hpp"

namespace equipoise::app {

template <class Robot, class Simulated = typename Robot::World>
class WorldOf : public World {
 public:
  WorldOf(const typename Robot::Config& config, const Choice& choice, std::uint64_t seed)
      : world(Robot::world(config, fidelity_level(choice.fidelity), seed)), robot_(config.robot) {}
  WorldOf(const typename Robot::Config& config, const Simulated& built)
      : world(built), robot_(config.robot) {}

  void advance(const MotorCommand& command) override { world.advance(command); }
  RawSample sense() override { return world.sense(); }
  void without_attitude() noexcept override { world.without_attitude(); }
  double time_s() const noexcept override { return world.time_s(); }
  StateView truth() const noexcept override { return view(world.truth(), robot_); }

  Simulated world;

 private:
  typename Robot::Robot::Parameters robot_;
};

template <class Robot, class Pipeline, class Simulated = typename Robot::World>
class FirmwareOf : public Firmware {
 public:
  /// What the estimators of a tick are given beside its samples.
  struct Given {
    typename Pipeline::Input u;
    bool held;
  };

  explicit FirmwareOf(const typename Pipeline::Params& params) : pipeline_(params) {}
  /// Its estimators take what those of another, which ticks first, were given.
  FirmwareOf(const typename Pipeline::Params& params, const FirmwareOf& leader)
      : pipeline_(params), leader_(&leader) {}

  runtime::TickRecord tick(const RawSample& raw, const Command& asked,
                           const LoopState& loop) noexcept override {
    if (leader_ != nullptr) pipeline_.applied(leader_->given_.u, leader_->given_.held);
    given_ = {pipeline_.applied(), pipeline_.held()};
    runtime::TickRecord record{};
    record.now_ns = loop.now_ns;
    record.raw = raw;
    record.velocity_W_m_s = {asked.velocity_W_m_s.x(), asked.velocity_W_m_s.y()};
    record.yaw_rate_rad_s = asked.yaw_rate_rad_s;
    record.arm = asked.arm;
    record.heading_reset = asked.heading_reset;
    record.command_age_s = asked.age_s;
    add(pipeline_.tick(raw, asked, loop), &record);
    return record;
  }

  bool runs(std::size_t estimator) const noexcept override {
    return pipeline_.estimators().runs(static_cast<typename Estimators::Id>(estimator));
  }
  bool reads_attitude() const noexcept override { return pipeline_.estimators().reads_attitude(); }
  StateErrors errors_of(const StateView& x, const StateView& truth) const noexcept override {
    return errors(x, truth, parameters());
  }
  void observe_truth(const World& world) noexcept override {
    if (!pipeline_.estimators().runs(Estimators::Id::kTruth)) return;
    pipeline_.estimators().observe_truth(static_cast<const WorldOf<Robot, Simulated>&>(world).world.truth());
  }
  void observe_truth(const runtime::StateRecord& logged) noexcept override {
    Estimate truth;
    if (recall(runtime::to_view(logged), &truth)) pipeline_.estimators().observe_truth(truth);
  }

  Pipeline& pipeline() noexcept { return pipeline_; }

 private:
  using Estimate = typename Robot::Robot::Estimate;
  using Estimators = std::decay_t<decltype(std::declval<Pipeline&>().estimators())>;
  static constexpr int kInputs = Robot::Robot::kInputs;
  static constexpr int kWheels = Robot::Robot::kWheels;
  static_assert(Estimators::kCount <= runtime::kMaxEstimators, "make room in TickRecord::others");
  static_assert(kInputs > 0 && kInputs <= 3, "make room in TickRecord::u_lin");
  static_assert(kWheels > 0 && kWheels <= kMaxMotors, "make room in rio_motors_t");

  const typename Robot::Robot::Parameters& parameters() const noexcept { return pipeline_.params().robot; }

  void add(const typename Pipeline::Result& t, runtime::TickRecord* record) const noexcept {
    record->inhibit = t.inhibit;
    record->estimate = runtime::to_record(view(t.x_hat, parameters()));
    record->reference = runtime::to_record(view(t.ref, parameters()));
    for (std::size_t i = 0; i < Estimators::kCount; ++i) {
      if (!runs(i)) continue;
      const auto id = static_cast<typename Estimators::Id>(i);
      record->others[i] = runtime::to_record(view(pipeline_.estimators().estimate(id), parameters()));
      if (pipeline_.params().estimators.compare) record->compared |= 1U << i;
    }
    std::copy_n(t.u_lin.data(), kInputs, record->u_lin.begin());
    std::copy_n(t.u_friction.data(), kInputs, record->u_friction.begin());
    record->motors = t.motors;
    record->motor_count = kWheels;
    record->saturated = t.saturated;
    record->arm_state = static_cast<std::int32_t>(t.arm_state);
    record->reasons = t.reasons;
    record->degraded = t.degraded;
    record->faults = t.faults;
    record->battery_V = t.z.battery_V;
  }

  Pipeline pipeline_;
  const FirmwareOf* leader_ = nullptr;
  Given given_{};
};

template <class Robot>
class ConfiguredRobotOf : public ConfiguredRobot {
 public:
  explicit ConfiguredRobotOf(typename Robot::Loaded loaded) : config(std::move(loaded.config)) {
    type = &robot_type();
    sha256 = std::move(loaded.sha256);
    toml = std::move(loaded.toml);
    keys = std::move(loaded.keys);
    calibration = config.calibration;
    safety = config.safety;
    rolling_radius_m = Robot::rolling_radius_m(config);
    max_acceleration_m_s2 = config.reference.max_acceleration_m_s2;
  }

  std::unique_ptr<Firmware> firmware(const Choice& choice) const override {
    return Robot::with_pipeline(Robot::apply(config, choice), choice.controller, [](auto& own) {
      using Own = std::decay_t<decltype(own)>;
      return std::unique_ptr<Firmware>(std::make_unique<FirmwareOf<Robot, Own>>(own.params()));
    });
  }
  std::unique_ptr<World> world(const Choice& choice, std::uint64_t seed) const override {
    return std::make_unique<WorldOf<Robot>>(Robot::apply(config, choice), choice, seed);
  }
  Retuning retuning(const Choice& choice, const ConfiguredRobot& changed,
                    const Choice& changed_choice) const override {
    const auto other = Robot::apply(static_cast<const ConfiguredRobotOf&>(changed).config, changed_choice);
    return Robot::with_pipeline(Robot::apply(config, choice), choice.controller, [&](auto& own) {
      using Own = std::decay_t<decltype(own)>;
      return Robot::with_pipeline(other, choice.controller, [&](auto& another) -> Retuning {
        if constexpr (std::is_same_v<std::decay_t<decltype(another)>, Own>) {
          auto params = another.params();
          params.safety.encoder_check_drive = 0.0;  // no encoder could answer what shakes the wheels
          auto recorded = std::make_unique<FirmwareOf<Robot, Own>>(own.params());
          auto follower = std::make_unique<FirmwareOf<Robot, Own>>(params, *recorded);
          return {std::move(recorded), std::move(follower)};
        } else {
          return {};  // one controller is one type
        }
      });
    });
  }

  /// The robot's entry in the list of types.
  static const RobotType& robot_type() {
    static const RobotType type{
        Robot::kName,
        Robot::estimators(),
        Robot::controllers(),
        Robot::kDefaultEstimator,
        Robot::kDefaultController,
        Robot::kSpeedRmseKey,
        Robot::kSpeedLabel,
        Robot::kSpeedUnit,
        Robot::kSpeedScale,
        Robot::kDrivesSideways,
        Robot::kForward_rad,
        [](const std::string& path, const Overrides& overrides) -> std::unique_ptr<const ConfiguredRobot> {
          return std::make_unique<ConfiguredRobotOf>(Robot::load(path, overrides));
        },
        [](const std::string& text, const std::string& origin,
           const std::vector<std::string>& set) -> std::unique_ptr<const ConfiguredRobot> {
          return std::make_unique<ConfiguredRobotOf>(Robot::parse(text, origin, set));
        }};
    return type;
  }

  typename Robot::Config config;
};

}  // namespace equipoise::app
