#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "client/command/logs/log_export.h"
#include "client/command/logs/log_visitor.h"
#include "client/command/logs/npz.h"

namespace taclink::command {
namespace {

constexpr float kNanF = std::numeric_limits<float>::quiet_NaN();
constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct Counts {
  uint64_t frames = 0;
  uint64_t markers = 0;  // the most of any frame
  uint64_t contacts = 0;
};

// In the order of ArraysOf.
enum ArrayIndex : size_t {
  kUtc,
  kExposureUtc,
  kSequence,
  kStatus,
  kPressure,
  kTotalForce,
  kPositions,
  kDisplacements,
  kNodalForces,
  kCovariances,
  kMarkerSources,
  kContactFrame,
  kContactId,
  kContactCenter,
  kContactForce,
  kContactNormalForce,
};

std::vector<NpyArray> ArraysOf(const Counts& counts) {
  const uint64_t n = counts.frames, m = counts.markers, k = counts.contacts;
  return {{"utc_ns", NpyType::kInt64, {n}},           // log time
          {"exposure_utc_ns", NpyType::kInt64, {n}},  // 0: no picture was taken
          {"sequence", NpyType::kUint64, {n}},
          {"status", NpyType::kUint8, {n}},  // numbers of LinkStatus: 3 is OK
          {"pressure_pa", NpyType::kFloat64, {n}},
          {"total_force_n", NpyType::kFloat64, {n, 3}},
          {"positions_m", NpyType::kFloat32, {n, m, 3}},
          {"displacements_m", NpyType::kFloat32, {n, m, 3}},
          {"nodal_forces_n", NpyType::kFloat32, {n, m, 3}},
          {"displacement_covariances_m2", NpyType::kFloat32, {n, m, 6}},  // xx, xy, xz, yy, yz, zz
          {"marker_sources", NpyType::kUint8, {n, m}},                    // numbers of MarkerSource
          {"contact_frame", NpyType::kInt64, {k}},  // row of the frame in the arrays above
          {"contact_id", NpyType::kUint64, {k}},
          {"contact_center_m", NpyType::kFloat64, {k, 3}},
          {"contact_force_n", NpyType::kFloat64, {k, 3}},
          {"contact_normal_force_n", NpyType::kFloat64, {k}}};
}

uint64_t MarkersOf(const v1::LinkFrame& frame) {
  const int markers = std::max({frame.positions_m_size() / 3, frame.displacements_m_size() / 3,
                                frame.nodal_forces_n_size() / 3, frame.displacement_covariances_m2_size() / 6,
                                frame.marker_sources_size()});
  return static_cast<uint64_t>(markers);
}

/// Takes the first error of many calls.
class FirstError {
 public:
  void operator()(Result<void> result) {
    if (first_ && !result) first_ = std::move(result);
  }
  const Result<void>& get() const { return first_; }

 private:
  Result<void> first_;
};

/// The file of one link.
class LinkFile {
 public:
  static Result<std::unique_ptr<LinkFile>> Create(const std::string& path, const Counts& counts) {
    auto writer = NpzWriter::Create(path, ArraysOf(counts));
    if (!writer) return writer.error();
    return std::unique_ptr<LinkFile>(new LinkFile(path, counts, std::move(*writer)));
  }

  Result<void> Add(const v1::LinkFrame& frame, int64_t utc_ns) {
    FirstError check;
    check(out_->Append(kUtc, utc_ns));
    check(out_->Append(kExposureUtc, frame.times().exposure_utc_ns()));
    check(out_->Append(kSequence, frame.sequence()));
    check(out_->Append(kStatus, static_cast<uint8_t>(frame.status())));
    check(out_->Append(kPressure, frame.has_pressure_pa() ? frame.pressure_pa() : kNan));
    check(IsMeasured(frame)
              ? Append(kTotalForce, frame.total_force_n())
              : out_->Append(kTotalForce, std::span<const double>(std::array{kNan, kNan, kNan})));
    check(Append(kPositions, frame.positions_m(), 3));
    check(Append(kDisplacements, frame.displacements_m(), 3));
    check(Append(kNodalForces, frame.nodal_forces_n(), 3));
    check(Append(kCovariances, frame.displacement_covariances_m2(), 6));
    std::vector<uint8_t> sources(counts_.markers, 0);
    std::ranges::transform(frame.marker_sources(), sources.begin(),
                           [](int one) { return static_cast<uint8_t>(one); });
    check(out_->Append(kMarkerSources, std::span<const uint8_t>(sources)));
    for (const v1::Contact& contact : frame.contacts()) {
      check(out_->Append(kContactFrame, row_));
      check(out_->Append(kContactId, contact.id()));
      check(Append(kContactCenter, contact.center_m()));
      check(Append(kContactForce, contact.force_n()));
      check(out_->Append(kContactNormalForce, contact.normal_force_n()));
    }
    ++row_;
    return check.get();
  }

  Result<void> Finish() {
    const auto finished = out_->Finish();
    if (finished)
      fmt::print("{}: {} frames, {} markers, {} contacts\n", path_, counts_.frames, counts_.markers,
                 counts_.contacts);
    return finished;
  }

 private:
  LinkFile(std::string path, const Counts& counts, std::unique_ptr<NpzWriter> out)
      : path_(std::move(path)), counts_(counts), out_(std::move(out)) {}

  Result<void> Append(size_t array, const v1::Vector3& vector) {
    const std::array values = {vector.x(), vector.y(), vector.z()};
    return out_->Append(array, std::span<const double>(values));
  }

  /// One row; what is missing is NaN.
  Result<void> Append(size_t array, const google::protobuf::RepeatedField<float>& values, uint64_t width) {
    floats_.assign(counts_.markers * width, kNanF);
    std::copy_n(values.begin(), std::min(static_cast<size_t>(values.size()), floats_.size()),
                floats_.begin());
    return out_->Append(array, std::span<const float>(floats_));
  }

  const std::string path_;
  const Counts counts_;
  const std::unique_ptr<NpzWriter> out_;
  int64_t row_ = 0;
  std::vector<float> floats_;
};

/// A link's name may have slashes.
std::string FileNameOf(const std::string& link) {
  std::string name = link;
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0 && c != '-' && c != '_' && c != '.') c = '_';
  }
  return name + ".npz";
}

}  // namespace

// The sizes of the arrays stand before their values: the log is read twice.
Result<void> ExportNpz(LogSource& source, const LogPart& part, const std::string& folder) {
  std::map<std::string, Counts> counts;
  LogVisitor counting;
  counting.frame = [&](const v1::LinkFrame& frame, int64_t) {
    Counts& link = counts[frame.link()];
    ++link.frames;
    link.markers = std::max(link.markers, MarkersOf(frame));
    link.contacts += static_cast<uint64_t>(frame.contacts_size());
    return Result<void>();
  };
  if (const auto visited = Visit(source, part, counting); !visited) return visited;
  std::map<std::string, std::unique_ptr<LinkFile>> files;
  for (const auto& [link, count] : counts) {
    auto file = LinkFile::Create(folder + "/" + FileNameOf(link), count);
    if (!file) return file.error();
    files[link] = std::move(*file);
  }
  LogVisitor writing;
  writing.frame = [&](const v1::LinkFrame& frame, int64_t utc_ns) {
    return files.at(frame.link())->Add(frame, utc_ns);
  };
  if (const auto visited = Visit(source, part, writing); !visited) return visited;
  if (files.empty()) fmt::print("no frames\n");
  for (const auto& [link, file] : files) {
    if (const auto finished = file->Finish(); !finished) return finished;
  }
  return {};
}

}  // namespace taclink::command
