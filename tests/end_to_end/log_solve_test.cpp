// taclink log solve: logs of a real server, solved again.
#include <gmock/gmock.h>
#include <signal.h>

#include <algorithm>
#include <memory>
#include <set>

#include "mcap/cursor.h"
#include "mcap/file_sink.h"
#include "sensing/camera/calibration_file.h"
#include "sensing/capture/image_io.h"
#include "sensing/model/model_file.h"
#include "taclink/v1/arm.pb.h"
#include "taclink/v1/frame.pb.h"
#include "tests/end_to_end/support.h"
#include "tests/sensing/capture/pictures.h"
#include "tests/support/paths.h"
#include "wire/log/log_writer.h"
#include "wire/log/topics.h"

namespace taclink::testing {
namespace {

using std::chrono::seconds;
using ::testing::Contains;
using ::testing::Each;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using wire::log::TopicKind;

constexpr const char* kSolvedScene = R"(taclink_scene: 1
name: push
model: cylinder
frame_rate_hz: 10
duration_s: 20
pressure_keyframes: [{time_s: 0, kpa: 0.2}, {time_s: 1.5, kpa: 0.2}, {time_s: 4, kpa: 0.4}, {time_s: 20, kpa: 0.4}]
contacts:
  - {at: {path: 7, ring: 5}, force_n: 0.15, begin_s: 2, end_s: 19, ramp_s: 0.5}
)";
constexpr const char* kUntouched =
    "taclink_scene: 1\nname: rest\nmodel: cylinder\nframe_rate_hz: 10\nduration_s: 600\n";
constexpr const char* kLinkA = "    - {name: a, model: cylinder, source: simulated, scene: push.yaml}\n";

class LogSolveTest : public ScratchFolder {
 protected:
  void StartServer(const std::string& recording, const std::string& links) {
    Write("push.yaml", kSolvedScene);
    Write("rest.yaml", kUntouched);
    const std::string config =
        Write("arm.yaml", "taclink_config: 1\nrecording: {folder: logs" + recording +
                              "}\nlimits: {max_frame_age_s: 3600}\narm:\n  name: test\n  links:\n" + links);
    server_ = std::make_unique<Process>(
        std::vector<std::string>{kTaclinkd, "--config", config, "--listen", "127.0.0.1:0"});
    address_ = AddressOf(*server_);
    ASSERT_NE(address_, "");
  }
  Finished Ask(std::vector<std::string> command) const {
    command.insert(command.end(), {"--server", address_});
    Finished run = Taclink(command);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return run;
  }
  // Frames are the clock here.
  void WaitFor(const std::string& link, size_t frames, size_t contacts) const {
    Process watch({kTaclink, "watch", "--server", address_, "--json", "--patience", "60", "--links", link});
    for (int i = 0; i < 3000 && frames > 0; ++i) {
      const auto line = watch.ReadLine(seconds(60));
      ASSERT_TRUE(line.has_value());
      const json frame = json::parse(*line);
      if (frame.contains("contacts") && frame.at("contacts").size() >= contacts &&
          !frame.at("total_force_n").is_null())
        --frames;
    }
    ASSERT_EQ(frames, 0u) << "link " << link;
  }
  json RecorderStatus() const { return json::parse(Ask({"record", "status", "--json"}).out); }
  // Of the recording that goes on, with at least `more` frames more than now.
  std::string Recorded(uint64_t more) const {
    json status = RecorderStatus();
    const uint64_t wanted = status.at("frames").get<uint64_t>() + more;
    for (int i = 0; i < 3000 && status.at("frames").get<uint64_t>() < wanted; ++i) status = RecorderStatus();
    EXPECT_GE(status.at("frames").get<uint64_t>(), wanted);
    EXPECT_EQ(status.at("frames_lost"), 0);
    return Path("logs/" + status.at("log").get<std::string>());
  }
  void StopServer() {
    server_->Signal(SIGTERM);
    const Finished end = server_->Wait(seconds(60));
    ASSERT_EQ(end.exit_code, 0) << end.err;
  }

