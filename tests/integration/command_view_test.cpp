#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "client/command/cli/json.h"
#include "client/command/live/contacts_view.h"
#include "client/command/live/frame_json.h"
#include "client/command/live/watch_view.h"

namespace taclink::command {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

client::Frame MakeFrame(double force_n) {
  client::Frame frame;
  frame.link = "upper";
  frame.sequence = 9;
  frame.status = client::LinkStatus::kOk;
  if (force_n > 0) {
    client::Contact contact;
    contact.id = 3;
    contact.center_m = {0.0365, 0, 0.09};
    contact.force_n = {-force_n, 0, 0};
    contact.normal = {1, 0, 0};
    contact.normal_force_n = force_n;
    contact.force_covariance_n2 = {0.0625, 0, 0, 0.25, 0, 4};
    contact.area_m2 = 1e-4;
    frame.contacts = {contact};
    frame.total_force_n = contact.force_n;
  }
  return frame;
}

TEST(FrameJson, UsesTheKeysAndUnitsOfSolve) {
  auto frame = MakeFrame(0.25);
  frame.positions_m = {{0.5, 0.25, 0.125}};
  const auto json = Json::parse(FrameJson(frame));
  EXPECT_EQ(json.at("link"), "upper");
  EXPECT_TRUE(json.at("latency_ms").is_null());
  const auto& contact = json.at("contacts").at(0);
  EXPECT_EQ(contact.at("id"), 3);
  EXPECT_NEAR(contact.at("center_mm").at(0).get<double>(), 36.5, 1e-9);
  EXPECT_EQ(contact.at("force_n"), Json::array({-0.25, 0.0, 0.0}));
  EXPECT_EQ(contact.at("force_sigma_n"), Json::array({0.25, 0.5, 2.0}));
  EXPECT_TRUE(contact.at("center_sigma_mm").is_null());
  EXPECT_NEAR(contact.at("area_mm2").get<double>(), 100, 1e-9);
  EXPECT_EQ(json.at("total_force_n").at(0), -0.25);
  EXPECT_EQ(json.at("positions_mm").at(0), Json::array({500.0, 250.0, 125.0}));
  EXPECT_FALSE(json.contains("nodal_forces_n"));
}

TEST(FrameJson, TellsWhatIsKnownOfTheForces) {
  client::Frame frame = MakeFrame(0.25);
  const std::map<std::string, std::optional<double>*> numbers = {
      {"detection_limit_n", &frame.detection_limit_n},
      {"detection_limit_around_n", &frame.detection_limit_around_n},
      {"force_residual", &frame.force_residual},
  };
  double place = 0;
  for (const auto& [name, number] : numbers) {
    EXPECT_TRUE(Json::parse(FrameJson(frame)).at(name).is_null()) << name;
    *number = ++place;
    EXPECT_EQ(Json::parse(FrameJson(frame)).at(name), place) << name;
  }
}

TEST(ContactsJson, ASumOverNothingIsNoZero) {
  client::ArmContacts arm;
  EXPECT_TRUE(Json::parse(ContactsJson(arm)).at("total_force_n").is_null());
  arm.total_force_n = {1, 2, 3};
  EXPECT_EQ(Json::parse(ContactsJson(arm)).at("total_force_n"), Json::array({1.0, 2.0, 3.0}));
}

TEST(ChangeLog, OneLineForEachChange) {
  ChangeLog log;
  EXPECT_THAT(log.Take(MakeFrame(0)), ElementsAre("upper is ok"));
  EXPECT_THAT(log.Take(MakeFrame(0.5)), ElementsAre(HasSubstr("contact 3 begins")));
  EXPECT_THAT(log.Take(MakeFrame(0.55)), IsEmpty());
  EXPECT_THAT(log.Take(MakeFrame(0.7)), ElementsAre(HasSubstr("contact 3 changes")));
  EXPECT_THAT(log.Take(MakeFrame(0)), ElementsAre("upper contact 3 ends"));
  auto lost = MakeFrame(0);
  lost.status = client::LinkStatus::kLost;
  lost.status_reason = "unplugged";
  EXPECT_THAT(log.Take(lost), ElementsAre("upper is lost: unplugged"));
  EXPECT_THAT(log.Take(lost), IsEmpty());
}

TEST(LiveView, ShowsLinkForceAndDrops) {
  LiveView view("title");
  view.Take(MakeFrame(0.2));
  const auto text = view.Draw({{"upper", 5, 4}}, std::chrono::steady_clock::now());
  EXPECT_THAT(text, HasSubstr("upper"));
  EXPECT_THAT(text, HasSubstr("0.20 N"));
  EXPECT_THAT(text, HasSubstr("dropped for this client: 4"));
}

}  // namespace
}  // namespace taclink::command
