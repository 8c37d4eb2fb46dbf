// taclink log export, CSV and JSON lines, on logs of known content.
#include <gmock/gmock.h>
#include <google/protobuf/descriptor.pb.h>
#include <google/protobuf/dynamic_message.h>
#include <google/protobuf/util/json_util.h>
#include <google/protobuf/util/message_differencer.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include "foxglove/image.pb.h"
#include "mcap/file_sink.h"
#include "tests/client/command/log_content.h"

namespace taclink::testing {
namespace {

using google::protobuf::util::MessageDifferencer;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

using Row = std::map<std::string, std::string>;  // by column

// RFC 4180, but for line ends in cells.
std::vector<std::string> Cells(const std::string& line) {
  std::vector<std::string> cells(1);
  bool quoted = false;
  for (size_t i = 0; i < line.size(); ++i) {
    if (quoted && line[i] == '"' && i + 1 < line.size() && line[i + 1] == '"') {
      cells.back() += line[++i];
    } else if (line[i] == '"') {
      quoted = !quoted;
    } else if (line[i] == ',' && !quoted) {
      cells.emplace_back();
    } else {
      cells.back() += line[i];
    }
  }
  return cells;
}

std::vector<Row> ReadCsv(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  const std::vector<std::string> columns = Cells(line);
  std::vector<Row> rows;
  while (std::getline(file, line)) {
    const std::vector<std::string> cells = Cells(line);
    EXPECT_EQ(cells.size(), columns.size()) << path << ": " << line;
    Row row;
    for (size_t i = 0; i < std::min(cells.size(), columns.size()); ++i) row[columns[i]] = cells[i];
    rows.push_back(std::move(row));
  }
  return rows;
}

double Number(const Row& row, const std::string& column) {
  return std::stod(row.at(column));
}

class LogExportTest : public LogToolTest {
 protected:
  LogExportTest() { WriteLog(log_); }
  std::vector<Row> Csv(const std::string& table) const { return ReadCsv(folder_ + "/" + table + ".csv"); }
  std::vector<json> Lines() const {
    std::ifstream file(folder_ + "/messages.jsonl");
    std::vector<json> lines;
    for (std::string line; std::getline(file, line);) lines.push_back(json::parse(line));
    return lines;
  }
  const std::string log_ = Path("log.mcap"), folder_ = Path("new/folder");
};

TEST_F(LogExportTest, FramesAreRows) {
  LogDoes({"export", log_, "-o", folder_, "--format", "csv"});
  const std::vector<Row> rows = Csv("frames");
  ASSERT_EQ(rows.size(), 2u * kFrames);
  for (size_t i = 0; i < rows.size(); ++i) {
    const int number = static_cast<int>(i) / 2;
    const v1::LinkFrame frame = FrameOf(kLinks[i % 2], number);
    const Row& row = rows[i];
    EXPECT_EQ(row.at("utc_ns"), std::to_string(FrameUtcNs(number)));
    EXPECT_EQ(row.at("link"), frame.link());
    EXPECT_EQ(row.at("sequence"), std::to_string(number));
    EXPECT_EQ(row.at("status_reason"), frame.status_reason());
    EXPECT_EQ(row.at("contacts"), frame.has_total_force_n() ? std::to_string(frame.contacts_size()) : "");
    EXPECT_EQ(row.at("markers_seen"), std::to_string(frame.markers_seen()));
    EXPECT_EQ(row.at("pressure_pa"), frame.has_pressure_pa() ? std::to_string(2000 + number) : "");
    if (!IsMeasuredFrame(frame.link(), number)) {
      EXPECT_EQ(row.at("status"), "lost");
      for (const char* column : {"exposure_utc_ns", "latency_s", "total_force_x_n", "total_force_z_n"})
        EXPECT_EQ(row.at(column), "") << column;
      continue;
    }
    EXPECT_EQ(row.at("status"), "ok");
    EXPECT_EQ(row.at("exposure_utc_ns"), std::to_string(kStartUtcNs + number * kFrameNs));
    EXPECT_DOUBLE_EQ(Number(row, "latency_s"), 0.02);
    EXPECT_DOUBLE_EQ(Number(row, "total_force_z_n"), frame.total_force_n().z());
    EXPECT_EQ(row.at("force_model"), "linear");
  }
}

TEST_F(LogExportTest, ContactsAreRows) {
  LogDoes({"export", log_, "-o", folder_, "--format", "csv", "--link", "upper"});
  const std::vector<Row> rows = Csv("contacts");
  ASSERT_EQ(rows.size(), 20u);
  for (size_t i = 0; i < rows.size(); ++i) {
    const Row& row = rows[i];
    const double force_n = 0.125 * static_cast<double>(i + 1);
    EXPECT_EQ(row.at("sequence"), std::to_string(20 + i));
    EXPECT_EQ(row.at("contact_id"), "7");
    EXPECT_EQ(row.at("center_y_m"), "0.07");
    EXPECT_EQ(row.at("normal_z"), "1");
    EXPECT_EQ(Number(row, "force_z_n"), -force_n);
    EXPECT_EQ(Number(row, "normal_force_n"), force_n);
    EXPECT_DOUBLE_EQ(Number(row, "force_sigma_x_n"), 0.2);
    EXPECT_DOUBLE_EQ(Number(row, "force_sigma_y_n"), 0.3);
    EXPECT_DOUBLE_EQ(Number(row, "force_sigma_z_n"), 0.4);
    EXPECT_EQ(row.at("area_m2"), "0.00025");
  }
  for (const Row& row : Csv("frames")) EXPECT_EQ(row.at("link"), "upper");
  for (const Row& row : Csv("events")) EXPECT_NE(row.at("link"), "lower");
}

TEST_F(LogExportTest, EventsAreRowsOfTheSameColumns) {
  LogDoes({"export", log_, "-o", folder_, "--format", "csv"});
  const std::vector<Row> rows = Csv("events");
  ASSERT_EQ(rows.size(), Events().size());
  const char* kinds[] = {"contact_begin", "force_level", "contact_end", "link_status",
                         "tare",          "drift",       "frames_lost", "baseline"};
  for (size_t i = 0; i < rows.size(); ++i) {
    EXPECT_EQ(rows[i].at("kind"), kinds[i]);
    EXPECT_EQ(rows[i].at("sequence"), std::to_string(i + 1));
    EXPECT_EQ(rows[i].at("utc_ns"), std::to_string(Events()[i].first));
    EXPECT_EQ(rows[i].at("link"), Events()[i].second.link());
  }
  EXPECT_EQ(rows[0].at("contact_id"), "7");
  EXPECT_EQ(rows[0].at("center_z_m"), "3");
  EXPECT_EQ(rows[0].at("force_x_n"), "4");
  EXPECT_EQ(rows[0].at("level"), "");
  EXPECT_EQ(rows[1].at("level"), "alarm");
  EXPECT_EQ(rows[1].at("previous_level"), "warning");
  EXPECT_EQ(rows[1].at("strongest_force_n"), "12.5");
  EXPECT_EQ(rows[2].at("end_reason"), "released");
  EXPECT_EQ(rows[2].at("duration_s"), "2");
  EXPECT_EQ(rows[3].at("status"), "lost");
  EXPECT_EQ(rows[3].at("text"), "gone, \"unplugged\"");
  EXPECT_EQ(rows[4].at("who"), "10.0.0.1");
  EXPECT_EQ(rows[4].at("accepted"), "true");
  EXPECT_EQ(rows[4].at("text"), "new baseline");
  EXPECT_EQ(rows[5].at("drift_m"), "0.0001");
  EXPECT_EQ(rows[6].at("frames_lost"), "3");
}

TEST_F(LogExportTest, JointsAreRows) {
  LogDoes({"export", log_, "-o", folder_, "--format", "csv"});
  const std::vector<Row> rows = Csv("joints");
  ASSERT_EQ(rows.size(), 2u * kJointSamples);
  for (size_t i = 0; i < rows.size(); ++i) {
    const int number = static_cast<int>(i) / 2;
    EXPECT_EQ(rows[i].at("sample_utc_ns"), std::to_string(JointsUtcNs(number) - 1));
    EXPECT_EQ(rows[i].at("joint"), i % 2 == 0 ? "shoulder" : "elbow");
    EXPECT_DOUBLE_EQ(Number(rows[i], "position_rad_or_m"), 0.01 * number);
    EXPECT_EQ(rows[i].at("velocity_rad_per_s_or_m_per_s"), number % 2 == 0 ? "0.5" : "");
  }
}

TEST_F(LogExportTest, LinesHoldTheMessages) {
  const Finished run = Log({"export", log_, "-o", folder_, "--format", "jsonl"});
  EXPECT_EQ(run.exit_code, 0);
  EXPECT_THAT(run.err, AllOf(HasSubstr("/extra"), HasSubstr("json"))) << "that this topic is left out";
  const auto all = MessagesIn(log_);
  const std::vector<json> lines = Lines();
  ASSERT_EQ(lines.size(), all.size() - 1);
  for (size_t i = 0; i < lines.size(); ++i) {
    EXPECT_EQ(lines[i].at("topic"), all[i].topic);
    EXPECT_EQ(lines[i].at("schema"), all[i].schema);
    EXPECT_EQ(lines[i].at("log_time_ns"), all[i].log_time_ns);
    EXPECT_EQ(lines[i].at("publish_time_ns"), all[i].publish_time_ns);
    EXPECT_EQ(lines[i].at("sequence"), all[i].sequence);
    EXPECT_EQ(lines[i].value("left_out_bytes", 0u),
              all[i].schema == "foxglove.CompressedImage" ? kPictureBytes : 0);
    if (all[i].topic != "/links/upper/frame") continue;
    EXPECT_TRUE(lines[i].at("message").contains("markers_seen")) << "the fields' own names, also of 0";
    v1::LinkFrame frame;
    ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(lines[i].at("message").dump(), &frame).ok());
    EXPECT_TRUE(MessageDifferencer::Equals(frame, FrameOf("upper", static_cast<int>(all[i].sequence))));
  }
}

TEST_F(LogExportTest, PicturesComeWhenAskedFor) {
  Log({"export", log_, "-o", folder_, "--format", "jsonl", "--with-pictures", "--from", "1", "--to", "1.5"});
  size_t pictures = 0;
  for (const json& line : Lines()) {
    if (line.at("schema") != "foxglove.CompressedImage") continue;
    foxglove::CompressedImage picture;
    ASSERT_TRUE(google::protobuf::util::JsonStringToMessage(line.at("message").dump(), &picture).ok());
    EXPECT_EQ(picture.data(), std::string(kPictureBytes, static_cast<char>(line.at("sequence").get<int>())));
    ++pictures;
  }
  EXPECT_EQ(pictures, 10u);
}

// A type that the program was not built with.
TEST_F(LogExportTest, LinesNeedNothingButTheSchemaInTheLog) {
  google::protobuf::FileDescriptorSet files;
  auto& file = *files.add_file();
  file.set_name("thing.proto");
  file.set_package("test");
  file.set_syntax("proto3");
  auto& type = *file.add_message_type();
  type.set_name("Thing");
  auto& field = *type.add_field();
  field.set_name("some_number");
  field.set_number(1);
  field.set_label(google::protobuf::FieldDescriptorProto::LABEL_OPTIONAL);
  field.set_type(google::protobuf::FieldDescriptorProto::TYPE_INT32);
  const std::string path = Path("other.mcap");
  auto sink = mcap::FileSink::Create(path);
  auto writer = mcap::Writer::Create(**sink);
  const auto write = [&](const std::string& topic, const std::string& schema, const std::string& schema_data,
                         const std::string& data) {
    const auto id = (*writer)->AddSchema({.name = schema, .encoding = "protobuf", .data = schema_data});
    const auto channel =
        (*writer)->AddChannel({.schema_id = *id, .topic = topic, .message_encoding = "protobuf"});
    ASSERT_TRUE(
        (*writer)->Write({.channel_id = *channel, .log_time_ns = 1, .data = mcap::AsBytes(data)}).ok());
  };
  write("/thing", "test.Thing", files.SerializeAsString(), "\x08\x2A");
  write("/broken", "test.Thing", files.SerializeAsString(), "\x08");
  write("/no_type", "test.Other", files.SerializeAsString(), "");
  write("/no_schema", "test.Thing", "\xFF\xFF", "");
  ASSERT_TRUE((*writer)->Close().ok());
  const Finished run = Log({"export", path, "-o", folder_, "--format", "jsonl"});
  EXPECT_EQ(run.exit_code, 0) << run.err;
  EXPECT_THAT(run.err, AllOf(HasSubstr("/broken"), HasSubstr("/no_type"), HasSubstr("/no_schema")));
  EXPECT_THAT(run.err, AllOf(Not(HasSubstr("/thing")), Not(HasSubstr("recover")))) << "the log is whole";
  ASSERT_EQ(Lines().size(), 1u);
  EXPECT_EQ(Lines()[0].at("message"), json({{"some_number", 42}}));
}

TEST_F(LogExportTest, NothingIsOverwritten) {
  std::filesystem::create_directories(folder_);
  std::ofstream(folder_ + "/events.csv") << "precious";
  const Finished run = Log({"export", log_, "-o", folder_, "--format", "csv"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.err, HasSubstr("events.csv"));
  EXPECT_EQ(FileText(folder_ + "/events.csv"), "precious");
  EXPECT_FALSE(std::filesystem::exists(folder_ + "/frames.csv"));
  const Finished file = Log({"export", log_, "-o", log_, "--format", "csv"});
  EXPECT_EQ(file.exit_code, 1);
  EXPECT_THAT(file.err, HasSubstr("log.mcap"));
}

TEST_F(LogExportTest, ATruncatedLogGivesWhatIsIntactAndSaysSo) {
  const std::string torn = Truncated(log_, 0.6);
  for (const std::string format : {"csv", "jsonl", "npz"}) {
    const Finished run = Log({"export", torn, "-o", Path(format), "--format", format});
    EXPECT_EQ(run.exit_code, 0) << format;
    EXPECT_THAT(run.err, AllOf(HasSubstr("taclink log recover"), HasSubstr(torn))) << format;
  }
  const size_t frames = ReadCsv(Path("csv/frames.csv")).size();
  EXPECT_GT(frames, 40u);
  EXPECT_LT(frames, 2u * kFrames);
}

}  // namespace
}  // namespace taclink::testing
