#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "sensing/core/camera_model.h"
#include "sensing/core/geometry.h"
#include "tests/v4l2/emulated_camera.h"
#include "tests/v4l2/uvc_descriptors.h"

namespace taclink::testing {

/// The pictures that render_pictures made, shown in time: all cameras that expose at one time show one frame.
class Pictures {
 public:
  Pictures(const std::string& folder, int rate_hz) : interval_ns_(int64_t{UvcInterval100ns(rate_hz)} * 100) {
    std::ifstream truth(folder + "/truth.csv");
    for (std::string line; std::getline(truth, line);) {
      std::istringstream numbers(line);
      double frame = 0;
      char comma = 0;
      Vec3 force;
      numbers >> frame >> comma >> force.x() >> comma >> force.y() >> comma >> force.z();
      if (at_rest_ == forces_n_.size() && force.isZero()) ++at_rest_;
      forces_n_.push_back(force);
    }
    for (const CameraId id : kBothCameras) {
      for (size_t i = 0; i < forces_n_.size(); ++i) {
        char name[64];
        std::snprintf(name, sizeof name, "/%s_%03zu.", Name(id), i);
        mjpeg_[Index(id)].push_back(Read(folder + name + "jpg"));
        yuyv_[Index(id)].push_back(Read(folder + name + "yuyv"));
      }
    }
  }

  size_t count() const { return forces_n_.size(); }
  /// From the next exposure on; until then those of the untouched skin that the scene begins with are shown
  /// in turn: a picture that is the one before, pixel by pixel, is of a camera that hangs.
  void Play(int64_t now_ns) { first_ = now_ns / interval_ns_ + 1; }

  /// Of the picture that was taken then. A driver's timestamp is a little later than the exposure.
  const Vec3& ForceN(int64_t exposure_ns) const { return forces_n_[FrameAt(exposure_ns)]; }
  PictureAt For(CameraId id) const {
    return [this, id](int64_t exposure_ns, uint8_t format) {
      const auto& pictures = format == kUvcYuyv ? yuyv_[Index(id)] : mjpeg_[Index(id)];
      return std::span<const uint8_t>(pictures[FrameAt(exposure_ns)]);
    };
  }

 private:
  static std::vector<uint8_t> Read(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  size_t FrameAt(int64_t exposure_ns) const {
    const int64_t exposure = exposure_ns / interval_ns_, first = first_;
    if (first < 0 || exposure < first) return static_cast<size_t>(exposure) % at_rest_;
    return static_cast<size_t>(exposure - first) % forces_n_.size();
  }

  const int64_t interval_ns_;
  std::vector<Vec3> forces_n_;
  size_t at_rest_ = 0;  // pictures that the scene begins with
  std::array<std::vector<std::vector<uint8_t>>, kCameraCount> mjpeg_, yuyv_;
  std::atomic<int64_t> first_ = -1;
};

}  // namespace taclink::testing
