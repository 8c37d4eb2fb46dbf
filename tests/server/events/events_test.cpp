// What the events engine makes of link states: synthetic ones, with times as the test says.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "server/config/config.h"
#include "server/events/event_engine.h"
#include "tests/server/support.h"
#include "tests/support/times.h"

namespace taclink::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

MarkerGrid Grid() {
  MarkerGrid grid;
  grid.paths = 4;
  grid.rings_z_mm = {10, 20, 30};
  return grid;
}

Contact MakeContact(uint64_t id, double force_n, double z_mm = 20, std::vector<int> markers = {5}) {
  Contact contact;
  contact.id = id;
  contact.center_mm = Vec3(30, 0, z_mm);
  contact.force_n = Vec3(-force_n, 0, 0);
  contact.normal_force_n = force_n;
  contact.markers = std::move(markers);
  return contact;
}

/// Feeds one link's watch, a frame each 10 ms.
class LinkWatchTest : public ::testing::Test {
 protected:
  LinkWatchTest() { state_.status = LinkStatus::kOk; }

  std::vector<Event> Frame(std::vector<Contact> contacts, bool measured = true) {
    state_.times.published_ns += 10 * kMs;
    ++state_.sequence;
    state_.contacts = std::move(contacts);
    state_.shape.positions_mm.assign(measured ? 12 : 0, Vec3::Zero());
    state_.forces.forces_n.assign(12, Vec3::Zero());
    for (const Contact& contact : state_.contacts) {
      for (const int marker : contact.markers)
        state_.forces.forces_n[static_cast<size_t>(marker)] +=
            contact.force_n / static_cast<double>(contact.markers.size());
    }
    std::vector<Event> events;
    watch_->Take(state_, events);
    std::vector<Event> wanted;
    for (Event& event : events) {
      if (event.kind != EventKind::kLinkStatus || tell_status_) wanted.push_back(std::move(event));
    }
    return wanted;
  }
  static std::vector<std::string> Kinds(const std::vector<Event>& events) {
    std::vector<std::string> kinds;
    for (const Event& event : events) kinds.emplace_back(Name(event.kind));
    return kinds;
  }
  static const ContactDetail& ContactOf(const Event& event) { return std::get<ContactDetail>(event.detail); }
  static const ForceLevelDetail& LevelOf(const Event& event) {
    return std::get<ForceLevelDetail>(event.detail);
  }

  static LinkRules Rules() {
    return {.thresholds = {.warning_n = 0.5, .alarm_n = 1, .hysteresis_n = 0.1},
            .regions = {{.name = "palm",
                         .first_ring = 0,
                         .last_ring = 1,
                         .first_path = 3,
                         .last_path = 0,
                         .thresholds = {.warning_n = 0.2, .alarm_n = 0, .hysteresis_n = 0.05}}}};
  }

  LinkState state_;
  bool tell_status_ = false;
  static EventOptions Options() {
    EventOptions options;
    options.release_s = 0.1;
    options.update_rate_hz = 10;
    return options;
  }
  EventOptions options_ = Options();
  std::optional<LinkWatch> watch_{std::in_place, 3, Rules(), Grid(), options_};
};

TEST_F(LinkWatchTest, AContactBeginsIsUpdatedAndEnds) {
  EXPECT_TRUE(Frame({MakeContact(7, 0.04)}).empty()) << "too weak to begin";
  const auto begin = Frame({MakeContact(7, 0.1)});
  ASSERT_THAT(Kinds(begin), ElementsAre("contact_begin"));
  EXPECT_EQ(begin[0].link, 3u);
  EXPECT_EQ(begin[0].frame_sequence, 2u);
  EXPECT_EQ(begin[0].published_ns, 20 * kMs);
  EXPECT_EQ(ContactOf(begin[0]).id, 7u);
  EXPECT_DOUBLE_EQ(ContactOf(begin[0]).normal_force_n, 0.1);
  int updates = 0;
  double force_n = 0.1;
  for (int i = 0; i < 50; ++i) {
    const auto events = Frame({MakeContact(7, force_n += 0.004)});
    for (const Event& event : events) updates += event.kind == EventKind::kContactUpdate ? 1 : 0;
  }
  EXPECT_EQ(updates, 5) << "10 a second for 0.5 s";
  for (int i = 0; i < 50; ++i) EXPECT_TRUE(Frame({MakeContact(7, force_n)}).empty() || i < 11) << "no news";
  for (int i = 0; i < 9; ++i) EXPECT_TRUE(Frame({}).empty()) << "may come back";
  const auto end = Frame({});
  ASSERT_THAT(Kinds(end), ElementsAre("contact_end"));
  EXPECT_EQ(ContactOf(end[0]).id, 7u);
  EXPECT_EQ(ContactOf(end[0]).end_reason, "released");
  EXPECT_NEAR(ContactOf(end[0]).peak_n, 0.3, 1e-9);
  EXPECT_NEAR(ContactOf(end[0]).duration_s, 1.0, 1e-9);
  EXPECT_TRUE(Frame({}).empty());
}

