#include "sensing/pipeline/encirclement.h"

#include <gtest/gtest.h>

#include <cmath>

#include "sensing/model/model_file.h"

namespace taclink {
namespace {

class EncirclementTest : public ::testing::Test {
 protected:
  Contact At(double angle_deg, double z_mm, double n) const {
    const double angle = RadFromDeg(angle_deg);
    Contact contact;
    contact.normal = {std::cos(angle), std::sin(angle), 0};
    contact.center_mm = 45 * contact.normal + z_mm * Vec3::UnitZ();
    contact.normal_force_n = n;
    contact.force_n = -n * contact.normal;
    contact.force_covariance_n2 = Mat3(1e-4 * Mat3::Identity());
    return contact;
  }

  const LinkModel model_ = LoadLinkModel("cylinder").value();
};

TEST_F(EncirclementTest, IsOneOfSixDiscsButNotOfTheBodyFarAlongTheLink) {
  std::vector<Contact> contacts = {At(10, 30, 1)};
  for (int i = 0; i < 6; ++i) contacts.push_back(At(60 * i, i % 2 == 0 ? 100 : 110, 0.5));
  const auto found = FindEncirclements(model_, contacts);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].contacts, (std::vector<size_t>{1, 2, 3, 4, 5, 6}));
  EXPECT_DOUBLE_EQ(found[0].normal_force_n, 3);
  contacts.pop_back();
  EXPECT_TRUE(FindEncirclements(model_, contacts).empty()) << "with a gap of 120 degrees";
}

TEST_F(EncirclementTest, ARingContactIsOneByItself) {
  std::vector<Contact> contacts = {At(0, 100, 2), At(40, 100, 1)};
  contacts[0].is_ring_contact = true;
  const auto found = FindEncirclements(model_, contacts);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].contacts, std::vector<size_t>{0});
}

TEST_F(EncirclementTest, VariancesAddUpToTheSums) {
  std::vector<Contact> contacts;
  for (int i = 0; i < 6; ++i) contacts.push_back(At(60 * i, 100, 0.25 + 0.1 * i));
  double sum_n = 0;
  for (const Contact& contact : contacts) sum_n += contact.normal_force_n;
  AddEncirclementVariance(model_, 1.36, contacts);
  double inward = 0, sideways = 0;
  for (const Contact& contact : contacts) {
    inward += contact.normal.dot(*contact.force_covariance_n2 * contact.normal) - 1e-4;
    sideways += (*contact.force_covariance_n2)(2, 2) - 1e-4;
  }
  EXPECT_NEAR(std::sqrt(inward), std::hypot(0.12 * sum_n, 0.1), 1e-3);
  EXPECT_NEAR(sideways, 0, 1e-12);
}

}  // namespace
}  // namespace taclink
