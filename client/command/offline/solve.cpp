#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "client/command/cli/commands.h"
#include "client/command/cli/json.h"
#include "client/command/offline/gravity.h"
#include "client/command/offline/marker_csv.h"
#include "client/command/offline/picture_solver.h"
#include "client/cpp/taclink/values.h"
#include "sensing/model/model_file.h"
#include "sensing/pipeline/marker_solve.h"

namespace taclink::command {
namespace {

struct SolveOptions {
  std::string model;
  std::string markers;
  std::vector<std::string> rest, images;
  std::string calibration;
  std::optional<double> pressure_kpa;
  double baseline_pressure_kpa = 0;
  std::optional<double> pressure_sigma_pa;
  std::optional<double> sigma_mm;
  std::string gravity, baseline_gravity;
  double gravity_sigma_mps2 = 0.2;
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
          {"moment_nm", ToJson(Vec3(1e-3 * contact.moment_nmm))},
          {"peak_pressure_kpa", 1e3 * contact.peak_pressure_mpa},
          {"outline_mm", ToJson(contact.outline_mm)},
          {"major_axis_mm", ToJson(contact.major_axis_mm)},
          {"minor_axis_mm", ToJson(contact.minor_axis_mm)},
          {"area_mm2", contact.area_mm2}};
}

bool IsInvalid(const LinkState& state) {
  return !state.measured() || !state.forces.converged;
}

// In this command's units.
Json ReasonJson(const Reason& reason) {
  const ReasonUnit unit = TraitsOf(reason.id).unit;
  const double kpa = unit == ReasonUnit::kMegapascals ? 1e3 : 1;
  const char* name = unit == ReasonUnit::kMillimeters   ? "mm"
                     : unit == ReasonUnit::kMegapascals ? "kPa"
                     : unit == ReasonUnit::kSeconds     ? "s"
                     : unit == ReasonUnit::kHertz       ? "Hz"
                                                        : "";
  return {{"id", Name(reason.id)},
          {"text", reason.text},
          {"value", reason.value ? Json(kpa * *reason.value) : Json(nullptr)},
          {"limit", reason.limit ? Json(kpa * *reason.limit) : Json(nullptr)},
          {"unit", name}};
}

Json ValidityJson(const LinkState& state) {
  Json reasons = Json::array();
  for (const Reason& reason : state.reasons) reasons.push_back(ReasonJson(reason));
  const char* status = IsInvalid(state) ? "invalid" : state.reasons.empty() ? "ok" : "degraded";
  return {{"status", status}, {"reasons", reasons}};
}

// Both cameras' of one marker are one.
std::vector<int> RejectedMarkers(const SkinShape& shape) {
  std::vector<int> markers;
  for (const RejectedMarker& rejected : shape.rejected) {
    if (markers.empty() || markers.back() != rejected.marker) markers.push_back(rejected.marker);
  }
  return markers;
}

Json RejectedJson(const LinkModel& model, const SkinShape& shape) {
  Json rejected = Json::array();
  for (const int marker : RejectedMarkers(shape))
    rejected.push_back({{"path", model.PathOf(marker) + 1}, {"ring", model.RingOf(marker) + 1}});
  return rejected;
}

Json PressureJson(const LinkState& state) {
  if (!state.pressure_estimate) return nullptr;
  return Json::array({1e3 * state.pressure_estimate->mpa, 1e3 * state.pressure_estimate->sigma_mpa});
}

Json SpecificForceJson(const LinkState& state) {
  if (!state.specific_force_estimate) return nullptr;
  return {{"value", ToJson(state.specific_force_estimate->mps2)},
          {"sigma", ToJson(Sigmas(state.specific_force_estimate->covariance))}};
}

void PrintJson(const LinkModel& model, const LinkState& state) {
  Json contacts = Json::array();
  for (const auto& contact : state.contacts) contacts.push_back(ContactJson(contact));
  const StageTimes& t = state.stage_ms;
  const Json out = {
      {"model", model.name},
      {"force_model", Name(state.forces.model)},
      {"markers",
       {{"seen", state.shape.seen()},
        {"inferred", state.shape.CountOf(MarkerSource::kInferred)},
        {"rejected", RejectedJson(model, state.shape)}}},
      {"validity", ValidityJson(state)},
      {"converged", state.forces.converged},
      {"residual_chi2_per_dof",
       state.has_forces() ? Json(state.forces.residual * state.forces.residual) : Json(nullptr)},
      {"camera_shift_mm", state.has_forces() ? Json(state.forces.camera_shift_mm) : Json(nullptr)},
      {"pressure_estimate_kpa", PressureJson(state)},
      {"specific_force_estimate_mps2", SpecificForceJson(state)},
      {"contacts", contacts},
      {"total_force_n", state.has_forces() ? ToJson(state.total_force_n) : Json(nullptr)},
      {"detection_limits_n", state.has_forces() ? Json(state.forces.limits_n) : Json(nullptr)},
      {"detection_limit_around_n", state.has_forces() && !state.forces.limits_n.empty()
                                       ? Json(state.forces.limit_around_n)
                                       : Json(nullptr)},
      {"positions_mm", ToJson(state.shape.positions_mm)},
      {"nodal_forces_n", state.has_forces() ? ToJson(state.forces.forces_n) : Json(nullptr)},
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

double SigmaMpa(const SolveOptions& options) {
  return 1e-6 * options.pressure_sigma_pa.value_or(1e6 * PressureSigma(PressureOrigin::kFile));
}

Result<LoadsPair> ParseLoads(const SolveOptions& options, const LinkModel& model) {
  const double baseline_kpa = options.baseline_pressure_kpa;
  LoadsPair loads;
  loads.now = {1e-3 * options.pressure_kpa.value_or(baseline_kpa), SigmaMpa(options)};
  loads.baseline = {1e-3 * baseline_kpa, baseline_kpa == 0 ? 0 : SigmaMpa(options)};
  if (options.gravity.empty() != options.baseline_gravity.empty())
    return Error{ErrorCode::kInvalidArgument,
                 "--gravity and --baseline-gravity go together: give both, either may be 'unknown'"};
  if (auto good = CheckWeight(model, options.gravity); !good) return good.error();
  if (options.gravity.empty()) return loads;
  if (auto good = TakeGravity(options.gravity, options.gravity_sigma_mps2, loads.now); !good)
    return good.error();
  if (auto good = TakeGravity(options.baseline_gravity, options.gravity_sigma_mps2, loads.baseline); !good)
    return good.error();
  return loads;
}

Result<LinkState> SolveMarkerFile(const SolveOptions& options, const LinkModel& model) {
  auto shape = ReadMarkerCsv(options.markers, model, options.sigma_mm);
  if (!shape) return shape.error();
  const auto estimator = MakeStateEstimator(
      model, {.model = ForceModelNamed(options.force_model), .refinement = options.force_refinement});
  const auto loads = ParseLoads(options, model);
  if (!loads) return loads.error();
  const int64_t start = SystemClock().MonotonicNs();
  LinkState state =
      SolveMarkers(model, *estimator, *loads, std::move(*shape), options.pressure_kpa.has_value());
  state.stage_ms.force = static_cast<double>(SystemClock().MonotonicNs() - start) * 1e-6;
  return state;
}

Result<LinkState> SolvePictures(const SolveOptions& options, const LinkModel& model) {
  PipelineOptions pipeline_options;
  pipeline_options.force.model = ForceModelNamed(options.force_model);
  pipeline_options.force.refinement = options.force_refinement;
  pipeline_options.pressure_sigma_mpa = SigmaMpa(options);
  const auto loads = ParseLoads(options, model);
  if (!loads) return loads.error();
  const auto reading = [&](const MeasuredLoads& one) -> std::optional<SpecificForceReading> {
    if (options.gravity.empty()) return std::nullopt;
    return SpecificForceReading{one.specific_force_mps2, one.specific_force_covariance};
  };
  const auto solver = PictureSolver::Make(model, pipeline_options, options.calibration, options.rest,
                                          reading(loads->baseline), loads->baseline.pressure_mpa);
  if (!solver) return solver.error();
  std::optional<double> pressure_mpa;
  if (options.pressure_kpa) pressure_mpa = 1e-3 * *options.pressure_kpa;
  return (*solver)->Solve(options.images, pressure_mpa, reading(loads->now));
}

Result<void> Solve(const SolveOptions& options) {
  const auto model = LoadLinkModel(options.model);
  if (!model) return model.error();
  const auto state =
      options.markers.empty() ? SolvePictures(options, *model) : SolveMarkerFile(options, *model);
  if (!state) return state.error();
  const bool invalid = IsInvalid(*state);
  if (!invalid) {
    for (const Reason& reason : state->reasons)
      std::fprintf(stderr, "taclink: worse than it could be: %s (%s)\n", reason.text.c_str(),
                   Name(reason.id));
  }
  for (const int marker : RejectedMarkers(state->shape))
    std::fprintf(stderr, "taclink: marker of path %d, ring %d left out: it contradicts the others\n",
                 model->PathOf(marker) + 1, model->RingOf(marker) + 1);
  if (options.json) {
    PrintJson(*model, *state);
  } else if (!invalid) {
    PrintText(*model, *state);
  }
  if (invalid)
    return Error{ErrorCode::kFailedPrecondition, "there is no valid answer: " + state->status_reason};
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
  command
      .AddOption("--pressure-kpa", options->pressure_kpa,
                 "Gauge pressure inside the skin; without, the answer is not quite to be trusted")
      .Must(Within(-20, 20));
  command
      .AddOption(
          "--baseline-pressure-kpa", options->baseline_pressure_kpa,
          "Gauge pressure under which the baseline was taken, from which displacements count: that of --rest")
      .Must(Within(-20, 20));
  command
      .AddOption("--pressure-sigma-pa", options->pressure_sigma_pa,
                 "Standard deviation of these pressures; 50 Pa if not given")
      .Must(Within(0.01, 1e5));
  command
      .AddOption(
          "--sigma-mm", options->sigma_mm,
          "With --markers: their standard deviation in x and y; z: 3 times; told by themselves if not given")
      .Must(Within(1e-4, 10));
  const Option gravity = command.AddOption(
      "--gravity", options->gravity,
      "X,Y,Z: specific force in the link's frame (m/s^2, the direction in which things fall), or unknown");
  command
      .AddOption("--baseline-gravity", options->baseline_gravity,
                 "Likewise, of the attitude in which the baseline was taken")
      .Needs(gravity);
  command
      .AddOption("--gravity-sigma", options->gravity_sigma_mps2,
                 "Standard deviation of each component of these, m/s^2")
      .Must(Within(0, 100))
      .ShowDefault()
      .Needs(gravity);
  command.AddOption("--force-model", options->force_model, "auto: the cheapest that is good enough")
      .Must(OneOf(client::Names<v1::ForceModel>()));
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
