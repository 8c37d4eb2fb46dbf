#include "tests/client/command/log_content.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <sstream>

#include "foxglove/image.pb.h"
#include "mcap/check.h"
#include "mcap/cursor.h"
#include "mcap/file_sink.h"
#include "tests/support/paths.h"

namespace taclink::testing {
namespace {

using wire::log::TopicKind;

void Set(double x, double y, double z, v1::Vector3& out) {
  out.set_x(x);
  out.set_y(y);
  out.set_z(z);
}

void AddContact(uint64_t id, double force_n, v1::LinkFrame& frame) {
  auto& contact = *frame.add_contacts();
  contact.set_id(id);
  Set(0.03, 0.01 * static_cast<double>(id), 0.1, *contact.mutable_center_m());
  Set(0, 0, 1, *contact.mutable_normal());
  Set(0.25, 0, -force_n, *contact.mutable_force_n());
  for (const double entry : {0.04, 0.0, 0.0, 0.09, 0.0, 0.16}) contact.add_force_covariance_n2(entry);
  contact.set_normal_force_n(force_n);
  contact.set_area_m2(2.5e-4);
  auto& total = *frame.mutable_total_force_n();
  Set(total.x() + 0.25, 0, total.z() - force_n, total);
}

void AddMarkers(int count, int number, v1::LinkFrame& frame) {
  for (int m = 0; m < count; ++m) {
    for (int axis = 0; axis < 3; ++axis) {
      const auto value = static_cast<float>(m) + 0.1f * static_cast<float>(axis);
      frame.add_positions_m(value);
      frame.add_displacements_m(0.001f * static_cast<float>(number));
      frame.add_nodal_forces_n(-value);
    }
    for (int entry = 0; entry < 6; ++entry)
      frame.add_displacement_covariances_m2(1e-9f * static_cast<float>(entry + 1));
    frame.add_marker_sources(m == 0 ? v1::MARKER_SOURCE_INFERRED : v1::MARKER_SOURCE_BOTH);
  }
}

v1::Event EventOf(v1::EventKind kind, const std::string& link, int frame) {
  v1::Event event;
  event.set_kind(kind);
  event.set_link(link);
  event.set_frame_sequence(static_cast<uint64_t>(frame));
  event.mutable_times()->set_raised_utc_ns(FrameUtcNs(frame) + 1000);
  event.mutable_times()->set_exposure_utc_ns(FrameUtcNs(frame) - kLatencyNs);
  return event;
}

void WriteFrames(wire::log::LogWriter& writer, const ContentOptions& options, int number) {
  for (const char* link : kLinks) {
    const int64_t utc_ns = FrameUtcNs(number) + options.shift_ns;
    const wire::log::Stamp stamp{.log_utc_ns = utc_ns,
                                 .publish_utc_ns = utc_ns - kLatencyNs,
                                 .sequence = static_cast<uint64_t>(number)};
    if (options.pictures) {
      foxglove::CompressedImage picture;
      picture.set_format("jpeg");
      picture.set_data(std::string(kPictureBytes, static_cast<char>(number)));
      EXPECT_TRUE(writer.Write({.kind = TopicKind::kPicture, .link = link}, picture, stamp).ok());
    }
    EXPECT_TRUE(writer.Write({.kind = TopicKind::kFrame, .link = link}, FrameOf(link, number), stamp).ok());
  }
}

void WriteExtra(mcap::Writer& writer, int64_t utc_ns) {
  const auto channel = writer.AddChannel({.topic = "/extra", .message_encoding = "json"});
  ASSERT_TRUE(channel.ok());
  const auto time_ns = static_cast<uint64_t>(utc_ns);
  ASSERT_TRUE(writer
                  .Write({.channel_id = *channel,
                          .sequence = 1,
                          .log_time_ns = time_ns,
                          .publish_time_ns = time_ns,
                          .data = mcap::AsBytes("{}")})
                  .ok());
}

}  // namespace

int MarkersOf(const std::string& link) {
  return link == "upper" ? 4 : 3;
}

bool IsMeasuredFrame(const std::string& link, int frame) {
  return link != "upper" || frame < 50 || frame > 54;
}

v1::LinkFrame FrameOf(const std::string& link, int number) {
  v1::LinkFrame frame;
  frame.set_link(link);
  frame.set_sequence(static_cast<uint64_t>(number));
  frame.set_detail(v1::DETAIL_FULL);
  auto& times = *frame.mutable_times();
  times.set_published_ns(5'000'000'000 + number * kFrameNs + kLatencyNs);
  if (!IsMeasuredFrame(link, number)) {
    frame.set_status(v1::LINK_STATUS_LOST);
    frame.set_status_reason("the \"top\" camera is gone, plug it in");
    return frame;
  }
  times.set_exposure_utc_ns(FrameUtcNs(number) - kLatencyNs);
  times.set_exposure_ns(5'000'000'000 + number * kFrameNs);
  frame.set_status(v1::LINK_STATUS_OK);
  if (link == "upper") frame.set_pressure_pa(2000 + number);
  frame.set_force_model(v1::FORCE_MODEL_LINEAR);
  frame.set_tracking_mode(v1::TRACKING_MODE_TRACKED);
  frame.set_markers_seen(static_cast<uint32_t>(MarkersOf(link) - 1));
  frame.set_markers_inferred(1);
  AddMarkers(MarkersOf(link), number, frame);
  Set(0, 0, 0, *frame.mutable_total_force_n());
  if (link == "upper" && number >= 20 && number < 40) AddContact(7, 0.125 * (number - 19), frame);
  if (link == "lower") AddContact(1, 1, frame);
  if (link == "lower") AddContact(2, 0.5, frame);
  return frame;
}

std::vector<std::pair<int64_t, v1::Event>> Events() {
  std::vector<v1::Event> events;
  events.push_back(EventOf(v1::EVENT_KIND_CONTACT_BEGIN, "upper", 20));
  events.back().mutable_contact()->set_contact_id(7);
  Set(1, 2, 3, *events.back().mutable_contact()->mutable_center_m());
  Set(4, 5, 6, *events.back().mutable_contact()->mutable_force_n());
  events.push_back(EventOf(v1::EVENT_KIND_FORCE_LEVEL, "upper", 30));
  events.back().mutable_force_level()->set_level(v1::FORCE_LEVEL_ALARM);
  events.back().mutable_force_level()->set_previous(v1::FORCE_LEVEL_WARNING);
  events.back().mutable_force_level()->set_force_n(12.5);
  events.push_back(EventOf(v1::EVENT_KIND_CONTACT_END, "upper", 40));
  events.back().mutable_contact()->set_contact_id(7);
  events.back().mutable_contact()->set_duration_s(2);
  events.back().mutable_contact()->set_end_reason("released");
  events.push_back(EventOf(v1::EVENT_KIND_LINK_STATUS, "upper", 50));
  events.back().mutable_link_status()->set_status(v1::LINK_STATUS_LOST);
  events.back().mutable_link_status()->set_previous(v1::LINK_STATUS_OK);
  events.back().mutable_link_status()->set_reason("gone, \"unplugged\"");
  events.push_back(EventOf(v1::EVENT_KIND_TARE, "lower", 60));
  events.back().mutable_operation()->set_who("10.0.0.1");
  events.back().mutable_operation()->set_accepted(true);
  events.back().mutable_operation()->set_outcome("new baseline");
  events.push_back(EventOf(v1::EVENT_KIND_DRIFT, "lower", 70));
  events.back().mutable_drift()->set_drift_m(1e-4);
  events.push_back(EventOf(v1::EVENT_KIND_FRAMES_LOST, "lower", 80));
  events.back().mutable_frames_lost()->set_frames(3);
  events.push_back(EventOf(v1::EVENT_KIND_BASELINE, "", 90));
  std::vector<std::pair<int64_t, v1::Event>> out;
  for (v1::Event& event : events) {
    event.set_sequence(out.size() + 1);
    out.emplace_back(event.times().raised_utc_ns(), event);
  }
  return out;
}

v1::JointSample JointsOf(int number) {
  v1::JointSample sample;
  for (const char* name : {"shoulder", "elbow"}) {
    sample.add_names(name);
    sample.add_positions(0.01 * number);
    if (number % 2 == 0) sample.add_velocities(0.5);
  }
  sample.set_utc_ns(JointsUtcNs(number) - 1);
  return sample;
}

void WriteLog(const std::string& path, const ContentOptions& options) {
  auto sink = mcap::FileSink::Create(path);
  ASSERT_TRUE(sink.ok()) << sink.error().message;
  auto writer = wire::log::LogWriter::Create(
      **sink, {.profile = "test", .compression = options.compression, .chunk_bytes = 4096});
  ASSERT_TRUE(writer.ok());
  const int64_t start_ns = kStartUtcNs + options.shift_ns;
  ASSERT_TRUE((*writer)->AddAttachment("taclinkd.yaml", "text/plain", "arm: {}", start_ns).ok());
  ASSERT_TRUE((*writer)->AddAttachment("note.txt", "text/plain", options.note, start_ns).ok());
  ASSERT_TRUE((*writer)->AddMetadata("taclink", {{"note", options.note}}).ok());
  std::vector<std::pair<int64_t, v1::Event>> events = Events();
  for (int number = 0; number < options.frames; ++number) {
    if (number % 5 == 0 && number / 5 < kJointSamples) {
      const int64_t utc_ns = JointsUtcNs(number / 5) + options.shift_ns;
      ASSERT_TRUE(
          (*writer)->Write({.kind = TopicKind::kJoints}, JointsOf(number / 5), {.log_utc_ns = utc_ns}).ok());
    }
    WriteFrames(**writer, options, number);
    if (events.empty() || events.front().first > FrameUtcNs(number + 1)) continue;
    const auto& [utc_ns, event] = events.front();
    ASSERT_TRUE((*writer)
                    ->Write({.kind = TopicKind::kEvents}, event,
                            {.log_utc_ns = utc_ns + options.shift_ns, .sequence = event.sequence()})
                    .ok());
    events.erase(events.begin());
  }
  WriteExtra((*writer)->mcap(), FrameUtcNs(options.frames - 1) + options.shift_ns);
  ASSERT_TRUE((*writer)->mcap().Close().ok());
}

std::unique_ptr<mcap::Reader> OpenLog(const std::string& path) {
  auto source = mcap::FileSource::Open(path);
  EXPECT_TRUE(source.ok()) << source.error().message;
  auto reader = mcap::Reader::Open(std::move(*source));
  EXPECT_TRUE(reader.ok()) << reader.error().message;
  return std::move(*reader);
}

std::vector<LoggedMessage> MessagesIn(const std::string& path) {
  const auto reader = OpenLog(path);
  mcap::MessageCursor cursor(*reader, {.order = mcap::MessageOrder::kFile});
  std::vector<LoggedMessage> messages;
  while (const auto message = cursor.Next()) {
    const mcap::Channel& channel = reader->channels().at(message->channel_id);
    messages.push_back({.topic = channel.topic,
                        .schema = channel.schema_id == 0 ? "" : reader->schemas().at(channel.schema_id).name,
                        .sequence = message->sequence,
                        .log_time_ns = message->log_time_ns,
                        .publish_time_ns = message->publish_time_ns,
                        .data = std::string(mcap::AsText(message->data))});
  }
  return messages;
}

std::vector<std::pair<std::string, std::string>> AttachmentsIn(const std::string& path) {
  const auto reader = OpenLog(path);
  std::vector<std::pair<std::string, std::string>> out;
  for (const auto& index : reader->attachments()) {
    mcap::Buffer buffer;
    const auto attachment = reader->ReadAttachment(index, buffer);
    EXPECT_TRUE(attachment.ok());
    out.emplace_back(attachment->name, mcap::AsText(attachment->data));
  }
  return out;
}

std::vector<mcap::Metadata> MetadataIn(const std::string& path) {
  const auto reader = OpenLog(path);
  std::vector<mcap::Metadata> out;
  for (const auto& index : reader->metadata()) out.push_back(*reader->ReadMetadata(index));
  return out;
}

::testing::AssertionResult IsWhole(const std::string& path) {
  const auto source = mcap::FileSource::Open(path);
  if (!source) return ::testing::AssertionFailure() << source.error().message;
  const auto report = mcap::Check(**source);
  if (!report) return ::testing::AssertionFailure() << report.error().message;
  if (report->findings.empty()) return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << report->findings.front().what;
}

std::string FileText(const std::string& path) {
  const std::ifstream file(path, std::ios::binary);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

LogToolTest::LogToolTest() {
  const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
  std::string name = fmt::format("{}.{}.{}", test->test_suite_name(), test->name(), getpid());
  std::ranges::replace(name, '/', '_');  // of parameters
  folder_ = std::filesystem::temp_directory_path() / name;
  std::filesystem::create_directories(folder_);
}

Finished LogToolTest::Log(const std::vector<std::string>& arguments) {
  std::vector<std::string> command = {kTaclink, "log"};
  command.insert(command.end(), arguments.begin(), arguments.end());
  return RunToEnd(command);
}

void LogToolTest::LogDoes(const std::vector<std::string>& arguments) {
  const Finished run = Log(arguments);
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_EQ(run.err, "");
}

std::string LogToolTest::Truncated(const std::string& path, double share) const {
  const std::string cut_off = path + ".truncated";
  std::filesystem::copy_file(path, cut_off);
  const auto size = static_cast<double>(std::filesystem::file_size(path));
  std::filesystem::resize_file(cut_off, static_cast<uintmax_t>(share * size));
  return cut_off;
}

}  // namespace taclink::testing
