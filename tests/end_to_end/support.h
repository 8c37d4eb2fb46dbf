#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "sensing/core/geometry.h"
#include "tests/support/paths.h"
#include "tests/support/process.h"
#include "tests/support/temporary_folder.h"

namespace taclink::testing {

using nlohmann::json;

inline Finished Taclink(const std::vector<std::string>& arguments) {
  std::vector<std::string> command = {kTaclink};
  command.insert(command.end(), arguments.begin(), arguments.end());
  return RunToEnd(command);
}

/// Where a server that was just started listens; empty: it does not.
inline std::string AddressOf(Process& server) {
  const std::string mark = "listening on ";
  const auto line = server.ReadUntil(mark, std::chrono::seconds(60), true);
  EXPECT_TRUE(line.has_value()) << "the server does not listen";
  return line ? line->substr(line->find(mark) + mark.size()) : "";
}

/// Of a command that prints one object on each line.
inline std::vector<json> Lines(const std::string& text) {
  std::vector<json> out;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) out.push_back(json::parse(line));
  return out;
}

inline void WaitUntilMeasuring(const std::string& address, const std::string& link) {
  for (int i = 0; i < 100; ++i) {
    const Finished one = Taclink(
        {"watch", "--json", "--links", link, "--count", "3", "--patience", "60", "--server", address});
    ASSERT_EQ(one.exit_code, 0) << one.err;
    if (Lines(one.out).back().at("status") == "ok") return;
  }
  FAIL() << link << " does not measure";
}

/// Records `frames` frames of links that measure, however long they take. The name of the log; empty: failed.
inline std::string RecordFrames(const std::string& address, const std::vector<std::string>& links, int frames,
                                const std::vector<std::string>& options = {}) {
  const auto record = [&](const char* order, const std::vector<std::string>& more = {}) {
    std::vector<std::string> command = {"record", order, "--json", "--server", address};
    command.insert(command.end(), more.begin(), more.end());
    const Finished run = Taclink(command);
    EXPECT_EQ(run.exit_code, 0) << run.err;
    return run.exit_code == 0 ? json::parse(run.out) : json{{"frames", 0}, {"log", ""}};
  };
  for (const std::string& link : links) WaitUntilMeasuring(address, link);
  record("start", options);
  while (!::testing::Test::HasFailure() && record("status").at("frames").get<int>() < frames) {
  }
  return record("stop").at("log").get<std::string>();
}

inline Vec3 ToVec3(const json& list) {
  return {list.at(0).get<double>(), list.at(1).get<double>(), list.at(2).get<double>()};
}

/// A folder of this test's own, gone with it.
class ScratchFolder : public ::testing::Test {
 protected:
  std::string Path(const std::string& name) const { return folder_ / name; }
  /// For this user alone.
  std::string Write(const std::string& name, const std::string& text) const {
    std::ofstream(Path(name)) << text;
    std::filesystem::permissions(Path(name), std::filesystem::perms(0600));
    return Path(name);
  }

 private:
  static std::string NameOfTest() {
    const auto* test = ::testing::UnitTest::GetInstance()->current_test_info();
    std::string name = std::string(test->test_suite_name()) + "." + test->name();
    for (char& c : name) c = c == '/' ? '_' : c;
    return name;
  }

  const TemporaryFolder folder_{NameOfTest()};
};

}  // namespace taclink::testing
