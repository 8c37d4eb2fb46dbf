#include "bench/played/played_link.h"

#include <cmath>

#include "bench/tools/thread_clock.h"
#include "sensing/capture/encode.h"
#include "sensing/simulation/simulated_skin.h"

namespace taclink {

PlayedLink::PlayedLink(const Built& built)
    : model_(built.model),
      pressure_gain_(built.pressure_gain),
      link_(built.known, built.options, ThreadCpuClock()),
      renderer_(model_, MountedRig(model_.nominal_rig, built.effects), built.effects, built.seed) {}

Result<void> PlayedLink::Play(const Scene& scene, const Watch& watch) {
  const auto skin = SimulatedSkin::Make(model_, scene);
  if (!skin) return skin.error();
  const int frames = static_cast<int>(std::lround(scene.duration_s * scene.frame_rate_hz));
  for (int i = 0; i < frames; ++i) {
    const double time_s = i / scene.frame_rate_hz;
    (*skin)->Evaluate(time_s, truth_);
    truth_.frame = ++frame_.sequence;
    Process(time_ns_ + std::llround(1e9 * time_s));
    if (watch) watch(truth_, state_);
  }
  time_ns_ += std::llround(1e9 * scene.duration_s);
  return {};
}

void PlayedLink::Process(int64_t exposure_ns) {
  for (const CameraId id : kBothCameras) {
    renderer_.Render(truth_, id, gray_);
    PackYuyv(gray_, renderer_.chroma(id), frame_.images[Index(id)]);
  }
  frame_.pressure_mpa = pressure_gain_ * truth_.pressure_mpa;
  frame_.pressure.origin = PressureOrigin::kSerial;
  frame_.pressure.mpa = *frame_.pressure_mpa;
  frame_.times = {};
  frame_.times.exposure_monotonic_ns = frame_.times.exposure_utc_ns = frame_.times.received_ns = exposure_ns;
  link_.Process(frame_, state_);
}

}  // namespace taclink
