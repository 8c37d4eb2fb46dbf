// The format's own library reads what is written here, and the other way round.
#include "tests/mcap/judge.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/mcap/log_content.h"

namespace taclink::mcap {
namespace {

using nlohmann::json;
using testing::DigestOf;
using testing::RandomLog;
using testing::RandomLogBytes;
using testing::Text;

class McapJudge : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directory(folder_); }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  void Put(const std::string& name, Bytes bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << AsText(bytes);
  }
  Buffer Get(const std::string& name) {
    std::ifstream file(folder_ / name, std::ios::binary);
    const std::string text{std::istreambuf_iterator<char>(file), {}};
    const Bytes bytes = AsBytes(text);
    return {bytes.begin(), bytes.end()};
  }
  json Judge(const std::string& mode) { return testing::RunJudge(mode, folder_); }

  const std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("mcap_judge_" + std::to_string(getpid()));
};

TEST_F(McapJudge, ReadsWhatIsWrittenHere) {
  std::map<std::string, Buffer> logs;
  for (uint32_t seed = 1; seed <= 30; ++seed) {
    const auto compression = static_cast<Compression>(seed % 3);
    logs["log" + std::to_string(seed) + ".mcap"] =
        RandomLogBytes({.seed = seed,
                        .messages = seed * 11 % 400,
                        .options = {.profile = "p", .compression = compression, .chunk_bytes = 700 * seed}});
  }
  logs["small.mcap"] = testing::SmallLog();
  for (const auto& [name, bytes] : logs) Put(name, bytes);
  const json read = Judge("read");
  for (const auto& [name, bytes] : logs) {
    EXPECT_EQ(read[name]["streamed"], DigestOf(bytes, MessageOrder::kFile)) << name;
    EXPECT_EQ(read[name]["indexed"], DigestOf(bytes, MessageOrder::kLogTime)) << name;
  }
}

TEST_F(McapJudge, WritesWhatIsReadHere) {
  const json written = Judge("write");
  ASSERT_GE(written.size(), 24U);
  for (const auto& [name, digest] : written.items()) {
    const Buffer bytes = Get(name);
    EXPECT_EQ(DigestOf(bytes, MessageOrder::kFile), digest) << name;
    const auto report = Check(MemorySource(bytes));
    // Without chunks that library writes the wrong places of attachments and metadata into their indexes, and
    // without repeated channels chunk indexes and statistics whose channels are not in the summary.
    const bool right = !name.starts_with("loose") && !name.starts_with("channels");
    EXPECT_EQ(report->ok(), right) << name << "\n" << testing::FindingsOf(*report);
  }
}

/// A log and what was done to it.
struct Damaged {
  Buffer bytes = {};
  size_t original = 0;
  size_t first = 0;  ///< the first byte that differs
};

/// The type of the record that byte `at` of an intact log belongs to.
std::string RecordAt(Bytes bytes, size_t at) {
  if (at < kMagic.size()) return "magic";
  Bytes rest = bytes.subspan(kMagic.size());
  bool in_summary = false;
  while (rest.size() > kMagic.size()) {
    const auto record = TakeRecord(rest);
    if (!record) break;
    if (bytes.size() - rest.size() > at) return (in_summary ? "summary " : "") + NameOf(record->opcode);
    in_summary = in_summary || record->opcode == Opcode::kDataEnd;
  }
  return "end";
}

/// Anywhere, or near the start of a record, where little is covered by a chunk's CRC.
size_t PlaceOfDamage(Bytes bytes, std::mt19937& random) {
  constexpr size_t kNear = 60;
  if (random() % 2 == 0) return random() % bytes.size();
  std::vector<size_t> starts = {0};
  Bytes rest = bytes.subspan(kMagic.size());
  while (rest.size() > kMagic.size()) {
    starts.push_back(bytes.size() - rest.size());
    if (!TakeRecord(rest)) break;
  }
  return std::min(starts[random() % starts.size()] + random() % kNear, bytes.size() - 1);
}