TEST_F(LinkWatchTest, AWeakeningContactEndsBelowTheLowerForceOnly) {
  Frame({MakeContact(1, 0.1)});
  for (int i = 0; i < 60; ++i) {
    for (const Event& event : Frame({MakeContact(1, 0.035)}))
      EXPECT_EQ(event.kind, EventKind::kContactUpdate);
  }
  std::vector<std::string> kinds;
  for (int i = 0; i < 30; ++i) {
    for (const auto& kind : Kinds(Frame({MakeContact(1, 0.02)}))) kinds.push_back(kind);
  }
  EXPECT_EQ(std::count(kinds.begin(), kinds.end(), "contact_end"), 1);
}

TEST_F(LinkWatchTest, IdsLastWhereTheFinderLosesThem) {
  ASSERT_EQ(Frame({MakeContact(1, 0.2, 20), MakeContact(2, 0.2, 120)}).size(), 2u);
  Frame({MakeContact(2, 0.2, 120)});                           // 1 is gone for a moment
  Frame({MakeContact(9, 0.2, 24), MakeContact(2, 0.2, 120)});  // and comes back under another id
  for (int i = 0; i < 30; ++i) {
    for (const Event& event : Frame({MakeContact(9, 0.3, 24), MakeContact(2, 0.2, 120)})) {
      EXPECT_EQ(event.kind, EventKind::kContactUpdate);
      EXPECT_EQ(ContactOf(event).id, 1u);
    }
  }
  const auto far = Frame({MakeContact(9, 0.3, 24), MakeContact(2, 0.2, 120), MakeContact(10, 0.2, 200)});
  ASSERT_THAT(Kinds(far), ElementsAre("contact_begin"));
  EXPECT_EQ(ContactOf(far[0]).id, 10u);
}

// On a skin of a fifth of the size the same distance is far.
TEST_F(LinkWatchTest, TheSamePlaceScalesWithTheSkin) {
  const auto events_of_moving_by = [&](double mm, double length_unit) {
    watch_.emplace(3, Rules(), Grid(), options_, length_unit);
    Frame({MakeContact(1, 0.2, 20)});
    return Kinds(Frame({MakeContact(9, 0.2, 20 + mm)}));
  };
  EXPECT_THAT(events_of_moving_by(10, 1), IsEmpty());
  EXPECT_THAT(events_of_moving_by(10, 0.2), ElementsAre("contact_begin"));
  EXPECT_THAT(events_of_moving_by(5, 0.2), IsEmpty());
}

// Nobody has seen that what pressed has gone.
TEST_F(LinkWatchTest, WhereNothingIsMeasuredNoContactEnds) {
  Frame({MakeContact(1, 0.2)});
  for (int i = 0; i < 50; ++i) EXPECT_TRUE(Frame({}, false).empty());
  const auto end = Frame({});
  ASSERT_THAT(Kinds(end), ElementsAre("contact_end"));
  EXPECT_EQ(ContactOf(end[0]).end_reason, "released");
  EXPECT_EQ(end[0].frame_status, LinkStatus::kOk);
  EXPECT_TRUE(end[0].frame_reasons.empty());
}

// A skin that is pressed too hard for an answer has not been let go.
TEST_F(LinkWatchTest, ForcesThatAreNotKnownAreNoRelease) {
  Frame({MakeContact(1, 1.2)});
  ASSERT_EQ(watch_->forces()[0].level(), ForceLevel::kAlarm);
  state_.status = LinkStatus::kDegraded;
  state_.forces.converged = false;
  for (int i = 0; i < 50; ++i) EXPECT_TRUE(Frame({}).empty());
  EXPECT_EQ(watch_->forces()[0].level(), ForceLevel::kAlarm);
}

