#include "bench/command/bench_json.h"

#include "bench/vision/vision_report.h"

namespace taclink::command {
namespace {

Json ErrorsJson(const ErrorSums& sums) {
  Json json = {{"markers", sums.count}};
  const std::array<std::pair<const char*, ErrorAxis>, kErrorAxes> axes = {
      {{"r", ErrorAxis::kR}, {"phi_r", ErrorAxis::kPhiR}, {"z", ErrorAxis::kZ}, {"3d", ErrorAxis::k3d}}};
  for (const auto& [name, axis] : axes)
    json[name] = {{"rmse_mm", sums.Rms(axis)}, {"worst_mm", sums.Worst(axis)}};
  return json;
}

Json LabelsJson(const LabelCounts& counts) {
  return {{"visible", counts.visible},
          {"labelled", counts.labelled},
          {"wrong", counts.wrong},
          {"stray", counts.stray},
          {"missing", counts.missing}};
}

Json PercentilesJson(const std::vector<float>& samples) {
  return {{"p50", Percentile(samples, 0.5)},
          {"p90", Percentile(samples, 0.9)},
          {"p99", Percentile(samples, 0.99)}};
}

Json NeesJson(const VisionScore& score) {
  constexpr std::array<const char*, kSourceCount> kSources = {"both", "top", "bottom", "inferred"};
  Json json = Json::object();
  for (size_t i = 0; i < kSourceCount; ++i) {
    const Consistency c = ConsistencyOf(score.nees[i]);
    if (c.count == 0) continue;
    json[kSources[i]] = {
        {"markers", c.count}, {"mean", c.mean}, {"trimmed_mean", c.trimmed}, {"median", c.median}};
  }
  return json;
}

Json ScoreJson(const VisionScore& score) {
  const auto mean = [&](double squares) {
    return score.split_count == 0
               ? 0
               : std::sqrt(std::max(0.0, squares) / static_cast<double>(score.split_count));
  };
  const auto errors = [](const std::array<ErrorSums, 3>& by_cameras) {
    return Json{{"both", ErrorsJson(by_cameras[2])},
                {"one", ErrorsJson(by_cameras[1])},
                {"none", ErrorsJson(by_cameras[0])}};
  };
  const auto status = [&](LinkStatus s) { return score.statuses[static_cast<size_t>(s)]; };
  return {{"frames", score.frames},
          {"measured", score.measured},
          {"status",
           {{"ok", status(LinkStatus::kOk)},
            {"degraded", status(LinkStatus::kDegraded)},
            {"lost", status(LinkStatus::kLost)},
            {"calibrating", status(LinkStatus::kCalibrating)}}},
          {"position", errors(score.position)},
          {"displacement", errors(score.displacement)},
          {"systematic_mm", mean(score.systematic)},
          {"random_mm", mean(score.random)},
          {"labels", {{"top", LabelsJson(score.labels[0])}, {"bottom", LabelsJson(score.labels[1])}}},
          {"nees", NeesJson(score)},
          {"cpu_ms",
           {{"decode", PercentilesJson(score.times.decode)},
            {"detect", PercentilesJson(score.times.detect)},
            {"label", PercentilesJson(score.times.label)},
            {"shape", PercentilesJson(score.times.shape)},
            {"vision", PercentilesJson(score.times.vision)},
            {"whole", PercentilesJson(score.times.whole)}}}};
}

Json MethodJson(const std::vector<SceneOutcome>& outcomes, size_t method, const VisionMethodKind& kind) {
  Json json = {{"name", kind.name},
               {"description", kind.description},
               {"all", ScoreJson(SumScores(outcomes, method))},
               {"by_model", Json::object()},
               {"by_category", Json::object()}};
  for (const SceneOutcome& outcome : outcomes) {
    if (!json["by_model"].contains(outcome.model))
      json["by_model"][outcome.model] =
          ScoreJson(SumScores(outcomes, method, [&](const auto& o) { return o.model == outcome.model; }));
    if (!json["by_category"].contains(Name(outcome.category)))
      json["by_category"][Name(outcome.category)] = ScoreJson(
          SumScores(outcomes, method, [&](const auto& o) { return o.category == outcome.category; }));
  }
  return json;
}

}  // namespace

Json BenchJson(const std::vector<SceneOutcome>& outcomes, const std::vector<VisionMethodKind>& methods,
               uint64_t seed) {
  Json json = {{"seed", seed},
               {"truth_refinement", kVisionTruthRefinement},
               {"methods", Json::array()},
               {"scenes", Json::array()}};
  for (size_t i = 0; i < methods.size(); ++i) json["methods"].push_back(MethodJson(outcomes, i, methods[i]));
  for (const SceneOutcome& outcome : outcomes) {
    Json scene = {{"name", outcome.name},
                  {"category", Name(outcome.category)},
                  {"model", outcome.model},
                  {"frames", outcome.frames},
                  {"methods", Json::object()}};
    for (size_t i = 0; i < methods.size(); ++i) {
      Json score = ScoreJson(outcome.scores[i]);
      score["worst_frame"] = outcome.incidents[i].worst_frame;
      score["worst_marker"] = outcome.incidents[i].worst_marker;
      score["wrong_labels"] = outcome.incidents[i].labels;
      scene["methods"][methods[i].name] = score;
    }
    json["scenes"].push_back(scene);
  }
  return json;
}

}  // namespace taclink::command
