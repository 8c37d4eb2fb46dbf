#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "client/command/commands.h"
#include "client/command/json.h"
#include "client/command/marker_csv.h"
#include "client/command/picture_solver.h"
#include "sensing/model/model_file.h"
#include "sensing/shape/inference.h"

namespace taclink::command {
namespace {

struct SolveOptions {
  std::string model;
  std::string markers;
  std::vector<std::string> rest, images;
  std::string calibration;
  double pressure_kpa = 0;
  double sigma_mm = 0.05;
  std::string force_model = "auto";
  int force_refinement = 0;
  bool json = false;
};

// None: auto.
std::optional<ForceModel> ForceModelNamed(const std::string& name) {
  for (const ForceModel model : kForceModels) {
    if (name == Name(model)) return model;
  }
  return std::nullopt;
}

Json SigmasJson(const std::optional<Mat3>& covariance) {
  return covariance ? ToJson(Sigmas(*covariance)) : Json(nullptr);
}

Json ContactJson(const Contact& contact) {
  return {{"center_mm", ToJson(contact.center_mm)},
          {"normal", ToJson(contact.normal)},
          {"force_n", ToJson(contact.force_n)},
          {"force_sigma_n", SigmasJson(contact.force_covariance_n2)},
          {"center_sigma_mm", SigmasJson(contact.center_covariance_mm2)},
          {"normal_force_n", contact.normal_force_n},
          {"area_mm2", contact.area_mm2}};
}

void PrintJson(const LinkModel& model, const LinkState& state) {
  Json contacts = Json::array();
  for (const auto& contact : state.contacts) contacts.push_back(ContactJson(contact));
  const StageTimes& t = state.stage_ms;
  const Json out = {
      {"model", model.name},
      {"force_model", Name(state.forces.model)},
      {"markers", {{"seen", state.shape.seen()}, {"inferred", state.shape.CountOf(MarkerSource::kInferred)}}},
      {"contacts", contacts},
      {"total_force_n", ToJson(state.total_force_n)},
      {"positions_mm", ToJson(state.shape.positions_mm)},
      {"nodal_forces_n", ToJson(state.forces.forces_n)},
      {"time_ms",
       {{"detect", t.decode + t.detect},
        {"register", t.register_},
        {"reconstruct", t.reconstruct},
        {"force", t.force}}}};
  std::puts(out.dump().c_str());
}

void PrintText(const LinkModel& model, const LinkState& state) {
  std::printf("%s: %d of %d markers seen, force model %s\n", model.name.c_str(), state.shape.seen(),
              model.markers.count(), Name(state.forces.model));
  if (state.contacts.empty()) std::puts("no contact");
  for (const auto& c : state.contacts) {
    std::printf("contact at (%.1f, %.1f, %.1f) mm: %.3f N inwards, force (%.3f, %.3f, %.3f) N, %.0f mm2\n",
                c.center_mm.x(), c.center_mm.y(), c.center_mm.z(), c.normal_force_n, c.force_n.x(),
                c.force_n.y(), c.force_n.z(), c.area_mm2);
  }
}

Result<LinkState> SolveMarkers(const SolveOptions& options, const LinkModel& model) {
  auto shape = ReadMarkerCsv(options.markers, model, options.sigma_mm);
  if (!shape) return shape.error();
  LinkState state;
  state.shape = std::move(*shape);
  InferUnseen(model, {.mpa = options.pressure_kpa * 1e-3}, state.shape);
  const auto estimator = MakeForceEstimator(
      model, {.model = ForceModelNamed(options.force_model), .refinement = options.force_refinement});
  ContactFinder finder(model);
  const int64_t start = SystemClock().MonotonicNs();
  estimator->Estimate(state.shape, options.pressure_kpa * 1e-3, state.forces);
  finder.Find(state.shape, state.forces, state.contacts);
  state.stage_ms.force = static_cast<double>(SystemClock().MonotonicNs() - start) * 1e-6;
  for (const auto& contact : state.contacts) state.total_force_n += contact.force_n;
  return state;
}

Result<LinkState> SolvePictures(const SolveOptions& options, const LinkModel& model) {
  PipelineOptions pipeline_options;
  pipeline_options.force.model = ForceModelNamed(options.force_model);
  pipeline_options.force.refinement = options.force_refinement;
  const auto solver = PictureSolver::Make(model, pipeline_options, options.calibration, options.rest);
  if (!solver) return solver.error();
  auto state = (*solver)->Solve(options.images, options.pressure_kpa * 1e-3);
  if (state && !state->measured()) {
    return Error{ErrorCode::kInvalidArgument, "the pictures can't be solved: " + state->status_reason};
  }
  return state;
}

Result<void> Solve(const SolveOptions& options) {
  const auto model = LoadLinkModel(options.model);
  if (!model) return model.error();
  const auto state = options.markers.empty() ? SolvePictures(options, *model) : SolveMarkers(options, *model);
  if (!state) return state.error();
  if (state->status != LinkStatus::kOk && !state->status_reason.empty()) {
    std::fprintf(stderr, "taclink: worse than it could be: %s\n", state->status_reason.c_str());
  }
  if (options.json) {
    PrintJson(*model, *state);
  } else {
    PrintText(*model, *state);
  }
  return {};
}

}  // namespace

void AddSolve(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<SolveOptions>();
  const Arguments command =
      app.AddCommand("solve", "Contacts and forces from marker displacements or from pictures");
  command.AddOption("--model", options->model, "Link model: a shipped name or a YAML file").Required();
  const Option markers = command.AddOption("--markers", options->markers,
                                           "CSV with columns path,ring,ux,uy,uz (from 1; mm, link frame)");
  const Option rest =
      command.AddOption("--rest", options->rest, "TOP and BOTTOM picture of the untouched skin").Expected(2);
  const Option images =
      command.AddOption("--images", options->images, "TOP and BOTTOM picture to solve").Expected(2);
  command.AddOption("--calibration", options->calibration, "Camera parameters; without, found from --rest")
      .Needs(rest);
  rest.Needs(images).Excludes(markers);
  images.Needs(rest).Excludes(markers);
  command.AddOption("--pressure-kpa", options->pressure_kpa, "Gauge pressure inside the skin")
      .Must(Within(-20, 20));
  command
      .AddOption("--sigma-mm", options->sigma_mm,
                 "With --markers: their standard deviation in x and y; z: 3 times")
      .Must(Within(1e-4, 10));
  command.AddOption("--force-model", options->force_model, "auto: the cheapest that is good enough")
      .Must(OneOf({"auto", "literal", "linear", "pressurised", "nonlinear"}));
  command
      .AddOption("--force-refinement", options->force_refinement,
                 "Elements per interval of the marker grid; 0: what the model does best with")
      .Must(Between(0, 3));
  command.AddFlag("--json", options->json, "One JSON object");
  command.OnChosen([options, markers, images, &selected] {
    if (!markers.IsGiven() && !images.IsGiven()) {
      RefuseMissing("--markers, or --rest and --images");
    }
    selected = [options] { return Solve(*options); };
  });
}

}  // namespace taclink::command