  // The simulation's cameras, or nearly so.
  std::string Cameras(const std::string& name, double focal_scale) const {
    CalibrationSummary cameras;
    cameras.rig = LoadLinkModel("cylinder").value().nominal_rig;
    for (CameraModel& camera : cameras.rig.cameras) camera.lens.focal_px *= focal_scale;
    return Write(name, CalibrationText(LoadLinkModel("cylinder").value(), cameras));
  }
  // Pictures as cameras that send MJPEG give them; the bottom one is missing once.
  std::string JpegFolder() const {
    const Finished run = Taclink(
        {"simulate", "--scene", Write("jpeg.yaml", kSolvedScene), "--out", Path("png"), "--frames", "30"});
    EXPECT_EQ(run.exit_code, 0) << run.err;
    std::filesystem::create_directory(Path("jpeg"));
    for (const auto& file : std::filesystem::directory_iterator(Path("png"))) {
      const std::string name = file.path().stem().string();
      if (file.path().extension() != ".png" || name.starts_with("rest") || name == "bottom_000015") continue;
      WriteBytes(Path("jpeg/" + name + ".jpg"), EncodeJpeg(ReadGrayImage(file.path().string()).value()));
    }
    return "    - {name: b, model: cylinder, source: files, folder: jpeg, frame_rate_hz: 10, force_model: "
           "linear, "
           "calibration: " +
           Cameras("b.yaml", 1) + "}\n";
  }

  json Solve(const std::string& log, const std::string& out, const std::vector<std::string>& options) const {
    std::vector<std::string> command = {"log", "solve", log, "-o", out, "--json"};
    command.insert(command.end(), options.begin(), options.end());
    const Finished run = Taclink(command);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    const Finished checked = Taclink({"log", "check", out});
    EXPECT_EQ(checked.exit_code, 0) << checked.out << checked.err;
    return run.exit_code == 0 ? json::parse(run.out) : json();
  }
  static json LinkOf(const json& report, const std::string& name) {
    for (const json& link : report.at("links")) {
      if (link.at("link") == name) return link;
    }
    return {};
  }

