// Everything a robot is configured with, read from one strict TOML file.
// In: path, overrides -> out: typed parameters; ConfigError (file:line: key: reason and allowed range)
// otherwise. Start-up only.
#pragma once

#include <array>
#include <stdexcept>
#include <string>
#include <vector>

#include "equipoise/control/mbbr_reference.hpp"
#include "equipoise/control/mbbr_scheduled_feedback.hpp"
#include "equipoise/control/mbbr_thesis_feedback.hpp"
#include "equipoise/control/mip_lqr_feedback.hpp"
#include "equipoise/control/mip_slc_feedback.hpp"
#include "equipoise/estimate/mbbr_estimators.hpp"
#include "equipoise/estimate/mip_estimators.hpp"
#include "equipoise/pipeline.hpp"
#include "equipoise/plant/mbbr_world.hpp"
#include "equipoise/plant/mip_world.hpp"

namespace equipoise {

struct ConfigError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

inline const std::vector<std::string> kFidelityNames{"ideal", "thesis", "full"};

using MbbrThesisPipeline = Pipeline<Mbbr, MbbrEstimators, MbbrReferenceStage, MbbrThesisFeedback>;
using MbbrScheduledPipeline = Pipeline<Mbbr, MbbrEstimators, MbbrReferenceStage, MbbrScheduledFeedback>;

struct MbbrConfig {
  MbbrParameters robot;
  MotorParameters motor;
  Calibration calibration;
  FrictionCompensation friction;
  MbbrEstimatorParams estimators;
  MbbrReferenceParams reference;
  MbbrThesisFeedbackParams thesis;
  MbbrScheduledFeedbackParams scheduled;
  SafetyParams safety;
  AttitudeFilterParams attitude;
  std::array<MbbrWorldParams, 3> world;      // by Fidelity
  std::array<BridgeType, 3> world_bridge{};  // what the simulated robot is built with

  MbbrThesisPipeline::Params thesis_pipeline() const;
  MbbrScheduledPipeline::Params scheduled_pipeline() const;
};

using MipSlcPipeline = Pipeline<Mip, MipEstimators, MipReferenceStage, MipSlcFeedback>;
using MipLqrPipeline = Pipeline<Mip, MipEstimators, MipReferenceStage, MipLqrFeedback>;

struct MipConfig {
  MipParameters robot;
  MotorParameters motor;
  Calibration calibration;
  FrictionCompensation friction;
  MipEstimatorParams estimators;
  MipReferenceParams reference;
  MipSlcParams slc;
  MipLqrParams lqr;
  SafetyParams safety;
  AttitudeFilterParams attitude;
  std::array<MipWorldParams, 3> world;       // by Fidelity
  std::array<BridgeType, 3> world_bridge{};  // what the simulated robot is built with

  MipSlcPipeline::Params slc_pipeline() const;
  MipLqrPipeline::Params lqr_pipeline() const;
};

/// Name of the robot a file is for, without reading the rest.
std::string robot_type(const std::string& path);

struct LoadedMbbr {
  MbbrConfig config;
  std::string sha256;  // of the effective configuration
  std::string toml;    // the effective configuration
};
LoadedMbbr load_mbbr(const std::string& path, const std::vector<std::string>& overrides);
/// From text, e.g. of a log; `origin` names it in errors.
LoadedMbbr parse_mbbr(const std::string& text, const std::string& origin);

struct LoadedMip {
  MipConfig config;
  std::string sha256;
  std::string toml;
};
LoadedMip load_mip(const std::string& path, const std::vector<std::string>& overrides);
LoadedMip parse_mip(const std::string& text, const std::string& origin);

}  // namespace equipoise
