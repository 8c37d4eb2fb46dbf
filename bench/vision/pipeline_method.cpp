#include "bench/vision/pipeline_method.h"

#include <opencv2/imgproc.hpp>

#include "bench/tools/thread_clock.h"
#include "sensing/capture/decode.h"
#include "sensing/pipeline/link_pipeline.h"

namespace taclink {
namespace {

// Pixel (0, 0)'s centre is at (0, 0), so full = 2 half + 0.5.
constexpr double kHalfShift = 0.5;

LinkModel HalfResolution(LinkModel model) {
  for (CameraModel& camera : model.nominal_rig.cameras) {
    camera.lens.focal_px /= 2;
    camera.lens.principal_point_px = (camera.lens.principal_point_px - Vec2::Constant(kHalfShift)) / 2;
    camera.lens.k1_per_px2 *= 4;
    camera.lens.k2_per_px4 *= 16;
    camera.width_px /= 2;
    camera.height_px /= 2;
  }
  return model;
}

PipelineOptions OptionsOf(PipelineVariant variant) {
  PipelineOptions options;
  options.always_acquire = variant == PipelineVariant::kAcquiring;
  return options;
}

class PipelineMethod final : public VisionMethod {
 public:
  PipelineMethod(const LinkModel& model, PipelineVariant variant)
      : variant_(variant),
        pipeline_(variant == PipelineVariant::kHalf ? HalfResolution(model) : model, OptionsOf(variant),
                  ThreadCpuClock()) {}

  void Process(const StereoFrame& frame, VisionResult& result) override {
    if (variant_ == PipelineVariant::kWhole || variant_ == PipelineVariant::kAcquiring) {
      pipeline_.Process(frame, state_);
    } else {
      Reduce(frame);
      pipeline_.Process(reduced_, state_);
    }
    measures_ = measures_ || state_.status != LinkStatus::kCalibrating;
    result.shape = state_.shape;
    result.status = state_.status;
    result.status_reason = state_.status_reason;
    result.stage_ms = state_.stage_ms;
    if (state_.status == LinkStatus::kCalibrating) {
      result.labels = {};
      return;
    }
    result.labels = pipeline_.labels();
    if (variant_ != PipelineVariant::kHalf) return;
    for (auto& camera : result.labels.cameras) {
      for (MarkerObservation& marker : camera)
        marker.center_px = 2 * marker.center_px + Vec2::Constant(kHalfShift);
    }
  }

  void Restart() override {
    pipeline_.Restart();
    measures_ = false;
  }

 private:
  void Reduce(const StereoFrame& frame) {
    if (variant_ == PipelineVariant::kOneCamera) {
      reduced_ = frame;
      if (measures_) reduced_.images[Index(CameraId::kBottom)].valid = false;
      return;
    }
    reduced_.sequence = frame.sequence;
    reduced_.times = frame.times;
    reduced_.pressure_mpa = frame.pressure_mpa;
    for (size_t i = 0; i < kCameraCount; ++i) {
      RawImage& image = reduced_.images[i];
      image.valid = frame.images[i].valid && decoders_[i].Decode(frame.images[i], gray_).ok();
      if (!image.valid) continue;
      cv::resize(gray_, half_, {}, 0.5, 0.5, cv::INTER_AREA);
      image.format = PixelFormat::kGray8;
      image.width_px = half_.cols;
      image.height_px = half_.rows;
      image.bytes.assign(half_.datastart, half_.dataend);
    }
  }

  const PipelineVariant variant_;
  LinkPipeline pipeline_;
  LinkState state_;
  bool measures_ = false;  // the rest shape is known
  StereoFrame reduced_;
  std::array<GrayDecoder, kCameraCount> decoders_;
  cv::Mat gray_, half_;
};

}  // namespace

std::unique_ptr<VisionMethod> MakePipelineMethod(const LinkModel& model, PipelineVariant variant) {
  return std::make_unique<PipelineMethod>(model, variant);
}

}  // namespace taclink
