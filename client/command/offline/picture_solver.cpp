#include "client/command/offline/picture_solver.h"

#include "sensing/camera/calibration_file.h"
#include "sensing/capture/image_io.h"

namespace taclink::command {
namespace {

constexpr size_t kMostRestGuesses = 17;  // as many as RestGuesses gives

}  // namespace

Result<std::unique_ptr<PictureSolver>> PictureSolver::Make(
    const LinkModel& model, PipelineOptions options, const std::string& calibration,
    const std::vector<std::string>& rest, const std::optional<SpecificForceReading>& rest_force,
    double rest_pressure_mpa) {
  options.rest_frames = 1;
  options.pictures_may_repeat = true;
  if (!calibration.empty()) {
    const auto saved = LoadCalibration(calibration, model);
    if (!saved) return saved.error();
    options.rig = saved->rig;
    options.calibrated_utc_s = saved->identity.made_utc_s;
  }
  std::unique_ptr<PictureSolver> solver(new PictureSolver(model, options));
  // With each refusal the pipeline tries another attitude, where that is unknown.
  std::string refusal;
  for (size_t i = 0; i < kMostRestGuesses && !solver->pipeline_.calibration(); ++i) {
    const auto state = solver->Solve(rest, rest_pressure_mpa, rest_force);
    if (!state) return state.error();
    if (refusal.empty()) refusal = state->status_reason;
  }
  if (!solver->pipeline_.calibration())
    return Error{ErrorCode::kInvalidArgument, "the rest pictures can't be used: " + refusal};
  return solver;
}

Result<LinkState> PictureSolver::Solve(const std::vector<std::string>& pair,
                                       std::optional<double> pressure_mpa,
                                       const std::optional<SpecificForceReading>& specific_force) {
  for (size_t i = 0; i < kCameraCount; ++i) {
    if (auto read = ReadRawImage(pair[i], frame_.images[i]); !read) return read.error();
  }
  frame_.pressure_mpa = pressure_mpa;
  frame_.specific_force = specific_force;
  pipeline_.Process(frame_, state_);
  ++frame_.sequence;
  return state_;
}

}  // namespace taclink::command