// A torn image, say.
TEST_F(LinkWatchTest, ContactsOfADoubtfulFrameNeitherBeginNorEnd) {
  Frame({MakeContact(1, 0.2)});
  state_.status = LinkStatus::kDegraded;
  state_.reasons = {{ReasonId::kResidual, "off the estimated shape"}};
  bool is_updated = false;
  for (int i = 0; i < 50; ++i) {
    for (const Event& event : Frame({MakeContact(1, 0.2 + 0.01 * i), MakeContact(2, 0.3, 120)})) {
      if (event.kind == EventKind::kForceLevel) continue;
      EXPECT_EQ(event.kind, EventKind::kContactUpdate);
      EXPECT_EQ(event.frame_status, LinkStatus::kDegraded);
      EXPECT_THAT(event.frame_reasons, ElementsAre(ReasonId::kResidual));
      is_updated = true;
    }
  }
  EXPECT_TRUE(is_updated);
  for (int i = 0; i < 50; ++i) {
    for (const Event& event : Frame({MakeContact(2, 0.3, 120)}))
      EXPECT_EQ(event.kind, EventKind::kForceLevel) << "1 may be there, and 2 not";
  }
  state_.status = LinkStatus::kOk;
  state_.reasons.clear();
  EXPECT_THAT(Kinds(Frame({MakeContact(2, 0.3, 120)})), ElementsAre("contact_end", "contact_begin"));
}

// Its contacts are numbered from 1 again.
TEST_F(LinkWatchTest, ContactsOfALinkThatBeganAgainAreOthers) {
  Frame({MakeContact(1, 0.2, 20)});
  for (int i = 0; i < 50; ++i) Frame({}, false);
  const auto events = Frame({MakeContact(1, 0.3, 120)});
  ASSERT_THAT(Kinds(events), ElementsAre("contact_end", "contact_begin"));
  EXPECT_DOUBLE_EQ(ContactOf(events[0]).center_mm.z(), 20);
  EXPECT_DOUBLE_EQ(ContactOf(events[1]).center_mm.z(), 120);
  for (int i = 0; i < 50; ++i) Frame({}, false);
  EXPECT_TRUE(Frame({MakeContact(7, 0.3, 120.5)}).empty()) << "it is where it was";
}

// A link without a pressure sensor is never ok, and yet touched.
TEST_F(LinkWatchTest, ContactsOfWhichOnlyTheForceIsInDoubtBeginAndEnd) {
  state_.status = LinkStatus::kDegraded;
  state_.reasons = {{ReasonId::kPressureUnknown, "nobody measures the pressure"}};
  const auto begin = Frame({MakeContact(1, 0.2)});
  ASSERT_THAT(Kinds(begin), ElementsAre("contact_begin"));
  EXPECT_EQ(begin[0].frame_status, LinkStatus::kDegraded);
  EXPECT_THAT(begin[0].frame_reasons, ElementsAre(ReasonId::kPressureUnknown));
}

TEST_F(LinkWatchTest, LevelsHaveHysteresis) {
  const auto levels = [&](double force_n) {
    std::vector<ForceLevel> found;
    for (const Event& event : Frame({MakeContact(1, force_n, 20, {6})})) {
      if (event.kind == EventKind::kForceLevel) found.push_back(LevelOf(event).level);
    }
    return found;
  };
  EXPECT_TRUE(levels(0.49).empty());
  EXPECT_THAT(levels(0.5), ElementsAre(ForceLevel::kWarning));
  for (const double force_n : {0.45, 0.52, 0.41, 0.99}) EXPECT_TRUE(levels(force_n).empty()) << force_n;
  EXPECT_THAT(levels(1.2), ElementsAre(ForceLevel::kAlarm));
  EXPECT_TRUE(levels(0.91).empty());
  EXPECT_THAT(levels(0.89), ElementsAre(ForceLevel::kWarning));
  EXPECT_THAT(levels(0.39), ElementsAre(ForceLevel::kNormal));
  EXPECT_THAT(levels(1.5), ElementsAre(ForceLevel::kAlarm)) << "both at once";
  Frame({}, false);
  EXPECT_EQ(watch_->forces()[0].level(), ForceLevel::kAlarm) << "stays while nothing is measured";
  EXPECT_THAT(levels(0.1), ElementsAre(ForceLevel::kNormal));
}

