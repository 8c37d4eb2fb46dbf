// taclink log export --format npz, and the files' format itself.
#include <gmock/gmock.h>

#include <cmath>
#include <numeric>

#include "client/command/logs/npz.h"
#include "tests/client/command/log_content.h"
#include "tests/client/command/npy_reader.h"

namespace taclink::testing {
namespace {

using command::NpyArray;
using command::NpyType;
using command::NpzWriter;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsNan;

using Shape = std::vector<uint64_t>;

class LogNpzTest : public LogToolTest {
 protected:
  const std::string log_ = Path("log.mcap"), folder_ = Path("arrays");
};

TEST_F(LogNpzTest, ArraysHaveTheirShapesAndTypes) {
  WriteLog(log_);
  LogDoes({"export", log_, "-o", folder_, "--format", "npz"});
  for (const std::string link : kLinks) {
    const auto arrays = ReadNpz(folder_ + "/" + link + ".npz");
    const auto markers = static_cast<uint64_t>(MarkersOf(link));
    EXPECT_EQ(arrays.at("positions_m").shape, (Shape{kFrames, markers, 3}));
    EXPECT_EQ(arrays.at("displacement_covariances_m2").shape, (Shape{kFrames, markers, 6}));
    EXPECT_EQ(arrays.at("marker_sources").shape, (Shape{kFrames, markers}));
    EXPECT_EQ(arrays.at("total_force_n").shape, (Shape{kFrames, 3}));
    EXPECT_EQ(arrays.at("utc_ns").shape, (Shape{kFrames}));
    EXPECT_EQ(arrays.at("utc_ns").type, "<i8");
    EXPECT_EQ(arrays.at("sequence").type, "<u8");
    EXPECT_EQ(arrays.at("status").type, "|u1");
    EXPECT_EQ(arrays.at("positions_m").type, "<f4");
    EXPECT_EQ(arrays.at("pressure_pa").type, "<f8");
  }
}

TEST_F(LogNpzTest, ArraysHoldEveryFrameOfALink) {
  WriteLog(log_);
  LogDoes({"export", log_, "-o", folder_, "--format", "npz"});
  for (const std::string link : kLinks) {
    const std::string path = folder_ + "/" + link + ".npz";
    EXPECT_EQ(PythonZipTest(path), "");
    const auto arrays = ReadNpz(path);
    const auto markers = static_cast<size_t>(MarkersOf(link));
    const auto utc_ns = arrays.at("utc_ns").Values<int64_t>();
    const auto exposure_ns = arrays.at("exposure_utc_ns").Values<int64_t>();
    const auto sequence = arrays.at("sequence").Values<uint64_t>();
    const auto status = arrays.at("status").Values<uint8_t>();
    const auto pressure = arrays.at("pressure_pa").Values<double>();
    const auto total = arrays.at("total_force_n").Values<double>();
    const auto positions = arrays.at("positions_m").Values<float>();
    const auto sources = arrays.at("marker_sources").Values<uint8_t>();
    const auto covariances = arrays.at("displacement_covariances_m2").Values<float>();
    for (size_t i = 0; i < kFrames; ++i) {
      const v1::LinkFrame frame = FrameOf(link, static_cast<int>(i));
      EXPECT_EQ(utc_ns[i], FrameUtcNs(static_cast<int>(i)));
      EXPECT_EQ(exposure_ns[i], frame.times().exposure_utc_ns());
      EXPECT_EQ(sequence[i], i);
      EXPECT_EQ(status[i], frame.status());
      EXPECT_EQ(std::isnan(pressure[i]), !frame.has_pressure_pa());
      if (frame.has_pressure_pa()) {
        EXPECT_EQ(pressure[i], frame.pressure_pa());
      }
      const std::vector<float> row(positions.begin() + static_cast<ptrdiff_t>(i * markers * 3),
                                   positions.begin() + static_cast<ptrdiff_t>((i + 1) * markers * 3));
      if (!IsMeasuredFrame(link, static_cast<int>(i))) {
        EXPECT_THAT(row, Each(IsNan()));
        EXPECT_TRUE(std::isnan(total[3 * i]));
        EXPECT_TRUE(std::isnan(covariances[i * markers * 6]));
        EXPECT_EQ(sources[i * markers], 0);
        continue;
      }
      EXPECT_EQ(row, std::vector<float>(frame.positions_m().begin(), frame.positions_m().end()));
      EXPECT_EQ(total[3 * i + 2], frame.total_force_n().z());
      EXPECT_EQ(sources[i * markers], v1::MARKER_SOURCE_INFERRED);
      EXPECT_EQ(sources[i * markers + 1], v1::MARKER_SOURCE_BOTH);
      EXPECT_EQ(covariances[i * markers * 6 + 5], 1e-9f * 6);
    }
  }
}

TEST_F(LogNpzTest, ContactsNameTheirFrame) {
  WriteLog(log_);
  LogDoes({"export", log_, "-o", folder_, "--format", "npz", "--link", "upper", "--from", "2.5"});
  EXPECT_FALSE(Exists("arrays/lower.npz"));
  const auto arrays = ReadNpz(folder_ + "/upper.npz");
  const auto sequence = arrays.at("sequence").Values<uint64_t>();
  const auto frame = arrays.at("contact_frame").Values<int64_t>();
  const auto force = arrays.at("contact_normal_force_n").Values<double>();
  EXPECT_EQ(sequence.front(), 25u);
  ASSERT_EQ(frame.size(), 15u);
  for (size_t i = 0; i < frame.size(); ++i) {
    EXPECT_EQ(sequence.at(static_cast<size_t>(frame[i])), 25 + i);
    EXPECT_EQ(force[i], 0.125 * static_cast<double>(6 + i));
  }
  EXPECT_EQ(arrays.at("contact_id").Values<uint64_t>().front(), 7u);
  EXPECT_EQ(arrays.at("contact_center_m").shape, (Shape{15, 3}));
  EXPECT_EQ(arrays.at("contact_center_m").Values<double>()[1], 0.07);
  EXPECT_EQ(arrays.at("contact_force_n").Values<double>()[0], 0.25);
}

TEST_F(LogNpzTest, NothingIsOverwritten) {
  WriteLog(log_);
  LogDoes({"export", log_, "-o", folder_, "--format", "npz", "--link", "upper"});
  const Finished run = Log({"export", log_, "-o", folder_, "--format", "npz"});
  EXPECT_EQ(run.exit_code, 1);
  EXPECT_THAT(run.err, HasSubstr("upper.npz"));
  EXPECT_FALSE(Exists("arrays/lower.npz"));
  EXPECT_EQ(PythonZipTest(folder_ + "/upper.npz"), "");
}

class NpzWriterTest : public LogToolTest {};

std::vector<double> Counted(size_t count) {
  std::vector<double> values(count);
  std::iota(values.begin(), values.end(), 0.5);
  return values;
}

// By turns, so that each array has to find its own place.
void WriteArrays(const std::string& path, uint64_t zip64_from) {
  const std::vector<NpyArray> arrays = {{"numbers", NpyType::kFloat64, {10'000, 2}},
                                        {"none", NpyType::kFloat32, {0, 3}},
                                        {"bytes", NpyType::kUint8, {10'000}}};
  auto writer = NpzWriter::Create(path, arrays, zip64_from);
  ASSERT_TRUE(writer.ok()) << writer.error().message;
  const std::vector<double> numbers = Counted(20'000);
  for (size_t i = 0; i < 10'000; ++i) {
    ASSERT_TRUE((*writer)->Append(2, static_cast<uint8_t>(i)).ok());
    ASSERT_TRUE((*writer)->Append(0, std::span(numbers).subspan(2 * i, 2)).ok());
  }
  ASSERT_TRUE((*writer)->Finish().ok());
}

TEST_F(NpzWriterTest, ArraysFilledByTurnsComeBack) {
  WriteArrays(Path("a.npz"), NpzWriter::kZip64From);
  EXPECT_EQ(PythonZipTest(Path("a.npz")), "");
  const auto arrays = ReadNpz(Path("a.npz"));
  ASSERT_EQ(arrays.size(), 3u);
  EXPECT_EQ(arrays.at("numbers").Values<double>(), Counted(20'000));
  EXPECT_EQ(arrays.at("none").shape, (Shape{0, 3}));
  EXPECT_EQ(arrays.at("bytes").Values<uint8_t>()[300], 300 % 256);
}

// Python's reader takes the sizes and places from the zip64 fields, as far as there are any.
TEST_F(NpzWriterTest, LargeFilesAreZip64) {
  for (const uint64_t from : {1, 1000, 50'000}) {
    const std::string path = Path(std::to_string(from) + ".npz");
    WriteArrays(path, from);
    EXPECT_EQ(PythonZipTest(path), "") << from;
    const Finished run =
        RunToEnd({"/usr/bin/env", "python3", "-c",
                  "import sys, struct, zipfile\n"
                  "z = zipfile.ZipFile(sys.argv[1])\n"
                  "d = z.read('numbers.npy')\n"
                  "print(z.namelist(), len(z.read('bytes.npy')), struct.unpack('<d', d[-8:])[0])",
                  path});
    EXPECT_EQ(run.out, "['numbers.npy', 'none.npy', 'bytes.npy'] 10128 19999.5\n") << run.err;
  }
}

TEST_F(NpzWriterTest, AnArrayThatIsNotFullIsADefectAndLeavesNoFile) {
  {
    auto writer = NpzWriter::Create(Path("a.npz"), {{"numbers", NpyType::kFloat64, {2}}});
    ASSERT_TRUE(writer.ok());
    EXPECT_FALSE((*writer)->Append(0, 1.0f).ok()) << "another type";
    EXPECT_TRUE((*writer)->Append(0, 1.0).ok());
    EXPECT_FALSE((*writer)->Finish().ok());
    EXPECT_FALSE((*writer)->Append(0, std::span<const double>(Counted(2))).ok()) << "too many";
  }
  EXPECT_FALSE(Exists("a.npz"));
}

}  // namespace
}  // namespace taclink::testing
