#include "client/command/offline/calibrate_material.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "client/command/cli/csv.h"
#include "client/command/cli/output_files.h"
#include "client/command/offline/marker_csv.h"
#include "client/command/offline/material_report.h"
#include "client/command/offline/picture_solver.h"
#include "client/command/offline/probe_csv.h"
#include "sensing/core/units.h"
#include "sensing/model/model_file.h"

namespace taclink::command {
namespace {

constexpr size_t kInflationWords = 2, kPictureWords = 3;

struct MaterialOptions {
  std::string model;
  std::vector<std::string> inflations;  // pressure and file by turns
  std::vector<std::string> pictures;    // pressure, top and bottom by turns
  std::vector<std::string> rest;
  std::string calibration;
  std::string probe;
  double probe_diameter_mm = 5.5;
  double sigma_mm = 0.05;
  std::string law = "both";
  std::string out;
  bool json = false;
};

Result<double> PressureMpa(const std::string& text, const std::string& of) {
  double kpa = 0;
  if (ParseWhole(text, kpa)) return kpa * kMpaPerKpa;
  return Error{ErrorCode::kInvalidArgument,
               of + ": '" + text + "' is no pressure in kPa; it stands before the files"};
}

Result<void> AddMarkerFiles(const MaterialOptions& options, const LinkModel& model,
                            std::vector<InflationRecord>& records) {
  for (size_t i = 0; i < options.inflations.size(); i += kInflationWords) {
    const std::string& file = options.inflations[i + 1];
    const auto pressure = PressureMpa(options.inflations[i], "--inflation");
    if (!pressure) return pressure.error();
    auto shape = ReadMarkerCsv(file, model, options.sigma_mm);
    if (!shape) return shape.error();
    records.push_back({file, *pressure, std::move(shape->measured)});
  }
  return {};
}

Result<void> AddPictures(const MaterialOptions& options, const LinkModel& model,
                         std::vector<InflationRecord>& records) {
  if (options.pictures.empty()) return {};
  PipelineOptions how;
  how.always_acquire = true;  // the pictures are far apart
  const auto solver = PictureSolver::Make(model, how, options.calibration, options.rest);
  if (!solver) return solver.error();
  for (size_t i = 0; i < options.pictures.size(); i += kPictureWords) {
    const std::string& top = options.pictures[i + 1];
    const auto pressure = PressureMpa(options.pictures[i], "--pictures");
    if (!pressure) return pressure.error();
    const auto state = (*solver)->Solve({top, options.pictures[i + 2]}, *pressure);
    if (!state) return state.error();
    if (!state->measured())
      return Error{ErrorCode::kInvalidArgument, top + ": can't be solved: " + state->status_reason};
    records.push_back({top, *pressure, state->shape.measured});
  }
  return {};
}

std::vector<MaterialLaw> LawsOf(const std::string& name) {
  std::vector<MaterialLaw> laws;
  for (const MaterialLaw law : {MaterialLaw::kSaintVenantKirchhoff, MaterialLaw::kNeoHookean}) {
    if (name == "both" || name == Name(law)) laws.push_back(law);
  }
  return laws;
}

Result<MaterialChoice> FitLaws(const MaterialOptions& options, const LinkModel& model,
                               const std::vector<InflationRecord>& inflations,
                               const std::vector<ProbeRecord>& probes) {
  std::vector<MaterialFit> fits;
  std::vector<MaterialChoice::Refusal> refusals;
  bool told = false;
  for (const MaterialLaw law : LawsOf(options.law)) {
    MaterialFitOptions how;
    how.progress = [&told, law](int solved) {
      if (isatty(STDERR_FILENO) == 0) return;
      told = true;
      fmt::print(stderr, "\r{}: {} solutions of the skin ", Name(law), solved);
    };
    auto fit = FitMaterial(model, law, inflations, probes, how);
    if (told) fmt::print(stderr, "\n");
    if (fit) {
      fits.push_back(*std::move(fit));
    } else {
      refusals.push_back({law, fit.error()});
    }
  }
  if (fits.empty()) return refusals.front().why;
  return ChooseLaw(std::move(fits), std::move(refusals), model.material.law);
}

Result<void> CalibrateMaterial(const MaterialOptions& options) {
  const auto model = LoadLinkModel(options.model);
  if (!model) return model.error();
  std::vector<InflationRecord> inflations;
  if (auto read = AddMarkerFiles(options, *model, inflations); !read) return read;
  if (auto read = AddPictures(options, *model, inflations); !read) return read;
  std::vector<ProbeRecord> probes;
  if (!options.probe.empty()) {
    auto read = ReadProbeCsv(options.probe, *model, options.probe_diameter_mm);
    if (!read) return read.error();
    probes = *std::move(read);
  }
  const auto choice = FitLaws(options, *model, inflations, probes);
  if (!choice) return choice.error();
  if (!options.out.empty()) {
    const auto text = LinkModelText(options.model);
    if (!text) return text.error();
    const auto written =
        WithMaterial(options.model, *text, choice->fit().material, EvidenceOf(choice->fit()));
    if (!written) return written.error();
    if (auto saved = WriteText(options.out, *written); !saved) return saved;
  }
  if (options.json) {
    PrintMaterialJson(*model, *choice);
  } else {
    PrintMaterialText(*model, *choice);
    if (!options.out.empty()) fmt::print("\nwritten: {}\n", options.out);
  }
  return {};
}

void CheckWords(const MaterialOptions& options) {
  if (options.inflations.empty() && options.pictures.empty() && options.probe.empty())
    RefuseMissing("--inflation, --pictures or --probe");
  if (options.inflations.size() % kInflationWords != 0)
    RefuseOption("--inflation", "needs a pressure in kPa and a FILE each time");
  if (options.pictures.size() % kPictureWords != 0)
    RefuseOption("--pictures", "needs a pressure in kPa, a TOP and a BOTTOM picture each time");
}

}  // namespace

void AddCalibrateMaterial(const Arguments& calibrate, Selected& selected) {
  auto options = std::make_shared<MaterialOptions>();
  const Arguments command = calibrate.AddCommand(
      "material",
      "Young's modulus and law of a skin from inflation at known pressures and from probe forces");
  command.AddOption("--model", options->model, "Link model: a shipped name or a YAML file").Required();
  command
      .AddOption("--inflation", options->inflations,
                 "KPA FILE: gauge pressure and the untouched skin's markers at it (CSV with columns "
                 "path,ring,ux,uy,uz); again for more pressures")
      .Expected(static_cast<int>(kInflationWords), 2000);
  const Option pictures =
      command
          .AddOption("--pictures", options->pictures,
                     "KPA TOP BOTTOM: gauge pressure and the untouched skin's pictures at it; "
                     "again for more pressures")
          .Expected(static_cast<int>(kPictureWords), 3000);
  const Option rest =
      command
          .AddOption("--rest", options->rest, "TOP and BOTTOM picture of the untouched skin without pressure")
          .Expected(2)
          .Needs(pictures);
  pictures.Needs(rest);
  command.AddOption("--calibration", options->calibration, "Camera parameters; without, found from --rest")
      .Needs(rest);
  command.AddOption("--probe", options->probe,
                    "CSV of forces on a flat disc pressed against markers: columns ring (or j), depth_mm "
                    "(from the uninflated radius), pressure_kpa, force_n");
  command.AddOption("--probe-diameter-mm", options->probe_diameter_mm, "Of the disc")
      .Must(Within(0.1, 1e3))
      .ShowDefault();
  command
      .AddOption("--sigma-mm", options->sigma_mm,
                 "With --inflation: the markers' standard deviation in x and y; z: 3 times")
      .Must(Within(1e-4, 10))
      .ShowDefault();
  command.AddOption("--law", options->law, "The law to fit; both are compared")
      .Must(OneOf({"both", "saint_venant_kirchhoff", "neo_hookean"}))
      .ShowDefault();
  command.AddOption("-o,--out", options->out, "Model file to write: --model's with the new material");
  command.AddFlag("--json", options->json, "One JSON object, with every record's residuals");
  command.OnChosen([options, &selected] {
    CheckWords(*options);
    selected = [options] { return CalibrateMaterial(*options); };
  });
}

}  // namespace taclink::command
