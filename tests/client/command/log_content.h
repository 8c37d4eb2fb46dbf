#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "mcap/reader.h"
#include "taclink/v1/events.pb.h"
#include "taclink/v1/frame.pb.h"
#include "taclink/v1/log.pb.h"
#include "tests/support/process.h"
#include "wire/log/log_writer.h"

// Logs whose content is known: ten seconds of two links. "upper" (4 markers) has contact 7 from frame 20 to
// 39 and measures nothing from frame 50 to 54; "lower" (3 markers) has contacts 1 and 2 in every frame.
namespace taclink::testing {

inline constexpr int64_t kStartUtcNs = 1'767'323'045'000'000'000;  // 2026-01-02T03:04:05Z
inline constexpr int64_t kFrameNs = 100'000'000;
inline constexpr int64_t kLatencyNs = 20'000'000;
inline constexpr int kFrames = 100;
inline constexpr size_t kPictureBytes = 1000;
inline constexpr const char* kLinks[] = {"upper", "lower"};

/// Log time of a link's frame.
inline int64_t FrameUtcNs(int frame) {
  return kStartUtcNs + frame * kFrameNs + kLatencyNs;
}
int MarkersOf(const std::string& link);
bool IsMeasuredFrame(const std::string& link, int frame);
/// At full detail.
v1::LinkFrame FrameOf(const std::string& link, int frame);
/// All kinds, in order of time; with the log time of each.
std::vector<std::pair<int64_t, v1::Event>> Events();
/// Every half second, those of odd number without velocities.
v1::JointSample JointsOf(int number);
inline constexpr int kJointSamples = 20;
inline int64_t JointsUtcNs(int number) {
  return kStartUtcNs + number * 5 * kFrameNs + 1;
}

struct ContentOptions {
  mcap::Compression compression = mcap::Compression::kZstd;
  bool pictures = true;
  int64_t shift_ns = 0;        ///< of all times
  std::string note = "first";  ///< in the metadata and in the attachment "note.txt"
  int frames = kFrames;
};
/// Writes the content to a new file in many small chunks; with two attachments, a metadata record, and the
/// topic /extra of JSON without a schema.
void WriteLog(const std::string& path, const ContentOptions& options = {});

/// A message as it is in a file.
struct LoggedMessage {
  std::string topic, schema;
  uint32_t sequence = 0;
  uint64_t log_time_ns = 0, publish_time_ns = 0;
  std::string data;
  bool operator==(const LoggedMessage&) const = default;
};
/// In the order of the file.
std::vector<LoggedMessage> MessagesIn(const std::string& path);
std::unique_ptr<mcap::Reader> OpenLog(const std::string& path);
/// Name and bytes of each.
std::vector<std::pair<std::string, std::string>> AttachmentsIn(const std::string& path);
std::vector<mcap::Metadata> MetadataIn(const std::string& path);
/// Finds nothing wrong with the file by the specification.
::testing::AssertionResult IsWhole(const std::string& path);

std::string FileText(const std::string& path);

/// Runs the program in a folder of its own.
class LogToolTest : public ::testing::Test {
 protected:
  LogToolTest();
  ~LogToolTest() override { std::filesystem::remove_all(folder_); }

  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  /// `taclink log ...`.
  static Finished Log(const std::vector<std::string>& arguments);
  /// The same; fails the test if it fails, or says anything on stderr.
  static void LogDoes(const std::vector<std::string>& arguments);
  /// The same, of the file cut off after `share` of its bytes.
  std::string Truncated(const std::string& path, double share) const;
  bool Exists(const std::string& name) const { return std::filesystem::exists(folder_ / name); }

 private:
  std::filesystem::path folder_;
};

}  // namespace taclink::testing
