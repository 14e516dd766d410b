// Everything the MBBR is configured with, read from one strict TOML file.
// In: path, overrides -> out: typed parameters; ConfigError otherwise. Start-up only.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "equipoise/overrides.hpp"
#include "equipoise/pipeline.hpp"
#include "robots/common/config.hpp"
#include "robots/mbbr/estimators.hpp"
#include "robots/mbbr/reference.hpp"
#include "robots/mbbr/scheduled_feedback.hpp"
#include "robots/mbbr/thesis_feedback.hpp"
#include "robots/mbbr/world.hpp"

namespace equipoise {

using MbbrThesisPipeline = Pipeline<Mbbr, MbbrEstimators, MbbrReferenceStage, MbbrThesisFeedback>;
using MbbrScheduledPipeline = Pipeline<Mbbr, MbbrEstimators, MbbrReferenceStage, MbbrScheduledFeedback>;
// Compiled in pipeline.cpp.
extern template class Pipeline<Mbbr, MbbrEstimators, MbbrReferenceStage, MbbrThesisFeedback>;
extern template class Pipeline<Mbbr, MbbrEstimators, MbbrReferenceStage, MbbrScheduledFeedback>;

struct MbbrConfig : CommonConfig {
  MbbrParameters robot;
  MbbrEstimatorParams estimators;
  MbbrReferenceParams reference;
  MbbrThesisFeedbackParams thesis;
  MbbrDesignParams design;
  MbbrScheduledFeedbackParams scheduled;
  std::array<MbbrWorldParams, kFidelities> world;  // by Fidelity

  MbbrThesisPipeline::Params thesis_pipeline() const;
  MbbrScheduledPipeline::Params scheduled_pipeline() const;
};

Loaded<MbbrConfig> load_mbbr(const std::string& path, const Overrides& overrides);
/// From text, e.g. of a log; `origin` names it in errors. `set`: as of --set.
Loaded<MbbrConfig> parse_mbbr(const std::string& text, const std::string& origin,
                              const std::vector<std::string>& set = {});

}  // namespace equipoise
