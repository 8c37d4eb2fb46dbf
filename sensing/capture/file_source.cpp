#include "sensing/capture/file_source.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "sensing/capture/image_io.h"

namespace taclink {
namespace {

constexpr const char* kExpected = "pictures named top_000001.png and bottom_000001.png (or .jpg, .jpeg)";

struct PictureName {
  CameraId camera;
  uint64_t number;
};

/// None: not such a name.
std::optional<PictureName> ParseName(std::string_view name) {
  PictureName parsed{};
  const auto camera = std::find_if(kBothCameras.begin(), kBothCameras.end(), [name](CameraId id) {
    return name.starts_with(std::string(Name(id)) + "_");
  });
  if (camera == kBothCameras.end()) return std::nullopt;
  parsed.camera = *camera;
  name.remove_prefix(std::string_view(Name(*camera)).size() + 1);
  const size_t digits = std::min(name.find_first_not_of("0123456789"), name.size());
  if (digits == 0 || digits > 18) return std::nullopt;
  for (const char digit : name.substr(0, digits))
    parsed.number = 10 * parsed.number + static_cast<uint64_t>(digit - '0');
  std::string extension(name.substr(digits));
  for (char& letter : extension)
    letter = letter >= 'A' && letter <= 'Z' ? static_cast<char>(letter + 32) : letter;
  if (extension != ".png" && extension != ".jpg" && extension != ".jpeg") return std::nullopt;
  return parsed;
}

/// Paths; empty: there is no such picture.
using PicturePair = std::array<std::string, kCameraCount>;

Result<std::vector<PicturePair>> ListPairs(const std::string& folder) {
  const auto bad = [&folder](ErrorCode code, const std::string& what) {
    return Error{code, folder + ": " + what};
  };
  std::error_code failed;
  std::map<uint64_t, PicturePair> pairs;
  std::filesystem::directory_iterator file(folder, failed);
  for (; !failed && file != std::filesystem::directory_iterator(); file.increment(failed)) {
    const auto name = ParseName(file->path().filename().string());
    if (!name) continue;
    std::string& path = pairs[name->number][Index(name->camera)];
    if (!path.empty()) {
      return bad(ErrorCode::kInvalidArgument, "has two pictures with number " + std::to_string(name->number) +
                                                  " for the " + Name(name->camera) + " camera");
    }
    path = file->path().string();
  }
  if (failed) return bad(ErrorCode::kUnavailable, failed.message() + "; expected a folder with " + kExpected);
  if (pairs.empty()) return bad(ErrorCode::kInvalidArgument, std::string("has no ") + kExpected);
  std::vector<PicturePair> list;
  list.reserve(pairs.size());
  for (auto& [number, pair] : pairs) list.push_back(std::move(pair));
  return list;
}

class FileSource final : public FrameSource {
 public:
  FileSource(FileOptions options, Clock& clock) : options_(std::move(options)), clock_(clock) {}

  Result<void> Start() override;
  Result<void> Next(StereoFrame& frame, std::chrono::milliseconds timeout) override;
  SourceInfo Info() const override;
  SourceCounters Counters() const override { return counters_; }

 private:
  Result<void> CheckSizes();
  Result<void> LoadAll();
  Result<void> Load(StereoFrame& frame);
  Result<void> Take(const std::string& path, CameraId id, RawImage& image);
  Result<void> Read(const std::string& path, RawImage& image) const;
  int64_t DueNs(uint64_t index) const {
    return start_ns_ + std::llround(1e9 * static_cast<double>(index) / options_.frame_rate_hz);
  }
  void SkipLate();