// Its resultant is about zero: forces from opposite sides cancel.
TEST_F(LinkWatchTest, ARingContactCountsByItsNormalForce) {
  Contact ring = MakeContact(1, 1.5, 20, {4, 5, 6, 7});
  ring.is_ring_contact = true;
  ring.force_n = Vec3(0.001, 0, 0);
  const auto begin = Frame({ring});
  EXPECT_THAT(Kinds(begin), UnorderedElementsAre("contact_begin", "force_level", "force_level"));
  EXPECT_EQ(watch_->forces()[0].level(), ForceLevel::kAlarm);
  EXPECT_DOUBLE_EQ(watch_->forces()[0].force_n(), 1.5);
  EXPECT_DOUBLE_EQ(watch_->forces()[1].force_n(), 0.75) << "half of its markers are in the region";
  Frame({});
  EXPECT_EQ(watch_->forces()[0].level(), ForceLevel::kNormal);
}

TEST_F(LinkWatchTest, ARegionCountsWhatLiesInIt) {
  const auto regions = [&](std::vector<int> markers, double force_n) {
    std::vector<std::string> found;
    for (const Event& event : Frame({MakeContact(1, force_n, 20, std::move(markers))})) {
      if (event.kind == EventKind::kForceLevel) found.push_back(LevelOf(event).region);
    }
    return found;
  };
  EXPECT_TRUE(regions({1, 2, 5}, 0.4).empty()) << "paths 1 and 2";
  EXPECT_TRUE(regions({8, 11}, 0.4).empty()) << "ring 2";
  EXPECT_TRUE(regions({3, 2}, 0.3).empty()) << "half of it";
  EXPECT_THAT(regions({3, 4}, 0.3), ElementsAre("palm")) << "paths 3 and 0: it crosses path 0";
  EXPECT_EQ(watch_->forces()[1].level(), ForceLevel::kWarning);
  EXPECT_NEAR(watch_->forces()[1].force_n(), 0.3, 1e-9);
  EXPECT_EQ(watch_->forces()[0].level(), ForceLevel::kNormal);
}

TEST_F(LinkWatchTest, StatusIsToldWhenItChangesNotForEveryNumber) {
  tell_status_ = true;
  const auto statuses = [&](LinkStatus status, const std::string& reason, int frames) {
    state_.status = status;
    state_.status_reason = reason;
    std::vector<LinkStatus> found;
    for (int i = 0; i < frames; ++i) {
      for (const Event& event : Frame({})) found.push_back(std::get<StatusDetail>(event.detail).status);
    }
    return found;
  };
  EXPECT_THAT(statuses(LinkStatus::kOk, "", 30), ElementsAre(LinkStatus::kOk)) << "after it has started";
  EXPECT_THAT(statuses(LinkStatus::kDegraded, "160 of 240 markers seen", 5),
              ElementsAre(LinkStatus::kDegraded));
  EXPECT_TRUE(statuses(LinkStatus::kDegraded, "158 of 240 markers seen", 5).empty());
  EXPECT_TRUE(statuses(LinkStatus::kOk, "", 5).empty()) << "not for long";
  EXPECT_THAT(statuses(LinkStatus::kDegraded, "no picture from the top camera", 5),
              ElementsAre(LinkStatus::kDegraded));
  EXPECT_THAT(statuses(LinkStatus::kLost, "unplugged", 1), ElementsAre(LinkStatus::kLost));
  EXPECT_THAT(statuses(LinkStatus::kOk, "", 30), ElementsAre(LinkStatus::kOk));
}

