// The client library as it is installed: found by CMake and pkg-config, used by the example project.
#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <regex>

#include "tests/end_to_end/support.h"
#include "tests/support/paths.h"

namespace taclink::testing {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;
using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr seconds kLong{300};

Finished Shell(const std::string& command) {
  return RunToEnd({"/bin/sh", "-c", command}, kLong);
}

class ClientPackageTest : public ScratchFolder {
 protected:
  void SetUp() override {
    for (const char* component : {"library", "development"}) {
      const Finished installed =
          RunToEnd({CMAKE, "--install", TACLINK_BUILD, "--prefix", prefix_, "--component", component}, kLong);
      ASSERT_EQ(installed.exit_code, 0) << installed.err;
    }
  }
  std::string Find(const std::string& name) const {
    for (const auto& entry : fs::recursive_directory_iterator(prefix_)) {
      if (entry.path().filename() == name) return entry.path().string();
    }
    ADD_FAILURE() << name << " is not installed";
    return "";
  }
  /// Prints links and forces of a simulated arm.
  void ExpectWorks(const std::string& program) {
    Process server({kTaclinkd, "--listen", "127.0.0.1:0", "--http-listen", ""});
    const std::string address = AddressOf(server);
    Process monitor({program, address, "300"});
    const auto first = monitor.ReadLine(kLong);
    ASSERT_TRUE(first.has_value());
    EXPECT_THAT(*first, HasSubstr("server 0."));
    const auto contact = monitor.ReadUntil("#", kLong);
    ASSERT_TRUE(contact.has_value());
    EXPECT_TRUE(std::regex_search(
        *contact, std::regex(R"(force [+-]\d+\.\d\d [+-]\d+\.\d\d [+-]\d+\.\d\d N at .* mm, \d+\.\d ms)")))
        << *contact;
    server.Signal(SIGKILL);
    EXPECT_TRUE(monitor.ReadUntil("attempt 1 in ", kLong, true).has_value());
  }

  const std::string prefix_ = Path("prefix");
};

TEST_F(ClientPackageTest, IsFoundByCMake) {
  const std::string build = Path("build");
  const Finished built =
      Shell(std::string(CMAKE) + " -G Ninja -S '" TACLINK_SOURCE "/client/cpp/example' -B '" + build +
            "' -DCMAKE_PREFIX_PATH='" + prefix_ + "' -DCMAKE_CXX_COMPILER=" CXX + " && " CMAKE " --build '" +
            build + "'");
  ASSERT_EQ(built.exit_code, 0) << built.out << built.err;
  ExpectWorks(build + "/touch_monitor");
}

TEST_F(ClientPackageTest, IsFoundByPkgConfig) {
  const std::string program = Path("touch_monitor");
  const std::string pc = fs::path(Find("taclink-client.pc")).parent_path().string();
  const std::string library = fs::path(Find("libtaclink-client.so")).parent_path().string();
  const Finished built =
      Shell("PKG_CONFIG_PATH='" + pc +
            "' && export PKG_CONFIG_PATH && " CXX " -std=c++20 -Wall -Wextra -Werror '" TACLINK_SOURCE
            "/client/cpp/example/touch_monitor.cpp' -o '" +
            program + "' $(pkg-config --cflags --libs taclink-client) -Wl,-rpath,'" + library + "'");
  ASSERT_EQ(built.exit_code, 0) << built.out << built.err;
  ExpectWorks(program);
}

TEST_F(ClientPackageTest, KeepsWhatItIsMadeOfToItself) {
  for (const auto& entry : fs::recursive_directory_iterator(prefix_)) {
    if (entry.path().extension() != ".h") continue;
    std::ifstream in(entry.path());
    const std::string text{std::istreambuf_iterator<char>(in), {}};
    for (const char* inside : {"grpc", "\"sensing/", "\"client/"})
      EXPECT_THAT(text, Not(HasSubstr(std::string("#include ") + (inside[0] == '"' ? "" : "<") + inside)))
          << entry.path();
  }
  EXPECT_TRUE(fs::exists(fs::path(Find("frame.pb.h")).parent_path().parent_path() / "client.h"))
      << "beside the headers that include it";
  const Finished symbols =
      Shell("nm -D --defined-only -C '" + Find("libtaclink-client.so") + "' | cut -d' ' -f3-");
  ASSERT_EQ(symbols.exit_code, 0) << symbols.err;
  std::istringstream lines(symbols.out);
  int count = 0;
  for (std::string line; std::getline(lines, line); ++count)
    EXPECT_THAT(line, AllOf(AnyOf(HasSubstr("taclink::client::"), HasSubstr("taclink::v1::")),
                            Not(HasSubstr("Service::"))))
        << "is visible";
  EXPECT_GT(count, 50);
}

}  // namespace
}  // namespace taclink::testing