Damaged Damage(const std::vector<Buffer>& originals, std::mt19937& random) {
  Damaged log{.original = random() % originals.size()};
  log.bytes = originals[log.original];
  const size_t at = PlaceOfDamage(log.bytes, random);
  const size_t size = std::min<size_t>(1 + random() % 500, log.bytes.size() - at);
  const auto place = log.bytes.begin() + static_cast<ptrdiff_t>(at);
  const auto end = place + static_cast<ptrdiff_t>(size);
  switch (random() % 8) {
    case 0:
      log.bytes.resize(at);
      break;
    default:
      *place ^= std::byte{1} << (random() % 8);
      break;
    case 2:
      std::fill(place, end, std::byte{0});
      break;
    case 3:
      log.bytes.erase(place, end);
      break;
    case 1: {
      const Buffer& other = originals[random() % originals.size()];
      const size_t from = random() % other.size();
      log.bytes.insert(place, other.begin() + static_cast<ptrdiff_t>(from), other.end());
    }
  }
  const Buffer& original = originals[log.original];
  const size_t common = std::min(original.size(), log.bytes.size());
  while (log.first < common && original[log.first] == log.bytes[log.first]) ++log.first;
  return log;
}

TEST_F(McapJudge, AgreesOnWhatIsDamaged) {
  constexpr int kLogs = 1000;
  std::vector<Buffer> originals;
  for (uint32_t seed = 1; seed <= 9; ++seed) {
    originals.push_back(RandomLogBytes(
        {.seed = seed,
         .messages = 60,
         .options = {.compression = static_cast<Compression>(seed % 3), .chunk_bytes = 3000}}));
  }
  std::mt19937 random(2024);
  std::vector<Damaged> logs;
  for (int i = 0; i < kLogs; ++i) {
    logs.push_back(Damage(originals, random));
    Put("d" + std::to_string(i) + ".mcap", logs.back().bytes);
  }
  for (size_t i = 0; i < originals.size(); ++i) Put("o" + std::to_string(i) + ".mcap", originals[i]);
  const json read = Judge("read");

  for (size_t i = 0; i < originals.size(); ++i) {
    const json& told = read["o" + std::to_string(i) + ".mcap"];
    ASSERT_EQ(told["streamed"], DigestOf(originals[i], MessageOrder::kFile))
        << "the judge itself is in trouble";
    ASSERT_EQ(told["indexed"], DigestOf(originals[i], MessageOrder::kLogTime))
        << "the judge itself is in trouble";
  }

  int both = 0;
  int neither = 0;
  std::map<std::string, int> only_here;
  for (int i = 0; i < kLogs; ++i) {
    const Damaged& log = logs[static_cast<size_t>(i)];
    const json& told = read["d" + std::to_string(i) + ".mcap"];
    const bool judged = told != read["o" + std::to_string(log.original) + ".mcap"];
    const bool found = !Check(MemorySource(log.bytes))->ok();
    EXPECT_TRUE(found || !judged) << "log " << i
                                  << " is damaged, but Check does not say so: " << told.dump(1);
    EXPECT_TRUE(found || DigestOf(log.bytes, MessageOrder::kFile) == told["streamed"]) << "log " << i;
    both += found && judged ? 1 : 0;
    neither += found || judged ? 0 : 1;
    if (found && !judged) ++only_here[RecordAt(originals[log.original], log.first)];
  }
  // What its readers never look at: CRC of the data section, message indexes of the streamed, and the like.
  std::string classes;
  for (const auto& [record, count] : only_here) classes += " " + record + " " + std::to_string(count) + ";";
  std::printf("damaged for both %d, for neither %d, only here by the first damaged record:%s\n", both,
              neither, classes.c_str());
  EXPECT_GT(both, kLogs / 2);
}

}  // namespace
}  // namespace taclink::mcap
