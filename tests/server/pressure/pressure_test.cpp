#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <deque>
#include <filesystem>
#include <fstream>

#include "server/pressure/line_reader.h"
#include "server/pressure/pressure_readers.h"
#include "server/pressure/pressure_sensor.h"
#include "tests/server/pressure/pseudo_terminal.h"
#include "tests/server/support.h"
#include "tests/support/times.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;
constexpr milliseconds kMoment{5};

StereoFrame FrameAt(int64_t exposure_ns) {
  StereoFrame frame;
  frame.times.exposure_monotonic_ns = exposure_ns;
  return frame;
}
StereoFrame Applied(PressureSource& source, int64_t exposure_ns) {
  StereoFrame frame = FrameAt(exposure_ns);
  source.Apply(frame);
  return frame;
}

TEST(AssumedPressure, SaysThatItIsAssumed) {
  const auto constant = MakeAssumedPressure(0.003);
  auto frame = Applied(*constant, 5);
  EXPECT_FALSE(frame.pressure_mpa.has_value()) << "not measured";
  EXPECT_EQ(frame.pressure.origin, PressureOrigin::kConstant);
  EXPECT_TRUE(frame.pressure.assumed());
  EXPECT_EQ(frame.pressure.mpa, 0.003);
  EXPECT_FALSE(frame.pressure.stale);
  frame.pressure_mpa = 0.001;  // the simulation knows better
  constant->Apply(frame);
  EXPECT_EQ(frame.pressure.origin, PressureOrigin::kSimulated);
  EXPECT_FALSE(frame.pressure.assumed());
  EXPECT_EQ(frame.pressure_mpa, 0.001);
  EXPECT_EQ(Applied(*MakeAssumedPressure({}), 5).pressure.origin, PressureOrigin::kNone);
  EXPECT_EQ(constant->Tell(0.001, 1).error().code, ErrorCode::kFailedPrecondition);
}

/// Does what the test says.
class ScriptedReader final : public PressureReader {
 public:
  struct Script {
    std::deque<Result<RawReading>> readings;
    bool there = true;
    int opened = 0;
  };
  explicit ScriptedReader(std::shared_ptr<Script> script) : script_(std::move(script)) {}
  Result<void> Open() override {
    ++script_->opened;
    if (script_->there) return {};
    return Error{ErrorCode::kUnavailable, "sensor: unplugged"};
  }
  Result<RawReading> Read(milliseconds) override {
    if (script_->readings.empty()) return Error{ErrorCode::kTimeout, "nothing"};
    const Result<RawReading> reading = script_->readings.front();
    script_->readings.pop_front();
    return reading;
  }

 private:
  const std::shared_ptr<Script> script_;
};

class PressureSensorTest : public ::testing::Test {
 protected:
  PressureSensorTest() { clock_.LetSleepingPassTime(); }
  void Give(const Result<RawReading>& reading) {
    script_->readings.push_back(reading);
    sensor_.Step(kMoment);
  }
  int64_t Now() const { return clock_.MonotonicNs(); }

  ManualClock clock_;
  const std::shared_ptr<ScriptedReader::Script> script_ = std::make_shared<ScriptedReader::Script>();
  PressureSensor sensor_{
      "arm", std::make_unique<ScriptedReader>(script_), {.kpa_per_unit = 0.5, .offset_kpa = -1}, clock_};
};

TEST_F(PressureSensorTest, AFrameHasTheReadingBeforeItsExposure) {
  sensor_.Step(kMoment);
  for (int i = 1; i <= 200; ++i) Give(RawReading{0.1 * i, Now() + i * 10 * kMs});
  const auto frame = Applied(sensor_, Now() + 1805 * kMs);
  EXPECT_NEAR(frame.pressure_mpa.value(), 1e-3 * (0.5 * 18 - 1), 1e-12) << "that of 1800 ms";
  EXPECT_EQ(frame.pressure.age_ns, 5 * kMs);
  EXPECT_EQ(frame.pressure.origin, PressureOrigin::kSerial);
  EXPECT_FALSE(frame.pressure.assumed());
  EXPECT_TRUE(frame.pressure.trouble.empty());
}

TEST_F(PressureSensorTest, ASilentSensorBecomesStaleAndSaysSo) {
  auto frame = Applied(sensor_, Now());
  EXPECT_TRUE(frame.pressure.stale);
  EXPECT_EQ(frame.pressure.age_ns, -1);
  EXPECT_THAT(frame.pressure.trouble, HasSubstr("no reading yet"));
  sensor_.Step(kMoment);
  Give(RawReading{4, Now()});
  EXPECT_FALSE(Applied(sensor_, Now() + 1000 * kMs).pressure.stale);
  frame = Applied(sensor_, Now() + 1500 * kMs);
  EXPECT_TRUE(frame.pressure.stale);
  EXPECT_FALSE(frame.pressure_mpa.has_value());
  EXPECT_NEAR(frame.pressure.mpa, 0.001, 1e-12) << "what it said last";
  EXPECT_THAT(frame.pressure.trouble, HasSubstr("for 1.5 s"));
  Give(RawReading{4, Now() + 2000 * kMs});
  frame = Applied(sensor_, Now() + 2100 * kMs);
  EXPECT_FALSE(frame.pressure.stale);
  EXPECT_TRUE(frame.pressure.trouble.empty());
}

