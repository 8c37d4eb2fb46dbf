#include "sensing/simulation/simulated_source.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>

namespace taclink {
namespace {

constexpr int kNominalExposure100us = 50, kNominalGain = 1;
constexpr double kSpecificForceSigmaMps2 = 0.1;
constexpr int kLongestExposure100us = 1000, kLargestGain = 16;

/// Of all levels, against the nominal ones.
double Brightness(const CameraSettings& settings) {
  return settings.exposure_100us.value() * settings.gain.value() /
         static_cast<double>(kNominalExposure100us * kNominalGain);
}

}  // namespace

Result<std::unique_ptr<SimulatedSource>> SimulatedSource::Make(const LinkModel& model, const Scene& scene,
                                                               Clock& clock, ScenePace pace,
                                                               HandlingNow handling) {
  const int64_t start_ns = clock.MonotonicNs();
  auto skin = SimulatedSkin::Make(model, scene);
  if (!skin) return skin.error();
  const double took_s = 1e-9 * static_cast<double>(clock.MonotonicNs() - start_ns);
  return std::unique_ptr<SimulatedSource>(
      new SimulatedSource(model, scene, clock, std::move(*skin), took_s, pace, std::move(handling)));
}

SimulatedSource::SimulatedSource(const LinkModel& model, Scene scene, Clock& clock,
                                 std::unique_ptr<SimulatedSkin> skin, double took_s, ScenePace pace,
                                 HandlingNow handling)
    : scene_(std::move(scene)),
      clock_(clock),
      pace_(pace),
      handling_(std::move(handling)),
      skin_(std::move(skin)),
      renderer_(model, MountedRig(model.nominal_rig, scene_.camera), scene_.camera, scene_.seed) {
  const CameraModel& camera = model.nominal_rig[CameraId::kTop];
  name_ = "simulated scene '" + scene_.name + "' on model '" + model.name + "'";
  info_ = {name_, camera.width_px, camera.height_px, scene_.frame_rate_hz};
  if (const std::string prepared = skin_->Preparation(); !prepared.empty()) {
    char took[32];
    std::snprintf(took, sizeof took, " in %.1f s", took_s);
    info_.description += " (" + prepared + took + ")";
  }
  truth_.contacts.reserve(kMaxSceneContacts);
  settings_.fill({.exposure_100us = kNominalExposure100us, .gain = kNominalGain});
}

Result<void> SimulatedSource::Start() {
  if (started_) sequence_offset_ += next_frame_;
  started_ = true;
  start_ns_ = clock_.MonotonicNs();
  next_frame_ = 0;
  return {};
}

Result<void> SimulatedSource::SetCamera(CameraId id, const CameraSettings& settings) {
  const int exposure = settings.exposure_100us.value_or(kNominalExposure100us);
  const int gain = settings.gain.value_or(kNominalGain);
  if (settings.automatic_exposure)
    return Error{ErrorCode::kUnsupported, name_ + ": a simulated camera has no automatic exposure"};
  if (exposure < 1 || exposure > kLongestExposure100us)
    return Error{ErrorCode::kInvalidArgument, name_ + ": exposure must be 0.1 to 100 ms"};
  if (gain < 1 || gain > kLargestGain)
    return Error{ErrorCode::kInvalidArgument, name_ + ": gain must be 1 to 16"};
  settings_[Index(id)].Take(settings);
  return {};
}

SourceInfo SimulatedSource::Info() const {
  return info_;
}

int64_t SimulatedSource::ExposureNs(uint64_t frame) const {
  return start_ns_ + std::llround(static_cast<double>(frame) * 1e9 / scene_.frame_rate_hz);
}

// By frames, a frame that should be over is exposed now: the scene's start moves by the delay.
void SimulatedSource::DelayScene(uint64_t frame, int64_t now_ns) {
  if (pace_ == ScenePace::kFrames && ExposureNs(frame + 1) <= now_ns) start_ns_ += now_ns - ExposureNs(frame);
}

// A late caller skips to the newest frame, or delays the scene.
uint64_t SimulatedSource::NextDue(int64_t now_ns) {
  if (pace_ == ScenePace::kFrames) {
    DelayScene(next_frame_, now_ns);
    return next_frame_;
  }
  uint64_t due = next_frame_;
  while (ExposureNs(due + 1) <= now_ns) {  // most of the way at once
    const double behind = static_cast<double>(now_ns - ExposureNs(due)) * 1e-9 * scene_.frame_rate_hz;
    due += std::max<uint64_t>(1, behind > 2 ? static_cast<uint64_t>(behind) - 1 : 1);
  }
  return due;
}

Result<void> SimulatedSource::Next(StereoFrame& frame, std::chrono::milliseconds timeout) {
  if (!started_) return Error{ErrorCode::kUnavailable, name_ + ": not started"};
  const int64_t now = clock_.MonotonicNs();
  const int64_t deadline = now + std::chrono::nanoseconds(timeout).count();
  const uint64_t due = NextDue(now);
  if (!scene_.loop && static_cast<double>(due) > scene_.duration_s * scene_.frame_rate_hz)
    return Error{ErrorCode::kEndOfData, name_ + ": the scene is over"};
  const int64_t exposure = ExposureNs(due);
  if (exposure > deadline) {
    clock_.SleepUntilMonotonicNs(deadline);
    return Error{ErrorCode::kTimeout, name_ + ": no frame yet"};
  }
  if (exposure > now) clock_.SleepUntilMonotonicNs(exposure);
  Take(due, frame);
  next_frame_ = due + 1;
  return {};
}

void SimulatedSource::Take(uint64_t frame_number, StereoFrame& frame) {
  if (handling_) skin_->Handle(handling_());
  skin_->Evaluate(static_cast<double>(frame_number) / scene_.frame_rate_hz, truth_);
  for (const CameraId id : kBothCameras) {
    renderer_.Render(truth_, id, gray_);
    if (const double brightness = Brightness(settings_[Index(id)]); brightness != 1)
      gray_.convertTo(gray_, CV_8U, brightness);
    PackYuyv(gray_, renderer_.chroma(id), frame.images[Index(id)]);
  }
  frame.sequence = sequence_offset_ + frame_number;
  frame.pressure_mpa = truth_.pressure_mpa;
  Report(frame);
  frame.specific_force.reset();
  frame.joint.reset();
  if (scene_.motion) {
    frame.specific_force = {
        .mps2 = truth_.specific_force_mps2,
        .covariance = kSpecificForceSigmaMps2 * kSpecificForceSigmaMps2 * Mat3::Identity(),
        .origin = AttitudeOrigin::kSimulated};
  }
  if (scene_.motion && scene_.motion->swing && !scene_.motion->swing->joint.empty()) {
    frame.joint = {.name = scene_.motion->swing->joint,
                   .position_rad = truth_.joint.rad,
                   .velocity_radps = truth_.joint.radps};
  }
  frame.times = {};
  const int64_t now = clock_.MonotonicNs();
  DelayScene(frame_number, now);  // the time that the images took to make is not the frame's age
  frame.times.exposure_monotonic_ns = ExposureNs(frame_number);
  frame.times.exposure_utc_ns = clock_.UtcNs() - now + frame.times.exposure_monotonic_ns;
  frame.times.received_ns = now;
}

void SimulatedSource::Report(StereoFrame& frame) const {
  if (!frame.simulation) frame.simulation.emplace();
  frame.simulation->trouble = truth_.trouble;
  frame.simulation->contacts.clear();
  for (const TrueContact& contact : truth_.contacts)
    frame.simulation->contacts.push_back({.body_id = contact.body_id,
                                          .center_mm = contact.center_mm,
                                          .normal = contact.normal,
                                          .force_n = contact.force_n,
                                          .depth_mm = contact.depth_mm});
}

Result<std::unique_ptr<FrameSource>> MakeSimulatedSource(const LinkModel& model, const Scene& scene,
                                                         Clock& clock, ScenePace pace, HandlingNow handling) {
  auto source = SimulatedSource::Make(model, scene, clock, pace, std::move(handling));
  if (!source) return source.error();
  return std::unique_ptr<FrameSource>(std::move(*source));
}

}  // namespace taclink
