// Prints the rows of tests/accuracy/report.csv: accuracy_report markers|images. deploy/accuracy runs it.
#include <cstdio>
#include <string_view>

#include "tests/accuracy/solid_images.h"
#include "tests/accuracy/solid_markers.h"

namespace taclink {
namespace {

void PrintMarkerRows(const std::vector<SolidScene>& scenes) {
  const LinkModel model = SolidSkin();
  StateEstimator estimator(model, {});
  for (const MarkerCondition& condition : kMarkerConditions) {
    for (const SolidScene& scene : scenes)
      std::printf("%s\n", CsvLine(SolveSolidMarkers(scene, condition, estimator)).c_str());
  }
}

void PrintImageRows(const std::vector<SolidScene>& scenes) {
  for (const SolidScene& scene : scenes) std::printf("%s\n", CsvLine(SolveSolidImages(scene)).c_str());
}

}  // namespace
}  // namespace taclink

int main(int argc, char** argv) {
  const std::string_view what = argc == 2 ? argv[1] : "";
  const auto scenes = taclink::ReadSolidScenes();
  if (scenes.empty() || (what != "header" && what != "markers" && what != "images")) {
    std::fprintf(stderr, "accuracy_report header|markers|images; %zu scenes in tests/accuracy/calculix\n",
                 scenes.size());
    return 2;
  }
  if (what == "header") std::printf("%s\n", taclink::CsvHeader().c_str());
  if (what == "markers") taclink::PrintMarkerRows(scenes);
  if (what == "images") taclink::PrintImageRows(scenes);
  return 0;
}
