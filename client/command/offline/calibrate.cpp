#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "client/command/cli/commands.h"
#include "client/command/cli/json.h"
#include "client/command/live/calibrate_link.h"
#include "client/command/live/parameter_table.h"
#include "client/command/offline/calibrate_material.h"
#include "client/command/offline/calibrate_picture.h"
#include "client/command/offline/gravity.h"
#include "client/cpp/taclink/values.h"
#include "sensing/camera/calibration_file.h"
#include "sensing/camera/calibration_parameters.h"
#include "sensing/capture/image_io.h"
#include "sensing/model/model_file.h"
#include "sensing/pipeline/picture_calibration.h"
#include "sensing/pipeline/state_estimator.h"

namespace taclink::command {
namespace {

struct CalibrateOptions {
  std::string model;
  std::vector<std::string> rest;  // top and bottom by turns
  std::string lens;
  std::string out;
  std::string residuals;
  double mould_tolerance_mm = BuildTolerance{}.marker_mm;
  double pressure_kpa = 0;
  std::string gravity;
  double gravity_sigma_mps2 = 0.2;
  bool json = false;
  std::string link_name;  // that the file is for
  bool each = false;
  LinkCalibration live;  // instead, if it names a link
};

// From all pairs together, and how single ones scatter.
struct Found {
  RestResult rest;
  std::vector<CalibrationParameter> parameters;
  size_t repeats = 1;
};

void PrintText(const LinkModel& model, const Found& found) {
  const RestResult& rest = found.rest;
  const CalibrationSummary& summary = rest.calibration;
  const auto& [top, bottom] = summary.cameras;
  std::printf("%s, %d rest pair%s, lens model %s\n\n", model.name.c_str(), summary.pairs,
              summary.pairs == 1 ? "" : "s", Name(top.camera.lens.kind));
  std::printf("                          top        bottom     both\n");
  std::printf("markers used       %10d    %10d %8d of %d\n", top.markers_used, bottom.markers_used,
              summary.markers_used, model.markers.count());
  std::printf("left out           %10d    %10d\n", top.outliers, bottom.outliers);
  std::printf("RMS, per axis   px %10.3f    %10.3f %8.3f\n\n", top.rms_px, bottom.rms_px, summary.rms_px);
  std::printf("Rest markers, triangulated, against the model: RMSE\n");
  std::printf("  R %.3f mm    phi*R %.3f mm    Z %.3f mm    3-D %.3f mm\n\n", summary.rmse_r_mm,
              summary.rmse_phi_r_mm, summary.rmse_z_mm, summary.rmse_3d_mm);
  if (!rest.loads.specific_force_covariance.isZero(0)) {
    const Vec3 &value = rest.loads.specific_force_mps2, sigma = Sigmas(rest.loads.specific_force_covariance);
    std::printf("Specific force      (%.2f, %.2f, %.2f) \u00b1 (%.2f, %.2f, %.2f) m/s2\n\n", value.x(),
                value.y(), value.z(), sigma.x(), sigma.y(), sigma.z());
  }
  std::fflush(stdout);
  PrintParameters(found.parameters, found.repeats);
}

Json CameraJson(const CameraCalibration& one) {
  const CameraModel& camera = one.camera;
  const CameraStep& s = one.sigmas;
  const int count = LensParameterCount(camera.lens.kind);
  const LensParameters lens = ParametersOf(camera.lens);
  Json k = Json::array(), k_sigma = Json::array();
  for (int i = 1; i < count; ++i) {
    k.push_back(lens[i]);
    k_sigma.push_back(s[8 + i]);
  }
  const Vec2& center = camera.lens.principal_point_px;
  return {{"markers_used", one.markers_used},
          {"outliers", one.outliers},
          {"rms_px", one.rms_px},
          {"lens", Name(camera.lens.kind)},
          {"position_mm", ToJson(Vec3(camera.camera_from_link.Inverse().translation))},
          {"focal_px", camera.lens.focal_px},
          {"principal_point_px", {center.x(), center.y()}},
          {"k", k},
          {"standard_deviations",
           {{"position_mm", ToJson(Vec3(s.segment<3>(3)))},
            {"rotation_deg", ToJson(Vec3(s.head<3>() * DegFromRad(1)))},
            {"principal_point_px", {s[6], s[7]}},
            {"focal_px", s[8]},
            {"k", k_sigma}}}};
}

Json MarkersJson(const LinkModel& model, const CalibrationSummary& summary) {
  Json markers = Json::array();
  for (int m = 0; m < model.markers.count(); ++m) {
    const auto i = static_cast<size_t>(m);
    Json marker = {{"path", model.PathOf(m) + 1}, {"ring", model.RingOf(m) + 1}};
    for (const CameraId id : kBothCameras) {
      const MarkerResidual& one = summary.cameras[Index(id)].residuals[i];
      const char* names[] = {"unseen", "left out", "used"};
      marker[Name(id)] = {{"state", names[static_cast<int>(one.kind)]}};
      if (one.kind != MarkerResidual::Kind::kUnseen)
        marker[Name(id)]["residual_px"] = {one.residual_px.x(), one.residual_px.y()};
    }
    const auto& shift = summary.shifts_mm[i];
    marker["off_mm"] = shift ? ToJson(*shift) : Json(nullptr);
    markers.push_back(std::move(marker));
  }
  return markers;
}

Json SpecificForceJson(const MeasuredLoads& loads) {
  if (loads.specific_force_covariance.isZero(0)) return nullptr;
  return {{"value", ToJson(loads.specific_force_mps2)},
          {"sigma", ToJson(Sigmas(loads.specific_force_covariance))}};
}

void PrintJson(const LinkModel& model, const Found& found) {
  const RestResult& rest = found.rest;
  const CalibrationSummary& summary = rest.calibration;
  const Json out = {{"model", model.name},
                    {"pairs", summary.pairs},
                    {"markers_used", summary.markers_used},
                    {"rms_px", summary.rms_px},
                    {"rmse_mm",
                     {{"r", summary.rmse_r_mm},
                      {"phi_r", summary.rmse_phi_r_mm},
                      {"z", summary.rmse_z_mm},
                      {"3d", summary.rmse_3d_mm}}},
                    {"specific_force_estimate_mps2", SpecificForceJson(rest.loads)},
                    {"cameras",
                     {{"top", CameraJson(summary.cameras[Index(CameraId::kTop)])},
                      {"bottom", CameraJson(summary.cameras[Index(CameraId::kBottom)])}}},
                    {"parameters", ParametersJson(found.parameters)},
                    {"repeats", found.repeats},
                    {"markers", MarkersJson(model, summary)}};
  std::puts(out.dump().c_str());
}

Result<std::vector<RestPictures>> ReadPairs(const std::vector<std::string>& paths) {
  std::vector<RestPictures> pairs(paths.size() / kCameraCount);
  for (size_t i = 0; i < paths.size(); ++i) {
    auto picture = ReadGrayImage(paths[i]);
    if (!picture) return picture.error();
    pairs[i / kCameraCount][i % kCameraCount] = *std::move(picture);
  }
  return pairs;
}

Result<RestResult> CalibrateUnder(const CalibrateOptions& options, const LinkModel& model,
                                  const std::vector<RestPictures>& pairs, const CalibrationOptions& how) {
  const auto estimator = MakeStateEstimator(model, {});
  RestConditions rest{.loads = {}, .skin = estimator->AtRest()};
  if (auto good = CheckWeight(model, options.gravity); !good) return good.error();
  rest.loads.pressure_mpa = 1e-3 * options.pressure_kpa;
  if (!options.gravity.empty()) {
    if (auto good = TakeGravity(options.gravity, options.gravity_sigma_mps2, rest.loads); !good)
      return good.error();
  }
  return CalibrateFromPictures(model, pairs, rest, how);
}

// With --each, from every pair alone as well: how far a calibration from one pair may be off.
Result<Found> CalibrateWithScatter(const CalibrateOptions& options, const LinkModel& model,
                                   const std::vector<RestPictures>& pairs, const CalibrationOptions& how) {
  auto together = CalibrateUnder(options, model, pairs, how);
  if (!together) return together.error();
  std::vector<CalibrationSummary> all;
  for (size_t i = 0; options.each && i < pairs.size(); ++i) {
    auto alone = CalibrateUnder(options, model, {pairs[i]}, how);
    if (!alone)
      return Error{alone.error().code, "pair " + std::to_string(i + 1) + " alone: " + alone.error().message};
    all.push_back(std::move(alone->calibration));
  }
  Found found{.rest = *std::move(together), .parameters = {}, .repeats = std::max<size_t>(1, all.size())};
  found.parameters = ParametersOf({&found.rest.calibration, 1}, model.nominal_rig);
  const auto scatter = ParametersOf(all, model.nominal_rig);
  if (!scatter.empty() && std::ranges::all_of(scatter, [](const auto& one) { return one.scatter == 0; }))
    return Error{ErrorCode::kInvalidArgument,
                 "--each: all pairs give the same cameras, for they are the same images; take several"};
  for (size_t i = 0; i < scatter.size(); ++i) {
    found.parameters[i].mean = scatter[i].mean;
    found.parameters[i].scatter = scatter[i].scatter;
  }
  return found;
}

CalibrationIdentity IdentityOf(const CalibrateOptions& options) {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return {.link = options.link_name,
          .made_utc_s = std::chrono::duration_cast<std::chrono::seconds>(now).count()};
}

Result<void> Calibrate(const CalibrateOptions& options) {
  if (!options.live.link.empty()) {
    LinkCalibration live = options.live;
    live.out = options.out;
    live.json = options.json;
    return CalibrateLink(live);
  }
  if (options.model.empty() || options.rest.empty() || options.out.empty())
    return Error{ErrorCode::kInvalidArgument, "give --model, --rest and --out, or the --link of a server"};
  const auto model = LoadLinkModel(options.model);
  if (!model) return model.error();
  const auto pairs = ReadPairs(options.rest);
  if (!pairs) return pairs.error();
  CalibrationOptions how;
  how.tolerance.marker_mm = options.mould_tolerance_mm;
  for (const LensKind kind : {LensKind::kDivision, LensKind::kKannalaBrandt}) {
    if (options.lens == Name(kind)) how.lens = kind;
  }
  if (options.each && pairs->size() < 2)
    return Error{ErrorCode::kInvalidArgument, "--each compares calibrations: give --rest at least twice"};
  const auto found = CalibrateWithScatter(options, *model, *pairs, how);
  if (!found) return found.error();
  const CalibrationSummary* const summary = &found->rest.calibration;
  const std::string residuals =
      options.residuals.empty()
          ? std::filesystem::path(options.out).replace_extension(".residuals.png").string()
          : options.residuals;
  if (auto written = WritePng(residuals, ResidualPicture(pairs->front(), *summary)); !written)
    return written.error();
  if (auto saved = SaveCalibration(options.out, CalibrationText(*model, *summary, IdentityOf(options)));
      !saved)
    return saved.error();
  if (options.json) {
    PrintJson(*model, *found);
  } else {
    PrintText(*model, *found);
    std::printf("\nwritten: %s, residuals drawn in %s\n", options.out.c_str(), residuals.c_str());
  }
  return {};
}

}  // namespace

void AddCalibrate(const Arguments& app, Selected& selected) {
  auto options = std::make_shared<CalibrateOptions>();
  const Arguments command = app.AddCommand("calibrate",
                                           "Camera parameters from pictures of the untouched skin, or of a "
                                           "server's link as it is now; `material`: "
                                           "the skin's");
  command.AddOption("--model", options->model, "Link model: a shipped name or a YAML file");
  command
      .AddOption("--rest", options->rest,
                 "TOP and BOTTOM picture of the untouched skin; again for more pairs, which are averaged")
      .Expected(2, 2 * 1000);
  command
      .AddOption("--pressure-kpa", options->pressure_kpa,
                 "Gauge pressure inside the skin in the rest pictures")
      .Must(Within(-20, 20));
  command.AddOption(
      "--gravity", options->gravity,
      "Specific force in the rest pictures, X,Y,Z in m/s2 in the link's frame: where things fall; "
      "'unknown': found from the pictures; without, the skin counts as weightless");
  command
      .AddOption("--gravity-sigma", options->gravity_sigma_mps2,
                 "Standard deviation of each component of a specific force that is given, m/s2")
      .Must(Within(1e-6, 100))
      .ShowDefault();
  command.AddOption("--lens", options->lens, "Lens model to fit; without, the link model's")
      .Must(OneOf({"division", "kannala_brandt"}));
  command.AddOption("-o,--out", options->out, "Calibration file to write (YAML)");
  const Option link =
      command.AddOption("--link", options->live.link,
                        "Instead of pictures: a link of a running server, which then uses the result");
  AddServerOption(command, options->live.server);
  command.AddOption("--pairs", options->live.pairs, "Rest pairs that the server takes")
      .Must(Within(1, 300))
      .ShowDefault()
      .Needs(link);
  command
      .AddOption("--repeat", options->live.repeats,
                 "Calibrations that the server makes; tells how far they scatter")
      .Must(Within(1, 100))
      .ShowDefault()
      .Needs(link);
  command.AddFlag("--save", options->live.save, "The server writes the link's configured calibration file")
      .Needs(link);
  command.AddFlag("--force", options->live.force, "Even while the link shows contacts").Needs(link);
  command.AddFlag("--each", options->each,
                  "Also calibrate from every pair alone: mean and standard deviation of every parameter");
  command.AddOption("--for-link", options->link_name,
                    "Name of the link whose calibration file this is: a server refuses it for another link");
  command.AddOption("--residuals", options->residuals,
                    "Picture of the residuals to write (PNG); without, beside the calibration file");
  command
      .AddOption("--mould-tolerance-mm", options->mould_tolerance_mm,
                 "How far markers may be off the model, standard deviation per axis")
      .Must(Within(0.001, 5))
      .ShowDefault();
  command.AddFlag("--json", options->json, "One JSON object, with every marker's residuals");
  AddCalibrateMaterial(command, selected);
  command.OnChosen([options, command, &selected] {
    if (command.HasCommand()) return;
    if (options->rest.size() % kCameraCount != 0)
      RefuseOption("--rest", "needs a TOP and a BOTTOM picture each time");
    selected = [options] { return Calibrate(*options); };
  });
}

}  // namespace taclink::command