TEST_F(PressureSensorTest, ALostSensorIsTriedAgainWithGrowingPauses) {
  script_->there = false;
  const int64_t start = Now();
  std::vector<int64_t> tries_ms;
  for (int steps = 0, opened = 0; steps < 300 && tries_ms.size() < 8; ++steps) {
    sensor_.Step(milliseconds(100));
    if (script_->opened > opened) tries_ms.push_back((Now() - start) / kMs);
    opened = script_->opened;
  }
  EXPECT_THAT(tries_ms, ::testing::ElementsAre(0, 100, 300, 700, 1500, 3100, 5100, 7100));
  EXPECT_EQ(Applied(sensor_, Now()).pressure.trouble, "sensor: unplugged; trying again");
  script_->there = true;
  for (int steps = 0; steps < 30; ++steps) sensor_.Step(milliseconds(100));
  Give(RawReading{4, Now()});
  EXPECT_FALSE(Applied(sensor_, Now()).pressure.stale);
  Give(Error{ErrorCode::kUnavailable, "sensor: gone"});
  EXPECT_FALSE(Applied(sensor_, Now()).pressure.stale) << "its last reading is still good";
  EXPECT_THAT(Applied(sensor_, Now() + 1100 * kMs).pressure.trouble, HasSubstr("sensor: gone"));
}

TEST_F(PressureSensorTest, NonsenseIsNotTaken) {
  sensor_.Step(kMoment);
  Give(RawReading{1e6, Now()});
  auto frame = Applied(sensor_, Now());
  EXPECT_TRUE(frame.pressure.stale);
  EXPECT_THAT(frame.pressure.trouble, HasSubstr("not within -100 and 100 kPa; check kpa_per_unit"));
  Give(Error{ErrorCode::kInvalidArgument, "sensor: 'abc' is no number"});
  EXPECT_THAT(Applied(sensor_, Now()).pressure.trouble, HasSubstr("'abc' is no number"));
  EXPECT_EQ(script_->opened, 1) << "it is not opened again for that";
}

TEST(ClientPressure, IsWhatClientsTell) {
  ManualClock clock;
  PressureSensor sensor("arm", nullptr, {.origin = PressureOrigin::kClient}, clock);
  sensor.Start();
  EXPECT_THAT(Applied(sensor, 100).pressure.trouble, HasSubstr("UpdatePressure"));
  EXPECT_TRUE(*sensor.Tell(0.002, 50 * kMs));
  EXPECT_FALSE(*sensor.Tell(0.003, 50 * kMs)) << "not newer";
  const auto frame = Applied(sensor, 60 * kMs);
  EXPECT_EQ(frame.pressure_mpa, 0.002);
  EXPECT_EQ(frame.pressure.origin, PressureOrigin::kClient);
  for (const double mpa : {std::nan(""), 5.0, -HUGE_VAL})
    EXPECT_EQ(sensor.Tell(mpa, 70 * kMs).error().code, ErrorCode::kInvalidArgument);
}

TEST(NumberOfLine, IsStrict) {
  EXPECT_EQ(NumberOfLine(" 1.5\r"), 1.5);
  EXPECT_EQ(NumberOfLine("+2e-1"), 0.2);
  EXPECT_EQ(NumberOfLine("-7"), -7);
  for (const char* bad : {"", " ", "1.5 kPa", "1,5", "nan", "inf", "0x10", "--1", "+", "1e999"})
    EXPECT_FALSE(NumberOfLine(bad).has_value()) << bad;
}

/// Reads until there is something else than a timeout.
Result<RawReading> NextOf(PressureReader& reader) {
  const auto until = std::chrono::steady_clock::now() + kForever;
  while (std::chrono::steady_clock::now() < until) {
    auto reading = reader.Read(milliseconds(10));
    if (reading || reading.error().code != ErrorCode::kTimeout) return reading;
  }
  return Error{ErrorCode::kTimeout, "nothing ever came"};
}

class ReaderTest : public ::testing::Test {
 protected:
  ReaderTest() {
    folder_ = std::filesystem::temp_directory_path() /
              ("pressure." + std::to_string(getpid()) + "." +
               ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(folder_);
  }
  ~ReaderTest() override { std::filesystem::remove_all(folder_); }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  void Write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
  }

  std::filesystem::path folder_;
};