  std::unique_ptr<Process> server_;
  std::string address_;
};

std::unique_ptr<mcap::Reader> Open(const std::string& log) {
  auto source = mcap::FileSource::Open(log);
  return mcap::Reader::Open(std::shared_ptr<const mcap::ByteSource>(std::move(source).value())).value();
}

struct Message {
  uint32_t sequence;
  uint64_t log_ns, publish_ns;
  std::string bytes;
  bool operator==(const Message&) const = default;
};
std::vector<Message> Messages(const std::string& log, const std::string& topic) {
  const auto reader = Open(log);
  mcap::MessageCursor cursor(*reader, {.order = mcap::MessageOrder::kFile});
  std::vector<Message> out;
  while (const auto message = cursor.Next()) {
    if (reader->channels().at(message->channel_id).topic != topic) continue;
    out.push_back({message->sequence,
                   message->log_time_ns,
                   message->publish_time_ns,
                   {reinterpret_cast<const char*>(message->data.data()), message->data.size()}});
  }
  return out;
}

std::vector<v1::LinkFrame> Frames(const std::string& log, const std::string& link) {
  std::vector<v1::LinkFrame> out;
  for (const Message& message : Messages(log, "/links/" + link + "/frame"))
    EXPECT_TRUE(out.emplace_back().ParseFromString(message.bytes));
  return out;
}

mcap::TextMap Metadata(const std::string& log, const std::string& name) {
  const auto reader = Open(log);
  for (const auto& index : reader->metadata()) {
    if (index.name == name) return reader->ReadMetadata(index).value().metadata;
  }
  return {};
}

std::string Attachment(const std::string& log, const std::string& name) {
  const auto reader = Open(log);
  mcap::Buffer buffer;
  for (const auto& index : reader->attachments()) {
    if (index.name != name) continue;
    const auto data = reader->ReadAttachment(index, buffer).value().data;
    return {reinterpret_cast<const char*>(data.data()), data.size()};
  }
  return {};
}

// Positions and displacements are the same; whether any force differs.
bool OnlyForcesDiffer(const std::vector<v1::LinkFrame>& a, const std::vector<v1::LinkFrame>& b) {
  bool differ = false;
  EXPECT_EQ(a.size(), b.size());
  for (size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
    EXPECT_TRUE(std::equal(a[i].positions_m().begin(), a[i].positions_m().end(), b[i].positions_m().begin(),
                           b[i].positions_m().end()))
        << "frame " << a[i].sequence();
    differ = differ || !std::equal(a[i].nodal_forces_n().begin(), a[i].nodal_forces_n().end(),
                                   b[i].nodal_forces_n().begin(), b[i].nodal_forces_n().end());
  }
  return differ;
}

// All but how long it took is in the new log as in the old one.
void ExpectSameResults(const std::string& log, const std::string& again) {
  int touched = 0, one_camera = 0;
  std::set<double> pressures;
  for (const char* link : {"a", "b"}) {
    auto before = Messages(log, std::string("/links/") + link + "/frame"),
         after = Messages(again, std::string("/links/") + link + "/frame");
    ASSERT_EQ(before.size(), after.size());
    for (size_t i = 0; i < before.size(); ++i) {
      v1::LinkFrame a, b;
      ASSERT_TRUE(a.ParseFromString(before[i].bytes) && b.ParseFromString(after[i].bytes));
      touched += a.contacts_size() > 0 ? 1 : 0;
      pressures.insert(a.pressure_pa());
      one_camera += a.status_reason().find("no picture from the bottom camera") != std::string::npos ? 1 : 0;
      EXPECT_EQ(a.times().SerializeAsString(), b.times().SerializeAsString());
      a.clear_stage_times(), b.clear_stage_times();
      EXPECT_EQ(a.SerializeAsString(), b.SerializeAsString());
      before[i].bytes.clear(), after[i].bytes.clear();
      EXPECT_EQ(before[i], after[i]) << "times and number in the log";
    }
    for (const char* same : {"/camera/top", "/camera/bottom", "/scene"}) {
      const std::string topic = std::string("/links/") + link + same;
      EXPECT_GT(Messages(log, topic).size(), 0u) << topic;
      EXPECT_EQ(Messages(log, topic), Messages(again, topic)) << topic;
    }
  }
  EXPECT_GT(touched, 15);
  EXPECT_GT(pressures.size(), 10u) << "they go through Pa and back";
  EXPECT_GT(one_camera, 0);
  EXPECT_EQ(Messages(log, "/arm"), Messages(again, "/arm"));
  EXPECT_THAT(Messages(again, "/contacts"), IsEmpty());
  EXPECT_EQ(Metadata(again, "taclink.link.b"), Metadata(log, "taclink.link.b"));
  EXPECT_EQ(Metadata(again, wire::log::kSolvedName).at("links"), "a, b");
}

class LogSolveWithPicturesTest : public LogSolveTest {
 protected:
  void SolveAsItWas(const std::string& log, const std::string& again) const {
    const json report = Solve(log, again, {"--jobs", "2"});
    ASSERT_EQ(report.at("links").size(), 2u);
    for (const json& link : report.at("links")) {
      SCOPED_TRACE(link.dump());
      EXPECT_GT(link.at("frames").get<int>(), 30);
      EXPECT_EQ(link.at("solved"), link.at("frames"));
      EXPECT_EQ(link.at("identical"), link.at("frames"));
      EXPECT_THAT(link.at("warnings"), IsEmpty());
      EXPECT_THAT(link.at("changes"), IsEmpty());
      EXPECT_EQ(link.at("difference").at("marker_max_mm"), 0);
      EXPECT_GT(link.at("mean_solve_ms").get<double>(), 0);
    }
  }
  void SolveWithAnotherForceModel(const std::string& log, const std::string& again) const {
    const std::string linear = Path("linear.mcap");
    const json changed = Solve(log, linear, {"--force-model", "linear", "--without-pictures", "--link", "a"});
    const json a = LinkOf(changed, "a");
    EXPECT_LT(a.at("identical"), a.at("solved"));
    EXPECT_EQ(a.at("changes").at("force.model"), "auto -> linear");
    EXPECT_GT(a.at("difference").at("marker_max_mm"), 0) << "shape and forces are one estimate";
    EXPECT_GT(a.at("difference").at("force_max_n"), 0);
    EXPECT_EQ(Messages(log, "/links/b/frame"), Messages(linear, "/links/b/frame")) << "not asked for";
    EXPECT_THAT(Messages(linear, "/links/a/camera/top"), IsEmpty());
    EXPECT_EQ(Metadata(linear, "taclink.link.a").at("force.model"), "linear");
    EXPECT_EQ(Metadata(linear, "taclink").at("pictures"), "false");
    EXPECT_LT(std::filesystem::file_size(linear), std::filesystem::file_size(again) / 3);
  }
  void SolveWithAnotherModelAndCameras(const std::string& log) const {
    std::string softer = LinkModelText("cylinder").value();
    const std::string modulus = "youngs_modulus_mpa: ";
    ASSERT_NE(softer.find(modulus), std::string::npos);
    softer.replace(softer.find(modulus) + modulus.size(), 6, "0.0800");
    const std::string cameras = Cameras("other.yaml", 1.002), other = Path("other.mcap");
    const json settings = Solve(log, other,
                                {"--model", "a=" + Write("softer.yaml", softer), "--calibration",
                                 "b=" + cameras, "--force-model", "linear", "--without-pictures"});
    EXPECT_GT(LinkOf(settings, "a").at("difference").at("force_max_n"), 0.02) << "a fifth less";
    EXPECT_EQ(LinkOf(settings, "a").at("changes").at("model"), Path("softer.yaml"));
    EXPECT_EQ(LinkOf(settings, "b").at("changes").at("calibration"), cameras);
    EXPECT_GT(LinkOf(settings, "b").at("difference").at("marker_max_mm"), 1e-3);
    EXPECT_EQ(Attachment(other, wire::log::ModelAttachment("a")), softer);
    EXPECT_EQ(Attachment(other, wire::log::ModelAttachment("b")), LinkModelText("cylinder").value());
    EXPECT_THAT(Attachment(other, wire::log::CalibrationAttachment("b")), HasSubstr("focal_px"));
    EXPECT_NE(Attachment(other, wire::log::CalibrationAttachment("b")),
              Attachment(log, wire::log::CalibrationAttachment("b")));
    v1::Arm arm;
    ASSERT_TRUE(arm.ParseFromString(Messages(other, "/arm").at(0).bytes));
    EXPECT_LT(arm.links(0).model().material().youngs_modulus_pa(),
              arm.links(1).model().material().youngs_modulus_pa());
  }
};

TEST_F(LogSolveWithPicturesTest, TheRecordedSettingsGiveTheRecordedResults) {
  StartServer(", at_start: true, pictures: true", kLinkA + JpegFolder());
  WaitFor("a", 15, 1);
  WaitFor("b", 5, 1);
  const std::string log = Recorded(80);
  StopServer();
  const std::string again = Path("again.mcap");
  SolveAsItWas(log, again);
  ExpectSameResults(log, again);
  SolveWithAnotherForceModel(log, again);
  SolveWithAnotherModelAndCameras(log);
}

TEST_F(LogSolveTest, WithoutPicturesForcesFollowFromTheMarkers) {
  StartServer(
      ", at_start: true",
      "    - {name: a, model: cylinder, source: simulated, scene: push.yaml, force_model: pressurised}\n");
  WaitFor("a", 15, 1);
  const std::string log = Recorded(5);
  StopServer();
  const std::string same = Path("same.mcap"), linear = Path("linear.mcap");
  const json a = LinkOf(Solve(log, same, {}), "a");
  EXPECT_EQ(a.at("from"), "markers");
  EXPECT_GT(a.at("solved").get<int>(), 15);
  EXPECT_LT(a.at("solved").get<int>(), a.at("frames").get<int>()) << "rest pairs have no markers";
  EXPECT_EQ(a.at("difference").at("marker_max_mm"), 0);
  // The markers of a log are an estimate's, whose errors are alike, and not what the cameras said.
  EXPECT_LT(a.at("difference").at("force_max_n").get<double>(), 0.08) << "of 0.15 N";
  EXPECT_THAT(a.at("warnings"), Contains(HasSubstr("recorded markers")));
  EXPECT_GT(Messages(same, "/links/a/scene").size(), 0u);
  Solve(log, linear, {"--force-model", "linear"});
  EXPECT_TRUE(OnlyForcesDiffer(Frames(same, "a"), Frames(linear, "a")));
}

// Results against another baseline are not passed off as comparable.
TEST_F(LogSolveTest, ALateBeginningAndATareAreSaid) {
  StartServer("", "    - {name: a, model: cylinder, source: simulated, scene: rest.yaml}\n");
  WaitFor("a", 1, 0);
  Ask({"record", "start", "--pictures"});
  Recorded(12);
  Ask({"tare", "--force"});
  Recorded(12);
  const std::string log = Recorded(5);
  StopServer();
  const json a = LinkOf(Solve(log, Path("again.mcap"), {}), "a");
  EXPECT_THAT(a.at("warnings"), Contains(HasSubstr("measuring already")));
  EXPECT_EQ(a.at("difference").at("frames"), 0);
  EXPECT_GT(a.at("difference_of_other_baselines").at("frames").get<int>(), 10);
  EXPECT_GT(a.at("measured_only_then").get<int>(), 0) << "the rest pairs of now";
  ASSERT_EQ(a.at("not_comparable_from").size(), 2u) << a;
  EXPECT_THAT(a.at("not_comparable_from")[1].at("recorded").at("origin").get<std::string>(),
              HasSubstr("tare"));
}

TEST_F(LogSolveTest, WhatCannotBeSolvedIsRefusedAndLeavesNothing) {
  const std::string log = Path("log.mcap"), out = Path("out.mcap");
  {
    auto sink = mcap::FileSink::Create(log).value();
    auto writer = wire::log::LogWriter::Create(*sink, {}).value();
    ASSERT_TRUE(writer->AddAttachment(wire::log::ModelAttachment("a"), "application/yaml",
                                      LinkModelText("cylinder").value(), 1));
    v1::LinkFrame frame;
    frame.set_link("a");
    frame.set_detail(v1::DETAIL_GEOMETRY);
    frame.mutable_times()->set_exposure_ns(5);
    for (int i = 0; i < 3; ++i) frame.add_positions_m(0.01F);
    ASSERT_TRUE(writer->Write({.kind = TopicKind::kFrame, .link = "a"}, frame, {.log_utc_ns = 5}));
    ASSERT_TRUE(writer->mcap().Close());
  }
  const auto refused = [&](std::vector<std::string> options, const std::string& hint) {
    options.insert(options.begin(), {"log", "solve"});
    const Finished run = Taclink(options);
    EXPECT_EQ(run.exit_code, 1);
    EXPECT_THAT(run.err, HasSubstr(hint));
  };
  refused({log, "-o", out}, "none of its pictures");
  refused({log, "-o", out, "--link", "nose"}, "no link 'nose'; it has a");
  refused({log, "-o", out, "--model", "nose=cylinder"}, "nose");
  refused({log, "-o", out, "--model", Path("none.yaml")}, "none.yaml");
  refused({log, "-o", out, "--calibration", Write("bad.yaml", "taclink_calibration: x\n")}, "bad.yaml:1");
  EXPECT_FALSE(std::filesystem::exists(out));
  refused({log, "-o", log}, "log.mcap");
  refused({FuzzLog("truncated"), "-o", out}, "log recover");
  refused({FuzzLog("zstd"), "-o", out}, "no frames of any link");
  refused({Path("none.mcap"), "-o", out}, "none.mcap");
  refused({log, "-o", Path("no/folder/out.mcap")}, "no/folder");
  EXPECT_FALSE(std::filesystem::exists(out));
}

}  // namespace
}  // namespace taclink::testing
