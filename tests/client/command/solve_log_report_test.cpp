#include "client/command/logs/solve_log_report.h"

#include <gtest/gtest.h>

namespace taclink::command {
namespace {

v1::StatusReason ReasonOf(v1::Reason id, const std::string& text) {
  v1::StatusReason reason;
  reason.set_reason(id);
  reason.set_text(text);
  return reason;
}

class SolveLogReportTest : public ::testing::Test {
 protected:
  SolveLogReportTest() {
    solved_.set_sequence(7);
    solved_.set_status(v1::LINK_STATUS_OK);
    solved_.mutable_stage_times();
    recorded_ = solved_;
  }
  uint64_t Identical() {
    LinkReport report;
    Compare(recorded_, recorded_.SerializeAsString(), 0, solved_, report);
    EXPECT_EQ(report.solved, 1u);
    return report.identical;
  }
  v1::LinkFrame recorded_, solved_;
};

TEST_F(SolveLogReportTest, LatenessIsNoPartOfTheSolution) {
  recorded_.set_status(v1::LINK_STATUS_DEGRADED);
  recorded_.set_status_reason("0.31 s old");
  *recorded_.add_status_reasons() = ReasonOf(v1::REASON_LATE_FRAME, "0.31 s old");
  EXPECT_EQ(Identical(), 1u);
  solved_.set_sequence(8);
  EXPECT_EQ(Identical(), 0u);
}

TEST_F(SolveLogReportTest, OtherReasonsAre) {
  for (v1::LinkFrame* frame : {&recorded_, &solved_}) {
    frame->set_status(v1::LINK_STATUS_DEGRADED);
    frame->set_status_reason("contrast");
    *frame->add_status_reasons() = ReasonOf(v1::REASON_IMAGE_CONTRAST, "contrast");
  }
  *recorded_.add_status_reasons() = ReasonOf(v1::REASON_LATE_FRAME, "0.31 s old");
  EXPECT_EQ(Identical(), 1u);
  solved_.clear_status_reasons();
  EXPECT_EQ(Identical(), 0u);
}

}  // namespace
}  // namespace taclink::command