TEST_F(LinkWatchTest, BaselineAndDriftAreTold) {
  state_.baseline = {.origin = BaselineOrigin::kStart, .taken_utc_ns = 5};
  ASSERT_THAT(Kinds(Frame({})), ElementsAre("baseline"));
  std::vector<double> told;
  for (int i = 1; i <= 30; ++i) {
    state_.baseline.drift_mm = 0.01 * i;
    for (const Event& event : Frame({})) told.push_back(std::get<DriftDetail>(event.detail).drift_mm);
  }
  ASSERT_EQ(told.size(), 2u) << "in steps of 0.1 mm";
  EXPECT_NEAR(told[0], 0.1, 0.011);
  state_.baseline = {.origin = BaselineOrigin::kTare, .taken_utc_ns = 6};
  EXPECT_TRUE(Frame({}).empty()) << "who asked for it tells it";
}

TEST_F(LinkWatchTest, MissingMarkersAreListedOnceWithTheBaseline) {
  state_.baseline = {.origin = BaselineOrigin::kStart, .taken_utc_ns = 5, .missing_markers = {1, 5}};
  const std::vector<Event> events = Frame({});
  ASSERT_THAT(Kinds(events), ElementsAre("baseline"));
  EXPECT_THAT(std::get<Operation>(events[0].detail).outcome, HasSubstr("path 2, rings 1 to 2"));
  EXPECT_TRUE(Frame({}).empty());
}

Event Numbered(EventKind kind, std::optional<size_t> link = {}) {
  Event event;
  event.kind = kind;
  event.link = link;
  return event;
}

TEST(EventHistory, ACursorMissesNothingWhileTheHistoryHoldsIt) {
  EventHistory history(4, "run");
  int notified = 0;
  EventCursor cursor(history, 0, {}, [&] { ++notified; });
  for (int i = 0; i < 3; ++i) history.Add(Numbered(EventKind::kTare));
  for (uint64_t i = 1; i <= 3; ++i) EXPECT_EQ(cursor.Next().event->sequence, i);
  EXPECT_EQ(notified, 0);
  EXPECT_FALSE(cursor.Next().event);
  history.Add(Numbered(EventKind::kTare));
  history.Add(Numbered(EventKind::kTare));
  EXPECT_EQ(notified, 1) << "once, until it comes for more";
  EXPECT_EQ(cursor.Next().event->sequence, 4u);
  history.Beat();
  EXPECT_TRUE(cursor.Next().status);
  EXPECT_EQ(cursor.Next().event->sequence, 5u);
}

TEST(EventHistory, WhatIsGoneIsCountedBeforeWhatFollows) {
  EventHistory history(4, "run");
  for (int i = 0; i < 10; ++i) history.Add(Numbered(EventKind::kTare));
  EXPECT_EQ(history.oldest(), 7u);
  EventCursor cursor(history, 2, {}, [] {});
  EXPECT_TRUE(cursor.Next().status);
  EXPECT_EQ(cursor.lost(), 4u) << "3, 4, 5, 6";
  EXPECT_EQ(cursor.Next().event->sequence, 7u);
  for (int i = 0; i < 5; ++i) history.Add(Numbered(EventKind::kTare));
  EXPECT_TRUE(cursor.Next().status);
  EXPECT_EQ(cursor.lost(), 8u);
  EXPECT_EQ(cursor.Next().event->sequence, 12u);
}

TEST(EventHistory, AFilterMovesThePlaceOnAllTheSame) {
  EventHistory history(10, "run");
  EventFilter filter{.links = {false, true}, .all_kinds = false};
  filter.kinds[static_cast<size_t>(EventKind::kTare)] = true;
  EventCursor cursor(history, 0, filter, [] {});
  history.Add(Numbered(EventKind::kDrift, 1));
  history.Add(Numbered(EventKind::kTare, 0));
  history.Add(Numbered(EventKind::kTare, 1));
  history.Add(Numbered(EventKind::kTare));
  history.Add(Numbered(EventKind::kDrift));
  EXPECT_EQ(cursor.Next().event->sequence, 3u);
  EXPECT_EQ(cursor.Next().event->sequence, 4u) << "of the whole arm";
  EXPECT_FALSE(cursor.Next().event);
  EXPECT_EQ(cursor.position(), 5u);
}

class EngineTest : public ::testing::Test {
 protected:
  EngineTest() {
    folder_ = std::filesystem::temp_directory_path() / ("taclink_audit." + std::to_string(getpid()));
    std::filesystem::create_directories(folder_);
    options_.audit = (folder_ / "audit.jsonl").string();
  }
  ~EngineTest() override { std::filesystem::remove_all(folder_); }

