#include "sensing/contact/contact_finder.h"

#include <gtest/gtest.h>

#include "sensing/force/force_estimator.h"
#include "sensing/model/model_file.h"
#include "tests/sensing/force/support.h"

namespace taclink {
namespace {

class ContactFinderTest : public testing::Test {
 protected:
  std::vector<Contact> Contacts(const std::vector<TrueLoad>& loads, unsigned seed = 1) {
    const SkinShape shape = ShapeUnder(model_, loads, 0, 2, 0.05, seed);
    NodalForces forces;
    estimator_->Estimate(shape, 0, forces);
    std::vector<Contact> contacts;
    finder_.Find(shape, forces, contacts);
    return contacts;
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
  std::unique_ptr<ForceEstimator> estimator_ = MakeForceEstimator(model_, {});
  ContactFinder finder_{model_};
};

TEST_F(ContactFinderTest, CentreLiesOnTheDeformedOuterSkin) {
  const auto contacts = Contacts({{6, 4, 0.2}});
  ASSERT_EQ(contacts.size(), 1u);
  const double dent = 0.2 / 0.0259;  // radial stiffness of the node, see linear_shell_test
  EXPECT_NEAR(contacts[0].center_mm.y(), 40 - dent, 1);
  EXPECT_NEAR(contacts[0].center_mm.x(), 0, 1);
  EXPECT_NEAR(contacts[0].center_mm.z(), 90, 1);
  EXPECT_NEAR(contacts[0].force_n.y(), -0.2, 0.02);
  EXPECT_NEAR(contacts[0].normal_force_n, 0.2, 0.02);
  ASSERT_TRUE(contacts[0].force_covariance_n2.has_value());
  EXPECT_LT(Sigmas(*contacts[0].force_covariance_n2).norm(), 0.05);
}

TEST_F(ContactFinderTest, RegionOverTheFirstPathIsOneContact) {
  const auto contacts = Contacts({{0, 4, 0.1}, {23, 4, 0.1}});
  ASSERT_EQ(contacts.size(), 1u);
  EXPECT_NEAR(std::atan2(contacts[0].center_mm.y(), contacts[0].center_mm.x()),
              -model_.markers.path_pitch_rad() / 2, 0.05);
}

TEST_F(ContactFinderTest, IdsLastWhileTheContactDoes) {
  const auto first = Contacts({{6, 4, 0.2}}, 1);
  const auto both = Contacts({{6, 4, 0.15}, {18, 7, 0.3}}, 2);
  const auto moved = Contacts({{7, 4, 0.2}, {18, 7, 0.3}}, 3);
  const auto gone = Contacts({}, 4);
  const auto again = Contacts({{6, 4, 0.2}}, 5);
  ASSERT_EQ(first.size(), 1u);
  ASSERT_EQ(both.size(), 2u);
  ASSERT_EQ(moved.size(), 2u);
  EXPECT_TRUE(gone.empty());
  ASSERT_EQ(again.size(), 1u);
  EXPECT_EQ(both[1].id, first[0].id);  // sorted by force: the new one is stronger
  EXPECT_NE(both[0].id, first[0].id);
  EXPECT_EQ(moved[1].id, first[0].id);
  EXPECT_EQ(moved[0].id, both[0].id);
  EXPECT_NE(again[0].id, first[0].id);
}

}  // namespace
}  // namespace taclink
