#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "sensing/camera/calibration_file.h"
#include "sensing/core/link_model.h"
#include "sensing/pipeline/link_pipeline.h"
#include "server/link/link_processor.h"

namespace taclink::server {

/// Passes frames through a LinkPipeline; a calibration replaces its cameras and rest shape.
class PipelineProcessor final : public LinkProcessor {
 public:
  /// `file`: the configured calibration file; none: saving is not possible. `identity`: of the link, without
  /// the time.
  PipelineProcessor(const LinkModel& model, const PipelineOptions& options, std::optional<std::string> file,
                    CalibrationIdentity identity);

  void Process(const StereoFrame& frame, LinkState& state) override;

  Result<void> BeginTare(const TareOptions& options) override { return pipeline_.BeginTare(options); }
  std::optional<Result<TareSummary>> TakeTareEnd() override { return pipeline_.TakeTareEnd(); }
  void CancelTare() override { pipeline_.CancelTare(); }

  const LabelledMarkers* labels() const override { return &pipeline_.labels(); }
  Result<void> UseEstimator(std::shared_ptr<StateEstimator> estimator) override;

  Result<void> BeginCalibration(const CalibrationOrder& order) override;
  CalibrationProgress PollCalibration() override;
  void CancelCalibration() override { pipeline_.CancelRest(); }

 private:
  /// The calibration in progress.
  struct Run {
    CalibrationOrder order;
    std::vector<CalibrationSummary> done;  ///< of order.repeats
    std::optional<StereoRig> before;       ///< the cameras in use at its start
    int64_t before_utc_ns = 0;             ///< calibration time of these; 0: unknown
  };

  Result<CalibrationResult> Finish(std::string ended_early) const;

  LinkPipeline pipeline_;
  const std::optional<std::string> file_;
  const CalibrationIdentity identity_;
  bool touched_ = false;           // in the newest frame
  int64_t calibrated_utc_ns_ = 0;  // the cameras in use
  Run run_;
};

}  // namespace taclink::server
