#include "bench/thesis/thesis_method.h"
#include "bench/vision/pipeline_method.h"
#include "bench/vision/vision_method.h"

namespace taclink {

const std::vector<VisionMethodKind>& VisionMethodKinds() {
  const auto pipeline = [](PipelineVariant variant) {
    return [variant](const LinkModel& model) { return MakePipelineMethod(model, variant); };
  };
  static const std::vector<VisionMethodKind> kinds = {
      {"tracked", "ours as it runs", pipeline(PipelineVariant::kWhole)},
      {"acquiring", "ours, the full pictures searched in every frame", pipeline(PipelineVariant::kAcquiring)},
      // At 320x240 the far rings can't be told apart: rest pictures are refused and nothing is measured.
      {"half", "ours, pictures of half the width and height", pipeline(PipelineVariant::kHalf), false},
      {"one-camera", "ours, the bottom camera fails after the rest frames",
       pipeline(PipelineVariant::kOneCamera)},
      {"thesis", "chapter 4 of the thesis as written", MakeThesisMethod},
  };
  return kinds;
}

}  // namespace taclink
