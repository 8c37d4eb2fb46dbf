#include "server/hub/state_bytes.h"

#include <gtest/gtest.h>

namespace taclink::server {
namespace {

TEST(StateBytes, ReasonsAndOutlinesCount) {
  LinkState state;
  const size_t empty = StateBytes(state);
  state.reasons = {{ReasonId::kLate, std::string(1000, 'x')}};
  const size_t with_reason = StateBytes(state);
  EXPECT_GE(with_reason, empty + 1000);
  state.contacts.resize(1);
  const size_t with_contact = StateBytes(state);
  state.contacts[0].outline_mm.resize(100);
  EXPECT_EQ(StateBytes(state), with_contact + 100 * sizeof(Vec3));
  state.pressure.trouble = std::string(500, 'x');
  EXPECT_GT(StateBytes(state), with_contact + 100 * sizeof(Vec3) + 400);
}

}  // namespace
}  // namespace taclink::server
