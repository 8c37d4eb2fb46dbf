#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <vector>

#include "client/command/cli/json.h"
#include "client/command/cli/nearest.h"
#include "client/command/cli/progress.h"
#include "client/command/cli/terminal_style.h"
#include "client/command/live/contacts_view.h"
#include "client/command/live/frame_json.h"
#include "client/command/live/watch_view.h"
#include "tests/integration/messages.h"

namespace taclink::command {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

v1::LinkFrame MakeFrame(double force_n) {
  v1::LinkFrame frame;
  frame.set_link("upper");
  frame.set_sequence(9);
  frame.set_status(v1::LINK_STATUS_OK);
  if (force_n > 0) {
    v1::Contact& contact = *frame.add_contacts();
    contact.set_id(3);
    Set({0.0365, 0, 0.09}, *contact.mutable_center_m());
    Set({-force_n, 0, 0}, *contact.mutable_force_n());
    Set({1, 0, 0}, *contact.mutable_normal());
    contact.set_normal_force_n(force_n);
    for (const double number : {0.0625, 0., 0., 0.25, 0., 4.}) contact.add_force_covariance_n2(number);
    contact.set_area_m2(1e-4);
    *frame.mutable_total_force_n() = contact.force_n();
  }
  return frame;
}

TEST(FrameJson, UsesTheKeysAndUnitsOfSolve) {
  auto frame = MakeFrame(0.25);
  for (const float number : {0.5f, 0.25f, 0.125f}) frame.add_positions_m(number);
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
  v1::LinkFrame frame = MakeFrame(0.25);
  const std::map<std::string, void (v1::LinkFrame::*)(double)> numbers = {
      {"detection_limit_n", &v1::LinkFrame::set_detection_limit_n},
      {"detection_limit_around_n", &v1::LinkFrame::set_detection_limit_around_n},
      {"force_residual", &v1::LinkFrame::set_force_residual},
  };
  double place = 0;
  for (const auto& [name, set_number] : numbers) {
    EXPECT_TRUE(Json::parse(FrameJson(frame)).at(name).is_null()) << name;
    (frame.*set_number)(++place);
    EXPECT_EQ(Json::parse(FrameJson(frame)).at(name), place) << name;
  }
}

TEST(ContactsJson, ASumOverNothingIsNoZero) {
  v1::StreamContactsResponse arm;
  EXPECT_TRUE(Json::parse(ContactsJson(arm)).at("total_force_n").is_null());
  Set({1, 2, 3}, *arm.mutable_total()->mutable_force_n());
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
  lost.set_status(v1::LINK_STATUS_LOST);
  lost.set_status_reason("unplugged");
  EXPECT_THAT(log.Take(lost), ElementsAre("upper is lost: unplugged"));
  EXPECT_THAT(log.Take(lost), IsEmpty());
}

TEST(Nearest, IsTheNameThatWasMeant) {
  const std::vector<std::string> names = {"watch", "list", "record", "contacts", "calibrate"};
  EXPECT_EQ(Nearest("wacth", names), "watch");
  EXPECT_EQ(Nearest("lst", names), "list");
  EXPECT_EQ(Nearest("calibrte", names), "calibrate");
  EXPECT_EQ(Nearest("dance", names), "");
  EXPECT_EQ(Nearest("", names), "");
  EXPECT_EQ(Nearest(std::string(100000, 'a'), names), "");
}

TEST(TerminalStyle, BarsAndSparklinesAreAsLongAsTheyShould) {
  EXPECT_EQ(Bar(0, 4), "    ");
  EXPECT_EQ(Bar(1, 4), "████");
  EXPECT_EQ(Bar(9, 4), "████");
  EXPECT_EQ(Bar(0.5, 3), "█▌ ");
  EXPECT_EQ(Bar(std::nan(""), 2), "  ");
  EXPECT_EQ(Sparkline(std::vector<double>{0, 1, std::nan(""), 2}, 2), " ▄ █");
}

TEST(LiveView, ContactsAreInTheOrderOfTheirForces) {
  LiveView view("title", true);
  for (const double force_n : {0.2, 0.7, 0.4}) {
    v1::LinkFrame frame = MakeFrame(force_n);
    frame.set_link_index(static_cast<uint32_t>(10 * force_n));
    view.Take(frame);
  }
  const auto text = view.Draw({}, std::chrono::steady_clock::now(), {"a note", ""});
  const size_t contacts = text.find("#3");
  EXPECT_LT(text.find("0.70 N (", contacts), text.find("0.40 N (", contacts));
  EXPECT_LT(text.find("0.40 N (", contacts), text.find("0.20 N (", contacts));
  EXPECT_THAT(text, HasSubstr("bars to 1 N"));
  EXPECT_THAT(text, HasSubstr("a note"));
  EXPECT_THAT(text, HasSubstr("\x1b[32m")) << "ok is green";
}

TEST(LiveView, ShowsLinkForceAndDrops) {
  LiveView view("title", false);
  view.Take(MakeFrame(0.2));
  v1::StreamStatus status;
  status.add_links()->set_frames_dropped(4);
  const auto text = view.Draw(status, std::chrono::steady_clock::now());
  EXPECT_THAT(text, HasSubstr("upper"));
  EXPECT_THAT(text, HasSubstr("0.20 N"));
  EXPECT_THAT(text, HasSubstr("dropped for this client: 4"));
}

TEST(ProgressTest, TellsTheTimeThatIsLeft) {
  EXPECT_DOUBLE_EQ(SecondsLeft(0.25, 10), 30);
  EXPECT_EQ(TimeLeftText(0.2), "1 s");
  EXPECT_EQ(TimeLeftText(59), "59 s");
  EXPECT_EQ(TimeLeftText(200), "3 min 20 s");
  EXPECT_EQ(TimeLeftText(7500), "2 h 5 min");
}

}  // namespace
}  // namespace taclink::command
