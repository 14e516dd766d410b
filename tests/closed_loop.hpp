// The MBBR through pipeline and world, one tick at a time, so that a test can interfere with the sample or
// the command in between. With the default controller: ClosedLoop.
#pragma once

#include <string>

#include "app/evaluate/mbbr_rig.hpp"

namespace equipoise {

inline MbbrConfig mbbr_config() {
  return load_mbbr(std::string(EQUIPOISE_SOURCE_DIR) + "/config/mbbr.toml", {}).config;
}

template <class Pipeline>
class ClosedLoopWith {
 public:
  using Result = typename Pipeline::Result;

  explicit ClosedLoopWith(const app::MbbrRigOptions& options = {}, const MbbrConfig& config = mbbr_config())
      : rig(config, options), hardware_(rig.backend.io()) {}

  /// `interfere(RawSample&, Command&)` runs between sensors and pipeline.
  template <class Interfere>
  Result tick(Command command, Interfere&& interfere) {
    std::int64_t now_ns = 0;
    hardware_.wait_tick(&now_ns);
    RawSample raw = hardware_.read();
    interfere(raw, command);
    rig.pipeline.estimators().observe_truth(rig.world.truth());
    const Result result = rig.pipeline.tick(raw, command);
    hardware_.write(result.motors);
    return result;
  }

  Result tick(const Command& command) {
    return tick(command, [](RawSample&, Command&) {});
  }

  Result run(double seconds, const Command& command) {
    Result last = tick(command);
    for (int i = 1; i < static_cast<int>(seconds * kTickHz); ++i) last = tick(command);
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

  app::MbbrRigWith<Pipeline> rig;

 private:
  app::Hardware hardware_;
};

using ClosedLoop = ClosedLoopWith<MbbrScheduledPipeline>;

}  // namespace equipoise
