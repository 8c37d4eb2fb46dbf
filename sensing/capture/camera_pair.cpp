#include "sensing/capture/camera_pair.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <future>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "sensing/capture/frame_pairer.h"
#include "sensing/capture/v4l2_device.h"
#include "sensing/capture/v4l2_offers.h"

namespace taclink {
namespace {

/// Waiting pictures, the newest pair, and one for the driver to fill.
constexpr int kMinBuffers = static_cast<int>(FramePairer::kDepth) + 2;
/// A camera that is late by so much, and so many frames, is done without.
constexpr int64_t kSilenceNs = 300'000'000;
constexpr double kSilenceFrames = 3;
/// After so much, and so many frames, it is reopened; the first picture may take longer.
constexpr int64_t kReopenNs = 1'500'000'000, kFirstPictureNs = 4'000'000'000;
constexpr double kReopenFrames = 6;
constexpr int64_t kRetryNs = 300'000'000;
/// How long Start waits for a camera that does not answer: the first, the second; and how often it looks.
constexpr int64_t kOpenPatienceNs = 3'000'000'000, kSecondPatienceNs = 1'000'000'000, kLookNs = 10'000'000;
/// Beyond so many a jump of the driver's count is a new count.
constexpr uint32_t kMaxGap = 1u << 16;

class CameraPair final : public FrameSource {
 public:
  CameraPair(CameraPairOptions options, std::unique_ptr<CameraSystem> system, Clock& clock)
      : options_(std::move(options)),
        clock_(clock),
        system_(std::move(system)),
        pairer_(std::max(options_.frame_rate_hz, 1e-3)) {}

  Result<void> Start() override;
  Result<void> Next(StereoFrame& frame, std::chrono::milliseconds timeout) override;
  Result<void> SetCamera(CameraId id, const CameraSettings& settings) override;
  void Remember(CameraId id, const CameraSettings& settings) override { system_->Remember(id, settings); }
  SourceInfo Info() const override;
  SourceCounters Counters() const override;

 private:
  struct Camera {
    std::unique_ptr<CameraDevice> device;         // null: not open
    std::future<OpenedCamera> opening;            // valid: under way
    ErrorCode code = ErrorCode::kUnavailable;     // of the last attempt to open
    std::string trouble;                          // why it gives no pictures; empty: it does
    std::vector<std::span<const uint8_t>> bytes;  // of the buffers that are not with the driver
    int64_t retry_at_ns = 0;
    int64_t alive_at_ns = 0;     // opened, or gave a picture
    uint64_t pictures_here = 0;  // of this device
    uint64_t pictures_since_delivery = 0;
    uint32_t newest_sequence = 0;
    uint64_t pictures = 0, lost = 0;
    uint64_t damaged_before = 0, stamped_before = 0;  // on devices closed since
  };

  Camera& Of(CameraId id) { return cameras_[Index(id)]; }
  const Camera& Of(CameraId id) const { return cameras_[Index(id)]; }
  bool AnyOpen() const { return cameras_[0].device || cameras_[1].device; }
  bool AnyOpening() const { return cameras_[0].opening.valid() || cameras_[1].opening.valid(); }

  void Tend();
  void FinishOpening(CameraId id);
  void JudgeSilence(CameraId id);
  void DoWithout(CameraId id);
  void Lose(CameraId id, std::string why);
  void SetTrouble(Camera& camera, std::string trouble);
  int64_t FramesNs(CameraId id, double frames) const;

  void Drain();
  bool DrainOne(CameraId id);
  void Count(Camera& camera, const DriverPicture& picture);
  void GiveBack(CameraId id, const PictureTag& picture);
  void GiveBackDropped();
  void SkipPair();
  bool IsStale() const;
  void Wait(int64_t until_ns);
  void Deliver(StereoFrame& frame);
  Error NothingYet(std::chrono::milliseconds timeout) const;
  Error BothLost() const;