  std::vector<nlohmann::json> Audit() const {
    std::ifstream in(options_.audit);
    std::vector<nlohmann::json> lines;
    for (std::string line; std::getline(in, line);) lines.push_back(nlohmann::json::parse(line));
    return lines;
  }
  std::unique_ptr<EventEngine> Make() {
    LinkRules rules{.thresholds = {.warning_n = 1}, .regions = {{.name = "palm"}}};
    return std::make_unique<EventEngine>(hub_, std::vector<WatchedLink>{{"a", rules, Grid()}}, options_,
                                         clock_);
  }
  static std::vector<EventPtr> All(EventEngine& engine) {
    EventCursor cursor(engine.history(), 0, {}, [] {});
    std::vector<EventPtr> events;
    while (auto event = cursor.Next().event) events.push_back(event);
    return events;
  }

  std::filesystem::path folder_;
  EventOptions options_;
  ManualClock clock_;
  Hub hub_{1, [](size_t, const LinkState&, Detail) { return std::string(); }};
};

TEST_F(EngineTest, FramesThatWereTooManyAreToldAsLost) {
  const auto engine = Make();
  engine->Subscribe();  // not started yet: nobody takes the frames
  for (uint64_t i = 1; i <= 300; ++i) hub_.Publish(0, MakeState(i));
  engine->Start();
  engine->Stop();
  uint64_t lost = 0;
  for (const auto& event : All(*engine)) {
    if (event->kind == EventKind::kFramesLost) lost += std::get<FramesLostDetail>(event->detail).frames;
  }
  EXPECT_EQ(lost, 300u - 256u);
}

TEST_F(EngineTest, AStepOfTheClockIsToldOnceWithItsSize) {
  const auto told = [this](EventEngine& engine) {
    engine.Start();
    engine.Stop();  // looks once more
    std::vector<double> steps_s;
    for (const auto& event : All(engine)) {
      if (event->kind != EventKind::kClockStepped) continue;
      EXPECT_FALSE(event->link) << "the whole arm";
      steps_s.push_back(std::get<Operation>(event->detail).values.at("step_s"));
    }
    return steps_s;
  };
  const auto engine = Make();
  clock_.Advance(std::chrono::seconds(3600));
  EXPECT_THAT(told(*engine), ElementsAre()) << "time passes";
  clock_.StepUtc(std::chrono::seconds(-60));
  clock_.Advance(std::chrono::seconds(2));
  EXPECT_THAT(told(*engine), ElementsAre(-60));
  clock_.Advance(std::chrono::seconds(2));
  EXPECT_THAT(told(*engine), ElementsAre(-60));
  const auto audit = Audit();
  ASSERT_EQ(audit.size(), 1U);
  EXPECT_EQ(audit[0].at("what"), "clock_stepped");
}