TEST_F(ReaderTest, AFilesLastLineIsTheReading) {
  const auto reader = MakeFilePressureReader(Path("kpa"), SystemClock());
  EXPECT_EQ(reader->Open().error().code, ErrorCode::kUnavailable);
  Write("kpa", "0.5\n1.25\n\n");
  ASSERT_TRUE(reader->Open().ok());
  const auto reading = NextOf(*reader);
  ASSERT_TRUE(reading.ok()) << reading.error().message;
  EXPECT_EQ(reading->value, 1.25);
  EXPECT_LE(reading->time_ns, SystemClock().MonotonicNs());
  EXPECT_EQ(reader->Read(milliseconds(1)).error().code, ErrorCode::kTimeout) << "not changed since";

  // Its time is that of the change: an old file is an old reading.
  Write("kpa", std::string(5000, '7') + "\n2.5");
  const auto hour_ago = std::filesystem::file_time_type::clock::now() - std::chrono::hours(1);
  std::filesystem::last_write_time(Path("kpa"), hour_ago);
  const auto old = NextOf(*reader);
  ASSERT_TRUE(old.ok()) << old.error().message;
  EXPECT_EQ(old->value, 2.5);
  EXPECT_LT(old->time_ns, SystemClock().MonotonicNs() - int64_t{3599} * 1'000'000'000);

  Write("kpa", "many\n");
  EXPECT_THAT(NextOf(*reader).error().message, HasSubstr("'many' is no number"));
  std::filesystem::remove(Path("kpa"));
  EXPECT_EQ(NextOf(*reader).error().code, ErrorCode::kUnavailable);
}

TEST_F(ReaderTest, APipeGivesANumberALine) {
  ASSERT_EQ(mkfifo(Path("pipe").c_str(), 0600), 0);
  const auto reader = MakeFilePressureReader(Path("pipe"), SystemClock());
  ASSERT_TRUE(reader->Open().ok());
  EXPECT_EQ(reader->Read(milliseconds(1)).error().code, ErrorCode::kTimeout) << "no writer yet";
  for (int writer = 0; writer < 2; ++writer) {  // the first goes, a second comes
    std::ofstream out(Path("pipe"));
    out << "0\n" << 3 + writer << "\n" << std::flush;
    const auto reading = NextOf(*reader);
    ASSERT_TRUE(reading.ok()) << reading.error().message;
    EXPECT_EQ(reading->value, 3 + writer);
  }
  EXPECT_FALSE(MakeFilePressureReader("/dev/null", SystemClock())->Open().ok());
}

TEST_F(ReaderTest, ASerialLineIsReadLineByLine) {
  PseudoTerminal line;
  const auto reader = MakeSerialPressureReader(line.device(), 115200, SystemClock());
  ASSERT_TRUE(reader->Open().ok());
  EXPECT_EQ(reader->Read(milliseconds(1)).error().code, ErrorCode::kTimeout);
  line.Send("34\n");  // may be the end of 1234
  EXPECT_EQ(reader->Read(milliseconds(100)).error().code, ErrorCode::kTimeout);
  line.Send("12.5\r\n13.5\r\n14");
  EXPECT_EQ(NextOf(*reader)->value, 13.5) << "the newest whole one";
  line.Send(".75\r\n");
  EXPECT_EQ(NextOf(*reader)->value, 14.75);
  line.Send("\x01\xff what?\n");
  EXPECT_THAT(NextOf(*reader).error().message, HasSubstr("'?? what?' is no number"));
  line.Send(std::string(1000, '9') + "\n");
  EXPECT_EQ(NextOf(*reader).error().code, ErrorCode::kInvalidArgument);
  line.Send("1\n");
  EXPECT_EQ(NextOf(*reader)->value, 1);
  line.Close();
  const auto gone = NextOf(*reader);
  EXPECT_EQ(gone.error().code, ErrorCode::kUnavailable) << gone.error().message;
  EXPECT_EQ(reader->Open().error().code, ErrorCode::kUnavailable);
}

// The whole way with its own thread: a sensor that comes, goes, and comes back elsewhere under the same name.
TEST_F(ReaderTest, ASensorThatReturnsIsTakenBack) {
  PressureSensor sensor("arm", MakeSerialPressureReader(Path("sensor"), 9600, SystemClock()),
                        {.first_backoff = milliseconds(5), .longest_backoff = milliseconds(20)},
                        SystemClock());
  sensor.Start();
  for (const double kpa : {2.0, 3.0}) {
    PseudoTerminal line;
    std::filesystem::create_symlink(line.device(), Path("sensor"));
    const auto until = std::chrono::steady_clock::now() + kForever;
    double mpa = 0;
    while (mpa != 1e-3 * kpa && std::chrono::steady_clock::now() < until) {
      line.Send(std::to_string(kpa) + "\n");
      mpa = Applied(sensor, SystemClock().MonotonicNs()).pressure_mpa.value_or(0);
      SystemClock().SleepUntilMonotonicNs(SystemClock().MonotonicNs() + kMs);
    }
    EXPECT_EQ(mpa, 1e-3 * kpa);
    std::filesystem::remove(Path("sensor"));
  }
  sensor.Stop();
}

}  // namespace
}  // namespace taclink::server
