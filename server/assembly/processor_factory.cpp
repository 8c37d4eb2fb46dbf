#include "server/assembly/processor_factory.h"

#include <spdlog/spdlog.h>

#include <filesystem>
#include <functional>
#include <utility>

#include "sensing/camera/calibration.h"
#include "sensing/core/units.h"

namespace taclink::server {
namespace {

constexpr double kMpaPerPa = 1e-6;

bool IsMissing(const std::string& path) {
  std::error_code ignored;
  return std::filesystem::status(path, ignored).type() == std::filesystem::file_type::not_found;
}

/// Frames through a LinkPipeline, which a calibration gives new cameras and a new rest shape.
class PipelineProcessor final : public LinkProcessor {
 public:
  PipelineProcessor(const LinkModel& model, const PipelineOptions& options, std::optional<std::string> file)
      : pipeline_(model, options), file_(std::move(file)) {}

  void Process(const StereoFrame& frame, LinkState& state) override {
    pipeline_.Process(frame, state);
    // Where no forces are known the rest pictures themselves must show that nothing touches: a calibration is
    // what mends that.
    touched_ = !state.contacts.empty();
  }

  Result<void> BeginTare(const TareOptions& options) override { return pipeline_.BeginTare(options); }
  std::optional<Result<TareSummary>> TakeTareEnd() override { return pipeline_.TakeTareEnd(); }
  void CancelTare() override { pipeline_.CancelTare(); }

  const LabelledMarkers* labels() const override { return &pipeline_.labels(); }
  Result<void> UseEstimator(std::shared_ptr<StateEstimator> estimator) override {
    pipeline_.UseEstimator(std::move(estimator));
    return {};
  }

  Result<void> BeginCalibration(const CalibrationOrder& order) override {
    if (touched_ && !order.force)
      return Error{ErrorCode::kFailedPrecondition, "the skin is touched; let go of it, or ask with force"};
    if (order.save && !file_)
      return Error{ErrorCode::kFailedPrecondition,
                   "no file to save to: the link's configuration has no 'calibration'"};
    save_to_ = order.save ? file_ : std::nullopt;
    may_save_ = order.may_save;
    pipeline_.BeginRest(order.pairs);
    return {};
  }

  CalibrationProgress PollCalibration() override {
    const RestProgress& rest = pipeline_.rest_progress();
    CalibrationProgress progress{
        .taken = rest.taken, .wanted = rest.wanted, .waiting_for = rest.waiting_for, .end = {}};
    if (rest.refusal) {
      progress.end = Error{ErrorCode::kFailedPrecondition, rest.refusal->message};
      pipeline_.CancelRest();
    } else if (rest.taken == rest.wanted) {
      progress.end = Finish();
    }
    return progress;
  }

  void CancelCalibration() override { pipeline_.CancelRest(); }

 private:
  Result<CalibrationResult> Finish() const {
    const std::optional<CalibrationSummary>& found = pipeline_.calibration();
    if (!found) return Error{ErrorCode::kFailedPrecondition, "the rest pictures gave no cameras; try again"};
    CalibrationResult result{.markers_used = found->markers_used,
                             .rms_px = found->rms_px,
                             .rmse_r_mm = found->rmse_r_mm,
                             .rmse_tangential_mm = found->rmse_phi_r_mm,
                             .rmse_z_mm = found->rmse_z_mm,
                             .file_text = CalibrationText(pipeline_.model().name, *found),
                             .saved_to = {}};
    if (save_to_) {
      const auto saved = SaveCalibration(*save_to_, pipeline_.model().name, *found, may_save_);
      if (!saved) return saved.error();
      result.saved_to = *save_to_;
    }
    return result;
  }

  LinkPipeline pipeline_;
  const std::optional<std::string> file_;
  bool touched_ = false;  // in the newest frame
  // Of the calibration under way.
  std::optional<std::string> save_to_;
  std::function<bool()> may_save_;
};

}  // namespace

PipelineOptions ToPipelineOptions(const LinkConfig& link) {
  PipelineOptions options;
  options.force.model = link.force_model;
  options.force.refinement = link.force_refinement;
  options.force.most_work = FrameWork::kLiveUnits;
  options.drift = link.drift;
  options.pictures_may_repeat = !std::holds_alternative<V4l2SourceConfig>(link.source);
  if (link.pressure) {
    if (const auto* constant = std::get_if<ConstantPressureConfig>(&link.pressure->source))
      options.pressure_mpa = constant->kpa * kMpaPerKpa;
    if (link.pressure->sigma_pa) options.pressure_sigma_mpa = *link.pressure->sigma_pa * kMpaPerPa;
  }
  return options;
}

Result<std::unique_ptr<LinkProcessor>> MakeProcessor(const LinkConfig& link, const LinkModel& model) {
  PipelineOptions options = ToPipelineOptions(link);
  if (link.calibration && IsMissing(*link.calibration)) {
    SPDLOG_WARN(
        "link {}: {} does not exist yet; the first pictures calibrate the cameras instead. "
        "'taclink calibrate --link {} --save' writes it",
        link.name, *link.calibration, link.name);
  } else if (link.calibration) {
    auto rig = LoadCalibration(*link.calibration, model);
    if (!rig) return rig.error();
    options.rig = *rig;
  }
  return std::unique_ptr<LinkProcessor>(
      std::make_unique<PipelineProcessor>(model, options, link.calibration));
}

}  // namespace taclink::server