  const CameraPairOptions options_;
  Clock& clock_;
  const std::unique_ptr<CameraSystem> system_;
  FramePairer pairer_;
  std::array<Camera, kCameraCount> cameras_;
  std::optional<FramePair> newest_;  // found, not delivered yet
  bool started_ = false;
  uint64_t skipped_pairs_ = 0;
  uint64_t info_changes_ = 0;
};

Result<void> CameraPair::Start() {
  if (options_.buffers < kMinBuffers) {
    return Error{ErrorCode::kInvalidArgument,
                 "cameras need at least " + std::to_string(kMinBuffers) + " buffers"};
  }
  if (options_.names[0] == options_.names[1]) {
    return Error{ErrorCode::kInvalidArgument,
                 "both cameras of the link are '" + options_.names[0] + "'; they must be two devices"};
  }
  if (!AnyOpen()) {
    pairer_.Restart();
    newest_.reset();
  }
  for (Camera& camera : cameras_) camera.retry_at_ns = 0;
  Tend();
  const int64_t begun_ns = clock_.MonotonicNs();
  while (AnyOpening() &&
         clock_.MonotonicNs() - begun_ns < (AnyOpen() ? kSecondPatienceNs : kOpenPatienceNs)) {
    system_->Wait({}, clock_.MonotonicNs() + kLookNs);
    for (const CameraId id : kBothCameras) FinishOpening(id);
  }
  if (!AnyOpen()) return BothLost();
  for (const CameraId id : kBothCameras)
    if (!Of(id).device) DoWithout(id);
  started_ = true;
  return {};
}

/// Opens what is due, takes what has been opened, gives up what is silent.
void CameraPair::Tend() {
  for (const CameraId id : kBothCameras) {
    Camera& camera = Of(id);
    FinishOpening(id);
    if (camera.opening.valid()) continue;
    if (camera.device) {
      JudgeSilence(id);
    } else if (clock_.MonotonicNs() >= camera.retry_at_ns) {
      camera.opening = system_->Open(id, nullptr);
    }
  }
}

void CameraPair::FinishOpening(CameraId id) {
  Camera& camera = Of(id);
  if (!camera.opening.valid() ||
      camera.opening.wait_for(std::chrono::seconds(0)) != std::future_status::ready) {
    return;
  }
  OpenedCamera opened = Error{};
  try {
    opened = camera.opening.get();
  } catch (const std::exception& e) {
    opened = Error{ErrorCode::kInternal, e.what()};
  }
  const int64_t now_ns = clock_.MonotonicNs();
  if (!opened) {
    camera.code = opened.error().code;
    camera.retry_at_ns = now_ns + kRetryNs;
    return SetTrouble(camera, opened.error().message);
  }
  camera.device = std::move(*opened);
  camera.bytes.assign(static_cast<size_t>(camera.device->buffer_count()), {});
  camera.alive_at_ns = now_ns;
  camera.pictures_here = camera.pictures_since_delivery = 0;
  ++info_changes_;
}

void CameraPair::SetTrouble(Camera& camera, std::string trouble) {
  if (camera.trouble == trouble) return;
  camera.trouble = std::move(trouble);
  ++info_changes_;
}

int64_t CameraPair::FramesNs(CameraId id, double frames) const {
  return static_cast<int64_t>(frames * std::max(pairer_.interval_ns(id), 1e9 / options_.frame_rate_hz));
}

void CameraPair::JudgeSilence(CameraId id) {
  const Camera& camera = Of(id);
  const int64_t silent_ns = clock_.MonotonicNs() - camera.alive_at_ns;
  const int64_t patience_ns =
      std::max(camera.pictures_here > 0 ? kReopenNs : kFirstPictureNs, FramesNs(id, kReopenFrames));
  if (silent_ns >= patience_ns) {
    Lose(id, options_.names[Index(id)] + ": gives no pictures; reopening it");
  } else if (silent_ns >= std::max(kSilenceNs, FramesNs(id, kSilenceFrames)) && !pairer_.lost(id)) {
    SetTrouble(Of(id), options_.names[Index(id)] + ": gives no pictures");
    DoWithout(id);
  }
}

/// The other camera does not wait for this one any more.
void CameraPair::DoWithout(CameraId id) {
  pairer_.Lose(id);
  GiveBackDropped();
}

void CameraPair::Lose(CameraId id, std::string why) {
  Camera& camera = Of(id);
  // Taken first: giving its pictures back would fail and come here again.
  auto device = std::exchange(camera.device, nullptr);
  if (!device) return;
  if (newest_ && newest_->has(id)) SkipPair();
  DoWithout(id);
  SetTrouble(camera, std::move(why));
  camera.damaged_before += device->damaged();
  camera.stamped_before += device->stamped_on_arrival();
  camera.opening = system_->Open(id, std::move(device));
  ++info_changes_;
}

Result<void> CameraPair::Next(StereoFrame& frame, std::chrono::milliseconds timeout) {
  if (!started_) return Error{ErrorCode::kUnavailable, "the cameras are not open: start them"};
  const int64_t until_ns = clock_.MonotonicNs() + std::chrono::nanoseconds(timeout).count();
  bool may_be_stale = true;
  while (true) {
    Drain();
    Tend();
    if (may_be_stale && IsStale()) SkipPair();
    if (newest_) break;
    if (!AnyOpen()) {
      started_ = false;
      return BothLost();
    }
    may_be_stale = false;
    if (clock_.MonotonicNs() >= until_ns) return NothingYet(timeout);
    Wait(until_ns);
  }
  Deliver(frame);
  return {};
}

/// Takes what the drivers have, in turn, so that pairs are found in the order of time; the last one counts.
void CameraPair::Drain() {
  bool more = true;
  while (more) {
    more = false;
    for (const CameraId id : kBothCameras) more = DrainOne(id) || more;
  }
}

bool CameraPair::DrainOne(CameraId id) {
  Camera& camera = Of(id);
  if (!camera.device) return false;
  const auto got = camera.device->Dequeue();
  if (!got) {
    Lose(id, got.error().message);
    return false;
  }
  if (!*got) return false;
  const DriverPicture& picture = **got;
  Count(camera, picture);
  camera.bytes[static_cast<size_t>(picture.buffer)] = picture.bytes;
  const auto pair = pairer_.Add(id, {picture.sequence, picture.timestamp_ns, picture.buffer});
  GiveBackDropped();
  if (pair) {
    SkipPair();
    newest_ = pair;
    // Giving back may have lost a camera, and the memory of its picture.
    for (const CameraId each : kBothCameras) {
      if (newest_ && newest_->has(each) && !Of(each).device) SkipPair();
    }
  }
  return true;
}

void CameraPair::Count(Camera& camera, const DriverPicture& picture) {
  const uint32_t step = picture.sequence - camera.newest_sequence;  // right across the wrap
  if (camera.pictures_here > 0 && step > 1 && step < kMaxGap) camera.lost += step - 1;
  camera.newest_sequence = picture.sequence;
  camera.alive_at_ns = clock_.MonotonicNs();
  ++camera.pictures_here;
  ++camera.pictures_since_delivery;
  ++camera.pictures;
  if (!camera.trouble.empty()) SetTrouble(camera, "");
}

void CameraPair::GiveBack(CameraId id, const PictureTag& picture) {
  if (!Of(id).device) return;
  if (auto given = Of(id).device->Requeue(picture.handle); !given) Lose(id, given.error().message);
}

void CameraPair::GiveBackDropped() {
  // A camera may be lost while this goes on, which drops again.
  std::array<FramePairer::Dropped, kCameraCount * FramePairer::kDepth + 1> dropped;
  const auto count =
      static_cast<size_t>(std::ranges::copy(pairer_.dropped(), dropped.begin()).out - dropped.begin());
  for (size_t i = 0; i < count; ++i) GiveBack(dropped[i].camera, dropped[i].picture);
}

void CameraPair::SkipPair() {
  if (!newest_) return;
  const FramePair pair = *std::exchange(newest_, std::nullopt);
  ++skipped_pairs_;
  for (const CameraId id : kBothCameras)
    if (pair.has(id)) GiveBack(id, pair[id]);
}

/// The caller stayed away for so long that the drivers ran out of buffers: theirs are then the oldest
/// pictures, and newer ones were lost.
bool CameraPair::IsStale() const {
  if (!newest_) return false;
  const double age_ns = static_cast<double>(clock_.MonotonicNs() - newest_->exposure_ns());
  return age_ns > (options_.buffers + 1) * pairer_.frame_interval_ns();
}

void CameraPair::Wait(int64_t until_ns) {
  for (const CameraId id : kBothCameras) {
    const Camera& camera = Of(id);
    const int64_t now_ns = clock_.MonotonicNs();
    if (camera.opening.valid()) {
      until_ns = std::min(until_ns, now_ns + kLookNs);
    } else if (!camera.device) {
      until_ns = std::min(until_ns, camera.retry_at_ns);
    } else {
      const int64_t silent_at_ns = camera.alive_at_ns + std::max(kSilenceNs, FramesNs(id, kSilenceFrames));
      until_ns = std::min(until_ns, silent_at_ns > now_ns ? silent_at_ns : now_ns + kSilenceNs);
    }
  }
  const auto trouble = system_->Wait({cameras_[0].device.get(), cameras_[1].device.get()}, until_ns);
  for (const CameraId id : kBothCameras) {
    if (!trouble[Index(id)].empty()) Lose(id, options_.names[Index(id)] + ": " + trouble[Index(id)]);
  }
}

void CameraPair::Deliver(StereoFrame& frame) {
  const FramePair pair = *std::exchange(newest_, std::nullopt);
  for (const CameraId id : kBothCameras) {
    RawImage& image = frame.images[Index(id)];
    image.valid = pair.has(id);
    image.why_missing = pair.has(id) ? std::string() : Of(id).trouble;
    if (pair.has(id))
      CopyPicture(Of(id).bytes[static_cast<size_t>(pair[id].handle)], Of(id).device->format(), image);
    Of(id).pictures_since_delivery = 0;
  }
  frame.sequence = pair.sequence;
  frame.pressure_mpa.reset();
  frame.times = {};
  frame.times.received_ns = clock_.MonotonicNs();
  frame.times.exposure_monotonic_ns = pair.exposure_ns();
  frame.times.exposure_utc_ns = clock_.UtcNs() - (frame.times.received_ns - pair.exposure_ns());
  for (const CameraId id : kBothCameras)
    if (pair.has(id)) GiveBack(id, pair[id]);
}

Error CameraPair::NothingYet(std::chrono::milliseconds timeout) const {
  std::string silent;
  for (const CameraId id : kBothCameras) {
    if (Of(id).pictures_since_delivery > 0) continue;
    silent += (silent.empty() ? "" : " and ") + options_.names[Index(id)];
  }
  std::string why = silent.empty() ? "" : "; nothing from " + silent;
  if (silent.empty() && pairer_.mismatch_ns()) {
    why = "; the cameras' exposures are " + RateText(1e-6 * static_cast<double>(*pairer_.mismatch_ns())) +
          " ms apart, more than half a frame";
  }
  return {ErrorCode::kTimeout, "no pair of pictures within " + std::to_string(timeout.count()) + " ms" + why};
}

Error CameraPair::BothLost() const {
  std::string text;
  for (const CameraId id : kBothCameras) {
    text += (text.empty() ? "" : "; ") + std::string(Name(id)) + " camera " +
            (Of(id).trouble.empty() ? options_.names[Index(id)] + ": does not answer" : Of(id).trouble);
  }
  return {Of(CameraId::kTop).code, text};
}

Result<void> CameraPair::SetCamera(CameraId id, const CameraSettings& settings) {
  const Camera& camera = Of(id);
  if (!camera.device)
    return Error{ErrorCode::kUnavailable, options_.names[Index(id)] + ": the camera is not there now"};
  auto set = camera.device->Set(settings);
  if (set) system_->Remember(id, settings);
  ++info_changes_;  // also a refused order may have set a part
  return set;
}

SourceInfo CameraPair::Info() const {
  SourceInfo info{.description = "v4l2 " + options_.names[0] + " + " + options_.names[1],
                  .width_px = options_.width_px,
                  .height_px = options_.height_px,
                  .frame_rate_hz = options_.frame_rate_hz,
                  .cameras = {}};
  const std::string size = std::to_string(options_.width_px) + "x" + std::to_string(options_.height_px);
  std::string formats;
  for (const CameraId id : kBothCameras) {
    const Camera& camera = Of(id);
    SourceCamera& out = info.cameras.emplace_back();
    out.configured = options_.names[Index(id)];
    out.trouble = camera.trouble;
    if (!camera.device) continue;
    const std::string format = FormatName(camera.device->format().pixels);
    out.device = camera.device->description();
    out.format = format + " " + size;
    out.settings = camera.device->settings();
    if (formats != format) formats += (formats.empty() ? "" : " + ") + format;
  }
  info.description +=
      ", " + size + (formats.empty() ? "" : " " + formats) + " " + RateText(options_.frame_rate_hz) + "/s";
  return info;
}

SourceCounters CameraPair::Counters() const {
  SourceCounters counters;
  for (const CameraId id : kBothCameras) {
    const auto i = Index(id);
    const Camera& camera = cameras_[i];
    counters.pictures[i] = camera.pictures;
    counters.rate_hz[i] =
        camera.device && camera.pictures_here > 1 && !pairer_.lost(id) ? 1e9 / pairer_.interval_ns(id) : 0;
    counters.lost[i] = camera.lost;
    counters.damaged[i] = camera.damaged_before + (camera.device ? camera.device->damaged() : 0);
    counters.unpaired[i] = pairer_.dropped_total(id);
    counters.stamped_on_arrival[i] =
        camera.stamped_before + (camera.device ? camera.device->stamped_on_arrival() : 0);
  }
  counters.skipped_pairs = skipped_pairs_;
  counters.info_changes = info_changes_;
  return counters;
}

}  // namespace

std::unique_ptr<FrameSource> MakeCameraPair(CameraPairOptions options, std::unique_ptr<CameraSystem> system,
                                            Clock& clock) {
  return std::make_unique<CameraPair>(std::move(options), std::move(system), clock);
}

}  // namespace taclink
