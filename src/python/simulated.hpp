// The body of Simulated for one robot. In: Firmware, and Access, which says its errors as a vector and its
// estimate from the robot-neutral state -> out: SimulatedOf. Included by robot_*.cpp only.
#pragma once

#include "app/sim/simulated_run.hpp"
#include "app/trial/firmware_of.hpp"
#include "equipoise/sense/calibrate.hpp"
#include "python/hooks.hpp"
#include "python/simulation.hpp"

namespace equipoise::python {

template <class Firmware, class Access>
class SimulatedOf : public Simulated {
 public:
  using Robot = typename Firmware::Robot;
  using World = typename Firmware::World;
  using Config = typename Firmware::Config;
  using Input = Vec<Robot::kInputs>;
  using Reference = typename Access::Reference;
  using Configured = app::ConfiguredRobotOf<Firmware>;

  int wheels() const override { return Robot::kWheels; }
  int inputs() const override { return Robot::kInputs; }
  std::vector<std::string> error_names() const override { return Access::error_names(); }
  std::vector<std::string> observation_names() const override {
    std::vector<std::string> names = Access::error_names();
    for (const std::string& name : Access::reference_names()) names.push_back(name);
    return names;
  }
  std::vector<std::string> estimators() const override { return Firmware::estimators(); }
  std::vector<std::string> controllers() const override { return Firmware::controllers(); }

  nlohmann::json run(app::SimRequest request, const Hooks& hooks, Recorder* recorder,
                     const app::TickObserver& observe, const std::atomic<bool>& stop) const override {
    const auto robot = app::load_for(&request);
    const auto options = app::options_for(request, *robot);
    const app::TickObserver record = [&](const runtime::TickRecord& tick) {
      recorder->add(tick);
      observe(tick);
    };
    const app::TickObserver& each = recorder != nullptr ? record : observe;
    const auto simulate = [&] {
      if (!hooks.any()) return app::simulate(*robot, request.choice, options, each, stop);
      const Config config = Firmware::apply(static_cast<const Configured&>(*robot).config, request.choice);
      app::WorldOf<Firmware> world(config, request.choice, options.seed);
      return hooked_run<World>(world, *robot, config, request.choice, options, hooks, each, stop);
    };
    const app::SimSummary summary = simulate();
    nlohmann::json out = app::to_json(request, summary, *robot);
    out["config_toml"] = robot->toml;
    return out;
  }

  nlohmann::json dimensions(app::SimRequest request) const override {
    const auto robot = app::load_for(&request);
    const Config config = Firmware::apply(static_cast<const Configured&>(*robot).config, request.choice);
    return Access::dimensions(config.robot, config.world[fidelity_level(request.choice.fidelity)]);
  }

  nlohmann::json run_in_engine(app::SimRequest request, const MakeEngine& make, const Hooks& hooks,
                               const std::atomic<bool>& stop) const override {
    using EngineWorld = typename Firmware::EngineWorld;
    std::vector<config::Drawn> drawn;
    const auto robot = app::load_for(&request, &drawn);
    const Config config = Firmware::apply(static_cast<const Configured&>(*robot).config, request.choice);
    auto params = config.world[fidelity_level(request.choice.fidelity)];
    params.common.seed = request.seed;
    const auto engine = make(Access::dimensions(config.robot, params));
    app::WorldOf<Firmware, EngineWorld> world(
        config, EngineWorld(config.robot, config.motor, config.calibration, params, *engine));
    const app::SimSummary summary = hooked_run<EngineWorld>(
        world, *robot, config, request.choice, app::options_for(request, *robot), hooks, {}, stop);
    nlohmann::json out = app::figures(*robot->type, summary);
    out["excluded_healthy"] = (summary.degraded & kSensorsJudged) != 0;
    out["drawn"] = app::by_name(drawn);
    return out;
  }

  std::function<std::unique_ptr<Episode>(std::uint64_t)> episodes(app::SimRequest request,
                                                                  const MakeEngine& make) const override {
    const std::shared_ptr<const app::ConfiguredRobot> robot = app::load_for(&request);
    const Config config = Firmware::apply(static_cast<const Configured&>(*robot).config, request.choice);
    return [request, robot, config, make](std::uint64_t seed) {
      app::SimRequest seeded = request;
      seeded.seed = seed;
      return Firmware::with_pipeline(
          config, seeded.choice.controller, [&](auto& own) -> std::unique_ptr<Episode> {
            using Own = std::decay_t<decltype(own)>;
            if (make)
              return std::make_unique<EpisodeOf<Own, EngineEpisode>>(*robot, config, seeded, own.params(),
                                                                     make);
            return std::make_unique<EpisodeOf<Own, OwnEpisode>>(*robot, config, seeded, own.params());
          });
    };
  }

  void calibrate(const std::string& toml, const std::vector<RawSample>& raw, double* out) const override {
    const Calibration calibration = Firmware::parse(toml, "the log", {}).config.calibration;
    for (const RawSample& sample : raw) {
      const auto z = equipoise::calibrate<Robot::kWheels>(sample, calibration);
      for (const Vec3& v : {z.gyro_B_rad_s, z.accel_B_m_s2, z.attitude_rad}) {
        for (int i = 0; i < 3; ++i) *out++ = v(i);
      }
      *out++ = z.battery_V;
      for (int i = 0; i < Robot::kWheels; ++i) *out++ = z.wheel_angle_rad(i);
    }
  }

