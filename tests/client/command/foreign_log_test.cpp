// taclink log, on lawful logs of other writers, which leave out what the specification does not demand.
#include <gmock/gmock.h>

#include <fstream>

#include "tests/client/command/log_content.h"
#include "tests/mcap/log_content.h"

namespace taclink::testing {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class ForeignLogTest : public LogToolTest, public ::testing::WithParamInterface<mcap::testing::ForeignForm> {
 protected:
  ForeignLogTest() {
    WriteLog(own_);
    const mcap::Buffer bytes = mcap::testing::AsOthersWrite(mcap::AsBytes(FileText(own_)), GetParam());
    std::ofstream(foreign_, std::ios::binary) << mcap::AsText(bytes);
  }
  const std::string own_ = Path("own.mcap"), foreign_ = Path("foreign.mcap");
};
INSTANTIATE_TEST_SUITE_P(All, ForeignLogTest, ::testing::ValuesIn(mcap::testing::kForeignForms));

TEST_P(ForeignLogTest, CheckAndInfoCallItGood) {
  const Finished check = Log({"check", foreign_});
  EXPECT_EQ(check.exit_code, 0) << check.out;
  EXPECT_THAT(check.out, HasSubstr("good"));
  const Finished info = Log({"info", foreign_});
  EXPECT_THAT(info.out, AllOf(Not(HasSubstr("damaged")), HasSubstr("/links/upper/frame")));
  EXPECT_THAT(Log({"info", "--json", foreign_}).out, HasSubstr("\"problem\":\"\""));
}

TEST_P(ForeignLogTest, CutAndMergeTakeAllOfIt) {
  for (const std::string tool : {"cut", "merge"}) {
    const std::string out = Path(tool + ".mcap");
    LogDoes({tool, foreign_, "-o", out});
    EXPECT_EQ(MessagesIn(out), MessagesIn(own_)) << tool;
    EXPECT_EQ(AttachmentsIn(out), AttachmentsIn(own_)) << tool;
    EXPECT_EQ(MetadataIn(out), MetadataIn(own_)) << tool;
    EXPECT_TRUE(IsWhole(out)) << tool;
  }
}

TEST_P(ForeignLogTest, ExportAndPlotMakeTheSameOfIt) {
  for (const auto& [log, out] : {std::pair(own_, Path("a")), std::pair(foreign_, Path("b"))}) {
    LogDoes({"export", log, "-o", out, "--format", "csv"});
    LogDoes({"export", log, "-o", out, "--format", "npz"});
    EXPECT_THAT(Log({"export", log, "-o", out, "--format", "jsonl"}).err, Not(HasSubstr("damaged")));
    std::filesystem::copy_file(log, Path("plotted.mcap"), std::filesystem::copy_options::overwrite_existing);
    LogDoes({"plot", Path("plotted.mcap"), "-o", out + "/forces.svg"});
  }
  size_t files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(Path("a"))) {
    ++files;
    const std::string name = entry.path().filename();
    EXPECT_EQ(FileText(Path("a/" + name)), FileText(Path("b/" + name))) << name;
  }
  EXPECT_GT(files, 4u);
}

}  // namespace
}  // namespace taclink::testing