  const FileOptions options_;
  Clock& clock_;
  std::vector<PicturePair> pairs_;
  std::vector<std::array<RawImage, kCameraCount>> loaded_;  ///< by pair, if in memory
  int width_px_ = 0;
  int height_px_ = 0;
  int64_t start_ns_ = 0;
  uint64_t next_ = 0;            ///< since Start; goes on rising when the pictures begin again
  uint64_t first_sequence_ = 0;  ///< of this Start
  SourceCounters counters_;
};

Result<void> FileSource::Start() {
  if (!(options_.frame_rate_hz > 0 && options_.frame_rate_hz <= 10000)) {
    return Error{ErrorCode::kInvalidArgument,
                 options_.folder + ": frame rate must be above 0 and at most 10000 per second"};
  }
  first_sequence_ += std::exchange(next_, 0);
  auto pairs = ListPairs(options_.folder);
  if (!pairs) return pairs.error();
  pairs_ = std::move(*pairs);
  if (auto checked = CheckSizes(); !checked) {
    pairs_.clear();
    return checked;
  }
  loaded_.clear();
  if (auto loaded = options_.in_memory ? LoadAll() : Result<void>(); !loaded) {
    pairs_.clear();
    return loaded;
  }
  start_ns_ = clock_.MonotonicNs();
  if (options_.start_after_s) {
    constexpr int64_t kSecondNs = 1'000'000'000;
    start_ns_ = (start_ns_ / kSecondNs + 1) * kSecondNs + static_cast<int64_t>(1e9 * *options_.start_after_s);
  }
  return {};
}

Result<void> FileSource::LoadAll() {
  for (const PicturePair& pair : pairs_) {
    auto& images = loaded_.emplace_back();
    for (const CameraId id : kBothCameras) {
      if (pair[Index(id)].empty()) continue;
      if (auto read = Take(pair[Index(id)], id, images[Index(id)]); !read) return read;
    }
  }
  return {};
}

Result<void> FileSource::CheckSizes() {
  width_px_ = height_px_ = 0;
  std::optional<Error> unreadable;
  for (const PicturePair& pair : pairs_) {
    for (const std::string& path : pair) {
      if (path.empty()) continue;
      const auto info = ReadImageInfo(path);
      if (!info) {
        if (!unreadable) unreadable = info.error();
        continue;
      }
      if (width_px_ == 0) {
        width_px_ = info->width_px;
        height_px_ = info->height_px;
      }
      if (info->width_px != width_px_ || info->height_px != height_px_) {
        return Error{ErrorCode::kInvalidArgument,
                     path + ": is " + std::to_string(info->width_px) + "x" + std::to_string(info->height_px) +
                         ", the first picture of the folder " + std::to_string(width_px_) + "x" +
                         std::to_string(height_px_) + "; all must have one size"};
      }
    }
  }
  if (width_px_ == 0 && unreadable) return *unreadable;
  return {};
}

Result<void> FileSource::Next(StereoFrame& frame, std::chrono::milliseconds timeout) {
  if (pairs_.empty()) return Error{ErrorCode::kUnavailable, options_.folder + ": not open: start it"};
  if (options_.paced) SkipLate();
  if (!options_.loop && next_ >= pairs_.size()) {
    return Error{ErrorCode::kEndOfData, options_.folder + ": no more pictures"};
  }
  int64_t exposure_ns = clock_.MonotonicNs();
  if (options_.paced) {
    const int64_t due_ns = DueNs(next_);
    const int64_t until_ns = exposure_ns + std::chrono::nanoseconds(timeout).count();
    if (std::min(due_ns, until_ns) > exposure_ns) clock_.SleepUntilMonotonicNs(std::min(due_ns, until_ns));
    if (due_ns > until_ns)
      return Error{ErrorCode::kTimeout, options_.folder + ": the next picture is not due yet"};
    exposure_ns = due_ns;
  }
  if (auto loaded = Load(frame); !loaded) return loaded;
  frame.sequence = first_sequence_ + next_++;
  frame.pressure_mpa.reset();
  frame.times = {};
  frame.times.received_ns = clock_.MonotonicNs();
  frame.times.exposure_monotonic_ns = exposure_ns;
  frame.times.exposure_utc_ns = clock_.UtcNs() - (frame.times.received_ns - exposure_ns);
  return {};
}

/// To the newest pair that is due; a finite folder's last one is not skipped.
void FileSource::SkipLate() {
  const double late_frames =
      1e-9 * static_cast<double>(clock_.MonotonicNs() - DueNs(next_)) * options_.frame_rate_hz;
  if (late_frames < 1) return;
  uint64_t skip = static_cast<uint64_t>(late_frames);
  if (!options_.loop) skip = next_ < pairs_.size() ? std::min(skip, pairs_.size() - 1 - next_) : 0;
  next_ += skip;
  counters_.skipped_pairs += skip;
}

Result<void> FileSource::Load(StereoFrame& frame) {
  const PicturePair& pair = pairs_[next_ % pairs_.size()];
  for (const CameraId id : kBothCameras) {
    RawImage& image = frame.images[Index(id)];
    image.valid = false;
    image.why_missing.clear();
    if (pair[Index(id)].empty()) {
      ++counters_.unpaired[Index(id == CameraId::kTop ? CameraId::kBottom : CameraId::kTop)];
    } else if (!loaded_.empty()) {
      image = loaded_[next_ % pairs_.size()][Index(id)];
    } else if (auto read = Take(pair[Index(id)], id, image); !read) {
      return read;
    }
  }
  return {};
}

// One picture that is damaged or gone is like one that a camera failed to give. Errors: the folder is gone.
Result<void> FileSource::Take(const std::string& path, CameraId id, RawImage& image) {
  const auto read = Read(path, image);
  if (read) return {};
  std::error_code ignored;
  if (!std::filesystem::is_directory(options_.folder, ignored)) {
    return Error{ErrorCode::kUnavailable, options_.folder + ": the folder is gone; bring it back"};
  }
  image.valid = false;
  image.why_missing = read.error().message;
  ++counters_.damaged[Index(id)];
  return {};
}

Result<void> FileSource::Read(const std::string& path, RawImage& image) const {
  auto read = ReadRawImage(path, image);
  if (!read || !options_.yuyv || image.format != PixelFormat::kGray8) return read;
  constexpr uint8_t kNoColour = 128;
  std::vector<uint8_t> bytes;
  bytes.reserve(2 * image.bytes.size());
  for (const uint8_t gray : image.bytes) bytes.insert(bytes.end(), {gray, kNoColour});
  image.bytes = std::move(bytes);
  image.format = PixelFormat::kYuyv;
  return read;
}

SourceInfo FileSource::Info() const {
  return {"files " + options_.folder + ", " + std::to_string(pairs_.size()) + " pairs",
          width_px_,
          height_px_,
          options_.frame_rate_hz,
          {},
          options_.paced ? start_ns_ : 0};
}

}  // namespace

Result<size_t> CountPicturePairs(const std::string& folder) {
  const auto pairs = ListPairs(folder);
  if (!pairs) return pairs.error();
  return pairs->size();
}

std::unique_ptr<FrameSource> MakeFileSource(FileOptions options, Clock& clock) {
  return std::make_unique<FileSource>(std::move(options), clock);
}

}  // namespace taclink