 private:
  /// What is handed on as it was is not rounded on the way.
  static bool same(const StateView& a, const StateView& b) {
    return a.theta_rad == b.theta_rad && a.omega_B_rad_s == b.omega_B_rad_s && a.phi_rad == b.phi_rad &&
           a.phi_dot_rad_s == b.phi_dot_rad_s && a.position_W_m == b.position_W_m &&
           a.normalized_innovation == b.normalized_innovation;
  }

  template <class AnyWorld>
  static app::SimSummary hooked_run(app::WorldOf<Firmware, AnyWorld>& world,
                                    const app::ConfiguredRobot& robot, const Config& config,
                                    const app::Choice& choice, const app::SimOptions& options,
                                    const Hooks& hooks, const app::TickObserver& observe,
                                    const std::atomic<bool>& stop) {
    return Firmware::with_pipeline(config, choice.controller, [&](auto& own) {
      using Own = std::decay_t<decltype(own)>;
      using Pipeline = app::Hooked<Own>;
      const Pipeline* running = nullptr;
      app::FeedbackHook<Robot, Reference> feedback;
      if (hooks.controller) {
        feedback = [&](const Reference& reference, const app::OwnFeedback<Robot>& asked) -> Input {
          return hooks.controller({world.time_s(), view(running->estimators().controlling(), config.robot),
                                   view(reference, config.robot), Access::error(reference), asked()});
        };
      }
      app::FirmwareOf<Firmware, Pipeline, AnyWorld> firmware(app::hooked<Own>(own.params(), feedback));
      running = &firmware.pipeline();
      if (hooks.estimator) {
        firmware.pipeline().estimators().replace([&](const typename Robot::Sample& z, const Input& u,
                                                     bool held,
                                                     const typename Robot::Estimate& own_estimate) {
          const StateView own_view = view(own_estimate, config.robot);
          const StateView x = hooks.estimator({world.time_s(), held, z.gyro_B_rad_s, z.accel_B_m_s2,
                                               z.attitude_rad, z.imu_ok, z.encoders_ok, z.attitude_ok,
                                               z.wheel_angle_rad, z.wheel_rate_rad_s, u, own_view});
          return same(x, own_view) ? own_estimate : Access::estimate(x, config.robot);
        });
      }
      return app::SimulatedRun(world, firmware, robot, options, observe, stop).run();
    });
  }

  class OwnEpisode : public Episode {
   protected:
    using EpisodeWorld = World;
    OwnEpisode(const Config& config, const app::SimRequest& request)
        : world_(config, request.choice, request.seed) {}

    app::WorldOf<Firmware> world_;
  };

  class EngineEpisode : public Episode {
   protected:
    using EpisodeWorld = typename Firmware::EngineWorld;

    EngineEpisode(const Config& config, const app::SimRequest& request, const MakeEngine& make)
        : params_(config.world[fidelity_level(request.choice.fidelity)]),
          engine_((params_.common.seed = request.seed, make(Access::dimensions(config.robot, params_)))),
          world_(config, EpisodeWorld(config.robot, config.motor, config.calibration, params_, *engine_)) {}
    std::decay_t<decltype(Config::world[0])> params_;
    std::unique_ptr<Engine> engine_;
    app::WorldOf<Firmware, EpisodeWorld> world_;
  };

  /// Stands up under its own feedback; from then on the action takes its place.
  template <class Own, class Base>
  class EpisodeOf : public Base {
   public:
    template <class... Made>
    EpisodeOf(const app::ConfiguredRobot& robot, const Config& config, const app::SimRequest& request,
              const typename Own::Params& params, const Made&... made)
        : Base(config, request, made...),
          kinematics_(config.robot),
          firmware_(app::hooked<Own>(params,
                                     [this](const Reference& r, const app::OwnFeedback<Robot>& own) -> Input {
                                       reference_ = r;
                                       return acts_ ? u_ : own();
                                     })),
          run_(world_, firmware_, robot, options_of(robot, request), observe_, stop_) {
      while (world_.time_s() < app::kDriveFrom_s && run_.step()) {
      }
      acts_ = true;
    }

    bool step(const double* wheels) override {
      Vec<Robot::kWheels> drive;
      for (int i = 0; i < Robot::kWheels; ++i) drive(i) = wheels[i];
      u_ = kinematics_.axes_from_wheels(drive);
      return run_.step();
    }
    void observation(double* out) const override {
      const auto error = Access::error(reference_);
      const auto wanted = Access::wanted(reference_);
      out = std::copy(error.begin(), error.end(), out);
      std::copy(wanted.begin(), wanted.end(), out);
    }
    StateView truth() const override { return world_.truth(); }

   private:
    using Base::world_;

    static app::SimOptions options_of(const app::ConfiguredRobot& robot, const app::SimRequest& request) {
      app::SimOptions options = app::options_for(request, robot);
      options.figures = false;
      return options;
    }

    typename Robot::Kinematics kinematics_;
    Reference reference_{};
    Input u_ = Input::Zero();
    bool acts_ = false;
    app::FirmwareOf<Firmware, app::Hooked<Own>, typename Base::EpisodeWorld> firmware_;
    app::TickObserver observe_;
    std::atomic<bool> stop_{false};
    app::SimulatedRun run_;
  };
};

}  // namespace equipoise::python
