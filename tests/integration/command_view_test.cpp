#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/command/frame_json.h"
#include "client/command/json.h"
#include "client/command/watch_view.h"

namespace taclink::command {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

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
    contact.area_m2 = 1e-4;
    frame.contacts = {contact};
    frame.total_force_n = contact.force_n;
  }
  return frame;
}

TEST(Json, EscapesAndSeparates) {
  JsonWriter json;
  json.Begin('{').Field("a\"b", "c\\d\n").Key("list").Begin('[').Value(1.5).Null().Value(7).End(']');
  json.Field("nan", std::numeric_limits<double>::quiet_NaN()).Key("empty").Begin('{').End('}').End('}');
  EXPECT_EQ(json.text(), R"({"a\"b":"c\\d\u000a","list":[1.5,null,7],"nan":null,"empty":{}})");
}

TEST(FrameJson, UsesTheKeysAndUnitsOfSolve) {
  auto frame = MakeFrame(0.2);
  frame.positions_m = {{0.001, 0.002, 0.003}};
  EXPECT_THAT(
      FrameJson(frame),
      HasSubstr(R"("contacts":[{"id":3,"center_mm":[36.5,0,90],"normal":[1,0,0],"force_n":[-0.2,0,0],)"
                R"("force_sigma_n":null,"normal_force_n":0.2,"area_mm2":100}],"total_force_n":[-0.2,0,0],)"
                R"("positions_mm":[[1,2,3]])"));
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
