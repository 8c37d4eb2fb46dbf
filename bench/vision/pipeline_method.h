#pragma once

#include <memory>

#include "bench/vision/vision_method.h"
#include "sensing/core/link_model.h"

namespace taclink {

/// The product, or a variant of it that works less.
enum class PipelineVariant {
  kWhole,      ///< as it runs: markers are followed in small windows
  kAcquiring,  ///< the full pictures are searched in every frame
  kHalf,       ///< pictures and cameras of half the resolution; making them is not counted
  kOneCamera,  ///< the bottom camera fails once the rest shape is known
};

std::unique_ptr<VisionMethod> MakePipelineMethod(const LinkModel& model, PipelineVariant variant);

}  // namespace taclink
