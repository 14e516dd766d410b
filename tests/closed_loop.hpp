// A robot through loop, pipeline and world, one tick at a time, so that a test can interfere with the sample
// or the command in between. The MBBR with its default controller: ClosedLoop.
#pragma once

#include <string>

#include "app/io/plant_backend.hpp"
#include "app/trial/firmware.hpp"
#include "equipoise/runtime/loop.hpp"
#include "support/config_files.hpp"
#include "support/stepped_io.hpp"

namespace equipoise {

inline MbbrConfig mbbr_config() { return load_mbbr(config_file<MbbrFirmware>(), {}).config; }

struct ClosedLoopOptions {
  Fidelity fidelity = Fidelity::kNominal;
  std::uint64_t seed = 1;
  std::string estimator = "ekf";
  bool compare = false;

  std::size_t level() const { return static_cast<std::size_t>(fidelity); }
  app::Choice choice() const { return {estimator, "", kFidelityNames[level()], compare}; }
};

inline MbbrThesisPipeline::Params pipeline_params(const MbbrConfig& config, const MbbrThesisPipeline*) {
  return config.thesis_pipeline();
}
inline MbbrScheduledPipeline::Params pipeline_params(const MbbrConfig& config, const MbbrScheduledPipeline*) {
  return config.scheduled_pipeline();
}
inline MipSlcPipeline::Params pipeline_params(const MipConfig& config, const MipSlcPipeline*) {
  return config.slc_pipeline();
}
inline MipLqrPipeline::Params pipeline_params(const MipConfig& config, const MipLqrPipeline*) {
  return config.lqr_pipeline();
}

template <class Pipeline, class Firmware = MbbrFirmware>
class ClosedLoopWith {
 public:
  using Config = typename Firmware::Config;
  using World = typename Firmware::World;
  using Result = typename Pipeline::Result;

  explicit ClosedLoopWith(const ClosedLoopOptions& options = {},
                          const Config& configured = Firmware::load(config_file<Firmware>(), {}).config)
      : config(Firmware::apply(configured, options.choice())),
        world(Firmware::world(config, options.level(), options.seed)),
        pipeline(pipeline_params(config, static_cast<const Pipeline*>(nullptr))),
        backend_(world),
        hardware_(backend_.io()) {}

  /// One tick; `interfere(RawSample&, Command&)` runs between sensors and pipeline.
  template <class Interfere>
  Result step(const Command& command, Interfere&& interfere) {
    Command asked = command;
    const auto spoil = [&](RawSample& raw) { interfere(raw, asked); };
    const auto commands = [&](std::int64_t, std::int64_t) {
      pipeline.estimators().observe_truth(world.truth());
      return asked;
    };
    Result last;
    const auto keep = [&last](std::int64_t, std::int64_t, const RawSample&, const Command&, const Result& t) {
      last = t;
    };
    SteppedIo io(hardware_, 1, spoil);
    (void)runtime::run_loop(io, pipeline, commands, keep, never_);
    return last;
  }

  Result step(const Command& command) {
    return step(command, [](RawSample&, Command&) {});
  }

  Result run(double seconds, const Command& command) {
    Result last = step(command);
    for (int i = 1; i < static_cast<int>(seconds * kTickHz); ++i) last = step(command);
    return last;
  }

  /// Half a second at rest to learn the tilt, then balancing.
  Result balance(double seconds) {
    run(0.5, Command{});
    return run(seconds, armed());
  }

  static Command armed() {
    Command command;
    command.arm = true;
    return command;
  }

  const Config config;
  World world;
  Pipeline pipeline;

 private:
  app::PlantBackend backend_;
  app::Hardware hardware_;
  const std::atomic<bool> never_{false};
};

using ClosedLoop = ClosedLoopWith<MbbrScheduledPipeline>;

}  // namespace equipoise