TEST_F(EngineTest, ThresholdsAreSetToldAndAudited) {
  const auto engine = Make();
  engine->Start();
  EXPECT_TRUE(engine->SetThresholds(0, "palm", {.warning_n = 0.5, .alarm_n = 2}, "anna").ok());
  const auto unknown = engine->SetThresholds(0, "back", {}, "anna");
  EXPECT_EQ(unknown.error().code, ErrorCode::kNotFound);
  EXPECT_THAT(unknown.error().message, HasSubstr("palm"));
  EXPECT_EQ(engine->SetThresholds(0, "", {.warning_n = 2, .alarm_n = 1}, "anna").error().code,
            ErrorCode::kInvalidArgument);
  EXPECT_EQ(engine->SetThresholds(0, "", {.warning_n = 0.04}, "anna").error().code,
            ErrorCode::kInvalidArgument);
  engine->Post(EventKind::kTare, 0, {.who = "b\xff", .accepted = false, .outcome = "touched", .values = {}});
  EXPECT_FALSE(engine->SetThresholds(0, std::string(50'000, 'x'), {}, "anna").ok());
  engine->Stop();
  ASSERT_EQ(engine->Levels(0).size(), 2u);
  EXPECT_EQ(engine->Levels(0)[0].thresholds.warning_n, 1);
  EXPECT_EQ(engine->Levels(0)[1].thresholds.alarm_n, 2);
  EXPECT_EQ(All(*engine).size(), 6u);
  const auto lines = Audit();
  ASSERT_EQ(lines.size(), 6u);
  EXPECT_EQ(lines[0].at("what"), "thresholds");
  EXPECT_EQ(lines[0].at("link"), "a");
  EXPECT_EQ(lines[0].at("who"), "anna");
  EXPECT_EQ(lines[0].at("accepted"), true);
  EXPECT_EQ(lines[0].at("values").at("alarm_n"), 2);
  EXPECT_THAT(lines[0].at("time").get<std::string>(), HasSubstr("2023-11-14T"));
  EXPECT_EQ(lines[1].at("accepted"), false);
  EXPECT_EQ(lines[4].at("outcome"), "touched");
  EXPECT_LE(lines[5].at("outcome").get<std::string>().size(), 256u) << "no client's text fills the history";
}

TEST(AuditLine, ShowsATerminalOnlyText) {
  Event event;
  event.kind = EventKind::kTare;
  event.detail = Operation{
      .who = "o\x1b[2J\n\x7f\xc2\x9b\xff\xe2\x80\xa8", .accepted = true, .outcome = {}, .values = {}};
  const std::string line = AuditLine(event, "a");
  for (const char c : line) EXPECT_TRUE(c >= ' ' && c <= '~') << line;
  EXPECT_THAT(line, HasSubstr(R"("o\u001b[2J\n\u007f\u009b\ufffd\u2028")"));
}

TEST_F(EngineTest, TheAuditIsBounded) {
  AuditLog audit(options_.audit, 1000);
  Event event = Numbered(EventKind::kTare);
  event.detail = Operation{.who = "anna", .outcome = std::string(100, 'x'), .values = {}};
  for (int i = 0; i < 50; ++i) audit.Write(event, "a");
  EXPECT_LE(std::filesystem::file_size(options_.audit), 1000u);
  EXPECT_LE(std::filesystem::file_size(options_.audit + ".1"), 1000u);
  EXPECT_GT(Audit().size(), 0u);
  EXPECT_EQ(audit.lost(), 0u);
}

// A file in place of its folder, then none: what waited comes, oldest first, and what was too much is
// counted.
TEST_F(EngineTest, EntriesWaitWhileTheAuditCannotBeWritten) {
  const std::filesystem::path file = options_.audit;
  options_.audit = (file / "audit.jsonl").string();
  std::ofstream(file).close();
  AuditLog audit(options_.audit, 1'000'000);
  Event event = Numbered(EventKind::kTare);
  for (int i = 0; i < 1005; ++i) {
    event.detail = Operation{.who = std::to_string(i), .outcome = {}, .values = {}};
    audit.Write(event, "a");
  }
  EXPECT_EQ(audit.lost(), 5u);
  std::filesystem::remove(file);
  event.detail = Operation{.who = "last", .outcome = {}, .values = {}};
  audit.Write(event, "a");
  const auto lines = Audit();
  ASSERT_EQ(lines.size(), 1001u);
  EXPECT_EQ(lines.front().at("who"), "5");
  EXPECT_EQ(lines.back().at("who"), "last");
  EXPECT_EQ(audit.lost(), 5u);
}

TEST_F(EngineTest, APipeThatNobodyReadsHoldsNobodyUp) {
  ASSERT_EQ(mkfifo(options_.audit.c_str(), 0600), 0);
  AuditLog audit(options_.audit, 1000);
  Event event = Numbered(EventKind::kTare);
  event.detail = Operation{.who = "anna", .outcome = {}, .values = {}};
  audit.Write(event, "a");
  std::filesystem::remove(options_.audit);
  audit.Write(event, "a");
  EXPECT_EQ(Audit().size(), 2u);
}

TEST(Rules, MustFitTheGrid) {
  LinkRules rules{.thresholds = {}, .regions = {{.name = "palm", .first_ring = 0, .last_ring = 3}}};
  EXPECT_THAT(CheckRules(rules, Grid()).error().message, HasSubstr("region 'palm': rings"));
  rules.regions[0].last_ring = 2;
  EXPECT_TRUE(CheckRules(rules, Grid()).ok());
  rules.regions[0].last_path = 4;
  EXPECT_THAT(CheckRules(rules, Grid()).error().message, HasSubstr("1 to 4"));
}

}  // namespace
}  // namespace taclink::server
