#include "client/command/offline/picture_solver.h"

#include "sensing/camera/calibration.h"
#include "sensing/capture/image_io.h"

namespace taclink::command {

Result<std::unique_ptr<PictureSolver>> PictureSolver::Make(const LinkModel& model, PipelineOptions options,
                                                           const std::string& calibration,
                                                           const std::vector<std::string>& rest,
                                                           double rest_pressure_mpa) {
  options.rest_frames = 1;
  options.pictures_may_repeat = true;
  if (!calibration.empty()) {
    auto rig = LoadCalibration(calibration, model);
    if (!rig) return rig.error();
    options.rig = *rig;
  }
  std::unique_ptr<PictureSolver> solver(new PictureSolver(model, options));
  const auto state = solver->Solve(rest, rest_pressure_mpa);
  if (!state) return state.error();
  if (!solver->pipeline_.calibration()) {
    return Error{ErrorCode::kInvalidArgument, "the rest pictures can't be used: " + state->status_reason};
  }
  return solver;
}

Result<LinkState> PictureSolver::Solve(const std::vector<std::string>& pair,
                                       std::optional<double> pressure_mpa) {
  for (size_t i = 0; i < kCameraCount; ++i) {
    if (auto read = ReadRawImage(pair[i], frame_.images[i]); !read) return read.error();
  }
  frame_.pressure_mpa = pressure_mpa;
  pipeline_.Process(frame_, state_);
  ++frame_.sequence;
  return state_;
}

}  // namespace taclink::command
