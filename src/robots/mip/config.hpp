// Everything the eduMIP is configured with, read from one strict TOML file.
// In: path, overrides -> out: typed parameters; ConfigError otherwise. Start-up only.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "equipoise/overrides.hpp"
#include "equipoise/pipeline.hpp"
#include "robots/common/config.hpp"
#include "robots/mip/estimators.hpp"
#include "robots/mip/lqr_feedback.hpp"
#include "robots/mip/reference.hpp"
#include "robots/mip/slc_feedback.hpp"
#include "robots/mip/world.hpp"

namespace equipoise {

using MipSlcPipeline = Pipeline<Mip, MipEstimators, MipReferenceStage, MipSlcFeedback>;
using MipLqrPipeline = Pipeline<Mip, MipEstimators, MipReferenceStage, MipLqrFeedback>;
// Compiled in pipeline.cpp.
extern template class Pipeline<Mip, MipEstimators, MipReferenceStage, MipSlcFeedback>;
extern template class Pipeline<Mip, MipEstimators, MipReferenceStage, MipLqrFeedback>;

struct MipConfig : CommonConfig {
  MipParameters robot;
  MipEstimatorParams estimators;
  MipReferenceParams reference;
  MipDesignParams design;
  MipSlcParams slc;
  MipLqrParams lqr;
  std::array<MipWorldParams, kFidelities> world;  // by Fidelity

  MipSlcPipeline::Params slc_pipeline() const;
  MipLqrPipeline::Params lqr_pipeline() const;
};

Loaded<MipConfig> load_mip(const std::string& path, const Overrides& overrides);
/// From text, e.g. of a log; `origin` names it in errors. `set`: as of --set.
Loaded<MipConfig> parse_mip(const std::string& text, const std::string& origin,
                            const std::vector<std::string>& set = {});

}  // namespace equipoise
