#include "server/link/link_supervisor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <thread>

#include "sensing/core/thread_start.h"
#include "server/link/watchdog.h"
#include "tests/server/gate.h"
#include "tests/server/support.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::AllOf;
using ::testing::HasSubstr;
using State = Supervision::State;

constexpr milliseconds kPoll{1};
constexpr milliseconds kStep{50};

enum class Hung { kNone, kCapture, kFem };

void Measure(const StereoFrame& frame, LinkState& state) {
  state.times = frame.times;
  state.status = LinkStatus::kOk;
  state.status_reason.clear();
  state.reasons = {{ReasonId::kDrift, "of this frame"}};
}

class LinkSupervisorTest : public ::testing::Test {
 protected:
  void TearDown() override {
    link_.reset();
    // Also threads that were given up use what is here.
    Until([this] { return *living_ == 0 && script_->living == 0; });
  }

  // The clock is faster than threads that are about to end: only who wants it sees them given up.
  static WatchdogOptions Patient() { return {.abandon = std::chrono::hours(10)}; }
  void Run(FakeProcessor::Function process, WatchdogOptions watchdog = Patient()) {
    process_ = std::move(process);
    watchdog.first_frames = seconds(1);
    watchdog.stop = milliseconds(20);
    watchdog.build = std::chrono::hours(10);  // the clock is faster than the thread that builds
    link_ = std::make_unique<LinkSupervisor>(
        0, "arm", std::make_unique<FakeSource>(script_), MakeProcessor(),
        LinkFactories{.source = [this] { return MakeSource(); }, .processor = [this] { return MakeBuilt(); }},
        hub_, clock_,
        LinkWorkerOptions{.poll = kPoll, .failures = 3, .supervisor = {.stall = std::chrono::hours(10)}},
        watchdog);
    link_->Start();
  }

  std::unique_ptr<LinkProcessor> MakeProcessor() {
    // Counts the processors that are alive, those of workers that were given up among them.
    ++*living_;
    const std::shared_ptr<void> life(nullptr, [living = living_](void*) { --*living; });
    return std::make_unique<FakeProcessor>(
        [life, process = process_](const StereoFrame& frame, LinkState& state) { process(frame, state); });
  }
  Result<std::unique_ptr<FrameSource>> MakeSource() {
    ++made_;
    if (build_error_) return *build_error_;
    return std::unique_ptr<FrameSource>(std::make_unique<FakeSource>(script_));
  }
  Result<std::unique_ptr<LinkProcessor>> MakeBuilt() { return MakeProcessor(); }

  // Time passes, and the watchdog looks as often as it should.
  void Pass(milliseconds time, milliseconds step = kStep) {
    for (milliseconds passed{0}; passed < time; passed += step) {
      clock_.Advance(step);
      LetThreadsSee();
      link_->Check();
    }
  }
  // Until the threads that do not hang have come round at this time, for the clock is faster than they are.
  void LetThreadsSee() {
    const auto worker = link_->current();
    const int64_t now_ns = clock_.MonotonicNs();
    const auto seen = [&](const StageMark& mark, Hung hung) {
      return hung == hung_ || mark.Read().since_ns >= now_ns;
    };
    const auto give_up = std::chrono::steady_clock::now() + kForever;
    while (worker && worker == link_->current() && !worker->failure() &&
           link_->supervision().state != State::kRestarting &&
           !(seen(worker->capture_mark(), Hung::kCapture) && seen(worker->fem_mark(), Hung::kFem))) {
      ASSERT_LT(std::chrono::steady_clock::now(), give_up);
      std::this_thread::yield();
    }
  }
  template <typename Condition>
  void Until(Condition condition) {
    const auto give_up = std::chrono::steady_clock::now() + kForever;
    while (!condition()) {
      ASSERT_LT(std::chrono::steady_clock::now(), give_up);
      if (link_) link_->Check();
      std::this_thread::yield();
    }
  }
  void UntilState(State state) {
    Until([&] { return link_->supervision().state == state; });
  }
  // A worker dies; the watchdog notices and, after the pause, starts the next one.
  void UntilRestarted(uint64_t restarts) {
    Until([&] {
      Pass(kStep);
      return link_->supervision().restarts == restarts;
    });
  }
  PublicationPtr NextFrame() {
    while (true) {
      auto publication = receiver_.Next();
      if (!publication || publication->state().times.exposure_monotonic_ns != 0) return publication;
    }
  }
  // All that was published up to now.
  std::vector<PublicationPtr> Published() {
    std::vector<PublicationPtr> all;
    while (auto publication = receiver_.subscription().Take()) all.push_back(std::move(publication));
    return all;
  }

  ManualClock clock_;
  const std::shared_ptr<SourceScript> script_ = std::make_shared<SourceScript>();
  Hub hub_{1, [](size_t, const LinkState&, Detail) { return std::string(); }};
  Receiver receiver_{hub_};
  FakeProcessor::Function process_;
  Hung hung_ = Hung::kNone;
  const std::shared_ptr<std::atomic<int>> living_ = std::make_shared<std::atomic<int>>(0);
  std::atomic<int> made_ = 0;
  std::optional<Error> build_error_;
  std::unique_ptr<LinkSupervisor> link_;
};

TEST_F(LinkSupervisorTest, AHungFrameIsReportedInTheWorkersPlace) {
  Gate gate;
  Run([&](const StereoFrame& frame, LinkState& state) {
    if (frame.sequence == 2) gate.Pass();
    Measure(frame, state);
  });
  script_->Push(1);
  ASSERT_NE(NextFrame(), nullptr);
  script_->Push(2);
  gate.WaitForArrival();
  hung_ = Hung::kFem;
  Pass(milliseconds(900));
  EXPECT_EQ(link_->supervision().state, State::kRunning) << "not late yet";
  Published();
  Pass(milliseconds(200));
  const auto first = Published();
  ASSERT_EQ(first.size(), 1u);
  EXPECT_EQ(first[0]->state().status, LinkStatus::kLost);
  EXPECT_EQ(first[0]->state().sequence, 1u);
  EXPECT_THAT(first[0]->state().status_reason,
              HasSubstr("taking a frame through FEM takes more than the 1 s"));
  Pass(seconds(5));
  const auto reports = Published();
  EXPECT_GE(reports.size(), 4u) << "at least once a second";
  for (const auto& report : reports) {
    const LinkState& state = report->state();
    ASSERT_EQ(state.reasons.size(), 1u) << "none of the frames before";
    EXPECT_EQ(state.reasons[0].id, ReasonId::kWorker);
    EXPECT_EQ(state.reasons[0].text, state.status_reason);
  }
  EXPECT_EQ(link_->supervision().overruns, 1u);

  gate.Open();
  hung_ = Hung::kNone;
  EXPECT_EQ(NextFrame()->state().sequence, 2u);
  UntilState(State::kRunning);
  script_->Push(3);
  EXPECT_EQ(NextFrame()->state().status, LinkStatus::kOk);
  EXPECT_EQ(link_->supervision().overruns, 1u);
  EXPECT_EQ(link_->supervision().restarts, 0u);
}

TEST_F(LinkSupervisorTest, AHungSourceIsReportedWithItsStage) {
  Gate gate;
  Run(Measure);
  script_->Push(1);
  ASSERT_NE(NextFrame(), nullptr);
  script_->Push([&](StereoFrame&) -> Result<void> {
    gate.Pass();
    return Error{ErrorCode::kTimeout, "late"};
  });
  gate.WaitForArrival();
  hung_ = Hung::kCapture;
  Pass(milliseconds(1100));
  UntilState(State::kOverdue);
  Published();
  Pass(seconds(3));
  const auto reports = Published();
  EXPECT_GE(reports.size(), 2u);
  for (const auto& report : reports)  // one voice: the worker's own reports are still
    EXPECT_THAT(report->state().status_reason, HasSubstr("waiting for the source's next frame takes more"));
  gate.Open();
  hung_ = Hung::kNone;
  UntilState(State::kRunning);
  script_->Push(2);
  EXPECT_EQ(NextFrame()->state().sequence, 2u);
}

TEST_F(LinkSupervisorTest, AWorkerThatDiesIsStartedAgainWithFreshParts) {
  Run([](const StereoFrame& frame, LinkState& state) {
    if (frame.sequence == 1) throw 42;  // no std::exception: leaves the loop
    Measure(frame, state);
  });
  script_->Push(1);
  UntilRestarted(1);
  EXPECT_EQ(made_, 1);
  bool reported = false;
  for (const auto& publication : Published())
    reported = reported || publication->state().status_reason.find("unknown type") != std::string::npos;
  EXPECT_TRUE(reported);
  script_->Push(2);
  EXPECT_EQ(NextFrame()->state().sequence, 2u);
  const Supervision now = link_->supervision();
  EXPECT_EQ(now.state, State::kRunning);
  EXPECT_EQ(now.abandoned, 0u);
  EXPECT_THAT(now.last_failure, HasSubstr("unknown type"));
  EXPECT_EQ(*living_, 1) << "the dead worker's processor is gone";
}

TEST_F(LinkSupervisorTest, AProcessorThatAlwaysThrowsIsReplaced) {
  Run([](const StereoFrame&, LinkState&) { throw std::runtime_error("no memory of the rest shape"); });
  for (uint64_t i = 1; i <= 3; ++i) {
    script_->Push(i);
    if (i < 3) {
      ASSERT_NE(NextFrame(), nullptr);
    }
  }
  UntilRestarted(1);
  EXPECT_THAT(link_->supervision().last_failure, HasSubstr("3 frames in a row failed"));
}

TEST_F(LinkSupervisorTest, ThreeDeathsInARowAndItRestsUntilSomebodyWakesIt) {
  Run([](const StereoFrame& frame, LinkState& state) {
    if (frame.sequence < 10) throw 42;
    Measure(frame, state);
  });
  script_->Push(1);
  UntilRestarted(1);
  script_->Push(2);
  UntilRestarted(2);
  script_->Push(3);
  UntilState(State::kResting);
  Published();
  Pass(seconds(100));
  const auto reports = Published();
  EXPECT_GE(reports.size(), 90u);
  EXPECT_EQ(reports.back()->state().status, LinkStatus::kLost);
  EXPECT_THAT(reports.back()->state().status_reason, HasSubstr("failed 3 times in a row"));
  EXPECT_THAT(reports.back()->state().status_reason, HasSubstr("taclink restart --link arm"));
  EXPECT_EQ(link_->Calibrate({}, [](const auto&) { return true; }).error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(link_->supervision().restarts, 2u);

  link_->Wake();
  UntilRestarted(3);
  script_->Push(10);
  EXPECT_EQ(NextFrame()->state().sequence, 10u);
  EXPECT_EQ(link_->supervision().state, State::kRunning);
}

TEST_F(LinkSupervisorTest, AWorkerThatLivedLongBeginsANewRow) {
  Run([](const StereoFrame&, LinkState&) { throw 42; });
  for (uint64_t death = 1; death <= 5; ++death) {
    Pass(seconds(61), milliseconds(500));
    script_->Push(death);
    UntilRestarted(death);
  }
  EXPECT_EQ(link_->supervision().state, State::kRunning);
}

TEST_F(LinkSupervisorTest, PausesBetweenRestartsGrow) {
  Run([](const StereoFrame&, LinkState&) { throw 42; }, {.abandon = std::chrono::hours(10), .deaths = 100});
  std::vector<double> pauses_s;
  for (uint64_t death = 1; death <= 8; ++death) {
    script_->Push(death);
    UntilState(State::kRestarting);
    const int64_t begin_ns = clock_.MonotonicNs();
    UntilRestarted(death);
    pauses_s.push_back(1e-9 * static_cast<double>(clock_.MonotonicNs() - begin_ns));
  }
  EXPECT_GE(pauses_s[0], 0.5);
  EXPECT_GE(pauses_s[1], 1);
  EXPECT_GE(pauses_s[7], 10);
}

TEST_F(LinkSupervisorTest, AHungThreadIsGivenUpAndItsLateReturnIsIgnored) {
  Gate gate;
  Run(
      [&](const StereoFrame& frame, LinkState& state) {
        if (frame.sequence == 1) gate.Pass();
        Measure(frame, state);
      },
      {});
  script_->Push(1);
  gate.WaitForArrival();
  hung_ = Hung::kFem;
  auto old = link_->current();
  Pass(seconds(31));
  hung_ = Hung::kNone;
  Until([&] { return old->WaitEnded() == 1; });  // the other thread, which would take the script's next frame
  old.reset();
  UntilRestarted(1);
  EXPECT_THAT(link_->supervision().last_failure, HasSubstr("hung for"));
  EXPECT_EQ(link_->supervision().abandoned, 1u);
  EXPECT_EQ(*living_, 2) << "the hung one keeps its processor";
  script_->Push(2);
  EXPECT_EQ(NextFrame()->state().sequence, 2u);

  gate.Open();
  Until([this] { return *living_ == 1; });  // it came back, and took its things with it
  script_->Push(3);
  EXPECT_EQ(NextFrame()->state().sequence, 3u) << "and not 1";
}

// The rest frame hangs; when it returns, the calibration is complete and would be saved.
TEST_F(LinkSupervisorTest, ACalibrationOfAWorkerThatWasGivenUpWritesNoFileAndSaysNothingMore) {
  Gate gate;
  Run(
      [&](const StereoFrame& frame, LinkState& state) {
        if (frame.sequence == 2) gate.Pass();
        Measure(frame, state);
      },
      {});
  const int saves_before = FakeProcessor::saves;
  std::atomic<int> calls = 0;
  std::atomic<bool> failed = false;
  const auto observer = [&](const CalibrationProgress& progress) {
    if (progress.end) failed = !progress.end->ok();
    ++calls;
    return true;
  };
  ASSERT_TRUE(link_->Calibrate({.pairs = 2, .save = true}, observer).ok());
  script_->Push(1);
  Until([&] { return calls == 1; });
  script_->Push(2);
  gate.WaitForArrival();
  hung_ = Hung::kFem;
  Pass(seconds(31));
  hung_ = Hung::kNone;
  EXPECT_EQ(calls, 2);
  EXPECT_TRUE(failed);
  UntilRestarted(1);
  gate.Open();
  Until([this] { return *living_ == 1; });  // it came back and ended
  EXPECT_EQ(FakeProcessor::saves, saves_before);
  EXPECT_EQ(calls, 2);
}

TEST_F(LinkSupervisorTest, ACalibrationWithSavesOneFile) {
  Run(Measure);
  const int saves_before = FakeProcessor::saves;
  std::atomic<bool> ended = false;
  ASSERT_TRUE(link_
                  ->Calibrate({.pairs = 1, .save = true},
                              [&](const CalibrationProgress& progress) {
                                ended = progress.end && progress.end->ok();
                                return true;
                              })
                  .ok());
  script_->Push(1);
  Until([&] { return ended.load(); });
  EXPECT_EQ(FakeProcessor::saves, saves_before + 1);
}

// The first camera hangs while it is set; when it returns, the second one is the next worker's.
TEST_F(LinkSupervisorTest, AWorkerThatWasGivenUpSetsNoOtherCameraAndNothingIsRemembered) {
  Gate gate;
  Run(Measure, {});
  script_->Push(1);
  ASSERT_NE(NextFrame(), nullptr);
  std::atomic<int> set_top = 0, set_bottom = 0, refused = 0;
  script_->OnSetCamera([&](CameraId id) {
    ++(id == CameraId::kTop ? set_top : set_bottom);
    gate.Pass();
  });
  ASSERT_TRUE(link_
                  ->SetCamera({.cameras = {true, true}, .settings = {.gain = 5}},
                              [&](const Result<void>& done) { refused += done ? 100 : 1; })
                  .ok());
  gate.WaitForArrival();
  hung_ = Hung::kCapture;
  Pass(seconds(31));
  hung_ = Hung::kNone;
  EXPECT_EQ(refused, 1);
  UntilRestarted(1);
  gate.Open();
  Until([this] { return script_->living == 1 && *living_ == 1; });
  EXPECT_EQ(set_top, 1);
  EXPECT_EQ(set_bottom, 0);
  EXPECT_EQ(refused, 1);
  script_->OnSetCamera({});
  link_->Restart();
  UntilRestarted(2);
  const auto remembered = script_->remembered();
  EXPECT_EQ(remembered.size(), 4u);
  for (const auto& [camera, settings] : remembered) EXPECT_EQ(settings.gain, std::nullopt);
}

TEST_F(LinkSupervisorTest, StoppingDoesNotWaitForAHungThread) {
  Gate gate;
  Run([&](const StereoFrame& frame, LinkState& state) {
    gate.Pass();
    Measure(frame, state);
  });
  script_->Push(1);
  gate.WaitForArrival();
  link_->Stop();
  EXPECT_EQ(link_->supervision().abandoned, 1u);
  link_.reset();
  Published();
  gate.Open();
  Until([this] { return *living_ == 0; });
  EXPECT_TRUE(Published().empty());
}

TEST_F(LinkSupervisorTest, ACalibrationIsToldThatItsWorkerDied) {
  Run([](const StereoFrame&, LinkState&) { throw 42; });
  std::mutex mutex;
  std::optional<Error> end;
  const auto told = [&] {
    const std::lock_guard lock(mutex);
    return end.has_value();
  };
  ASSERT_TRUE(link_
                  ->Calibrate({},
                              [&](const CalibrationProgress& progress) {
                                const std::lock_guard lock(mutex);
                                if (progress.end) end = progress.end->error();
                                return true;
                              })
                  .ok());
  script_->Push(1);
  Until(told);
  EXPECT_THAT(end->message, HasSubstr("worker failed"));
}

TEST_F(LinkSupervisorTest, PartsThatCannotBeMadeCountAsDeaths) {
  Run([](const StereoFrame&, LinkState&) { throw 42; });
  build_error_ = Error{ErrorCode::kNotFound, "the calibration file has gone"};
  script_->Push(1);
  Until([this] {
    Pass(kStep);
    return link_->supervision().state == State::kResting;
  });
  EXPECT_THAT(link_->supervision().reason, HasSubstr("the calibration file has gone"));
  EXPECT_EQ(made_, 2);
}

TEST_F(LinkSupervisorTest, RestartReplacesAWorkerThatRuns) {
  Run(Measure);
  script_->Push(1);
  ASSERT_NE(NextFrame(), nullptr);
  link_->Restart();
  UntilRestarted(1);
  script_->Push(2);
  EXPECT_EQ(NextFrame()->state().sequence, 2u);
  EXPECT_EQ(link_->Statistics().frames, 2u) << "counted over all workers";
  EXPECT_TRUE(link_->supervision().last_failure.empty());
  link_->Wake();
  Pass(seconds(1));
  EXPECT_EQ(link_->supervision().restarts, 1u) << "it did not rest";
}

// The watchdog goes on while the source of the worker that it replaces does not end: Check returns.
TEST_F(LinkSupervisorTest, ASourceThatHangsWhileItIsClosedHoldsOnlyItsOwnLinkUp) {
  Gate gate;
  Run(Measure);
  script_->Push(1);
  ASSERT_NE(NextFrame(), nullptr);
  script_->OnClose([&gate] { gate.Pass(); });
  link_->Restart();
  link_->Check();
  gate.WaitForArrival();
  Pass(seconds(5));
  EXPECT_EQ(link_->supervision().state, State::kRestarting);
  EXPECT_EQ(made_, 0) << "a camera is closed before it is opened again";
  script_->OnClose({});
  gate.Open();
  UntilRestarted(1);
  script_->Push(2);
  EXPECT_EQ(NextFrame()->state().sequence, 2u);
  EXPECT_EQ(link_->supervision().abandoned, 0u);
}

TEST_F(LinkSupervisorTest, ASourceThatNeverClosesIsGivenUp) {
  Gate gate;
  Run(Measure, {});
  script_->Push(1);
  ASSERT_NE(NextFrame(), nullptr);
  script_->OnClose([&gate] { gate.Pass(); });
  link_->Restart();
  link_->Check();
  gate.WaitForArrival();
  script_->OnClose({});
  Pass(seconds(31));
  UntilRestarted(1);
  EXPECT_EQ(link_->supervision().abandoned, 1u);
  script_->Push(2);
  EXPECT_EQ(NextFrame()->state().sequence, 2u);
  gate.Open();
  Until([this] { return script_->living == 1; });
}

TEST_F(LinkSupervisorTest, ARestartForWhichThereIsNoThreadIsTriedAgain) {
  Run([](const StereoFrame& frame, LinkState& state) {
    if (frame.sequence == 1) throw 42;
    Measure(frame, state);
  });
  {
    const ThreadShortage shortage("build:arm");
    script_->Push(1);
    Until([&] {
      Pass(kStep);
      return link_->supervision().last_failure.find("no thread") != std::string::npos;
    });
    EXPECT_EQ(shortage.refused(), 1);
    EXPECT_THAT(link_->supervision().reason,
                AllOf(HasSubstr("no thread can be started for build:arm"), HasSubstr("TasksMax")));
    EXPECT_EQ(made_, 0);
  }
  UntilRestarted(1);
  script_->Push(2);
  EXPECT_EQ(NextFrame()->state().sequence, 2u);
  Until([] { return DetachedThreads() == 0; });
}

TEST_F(LinkSupervisorTest, AWorkerThatGetsNoThreadIsReplaced) {
  Run(Measure);
  script_->Push(1);
  ASSERT_NE(NextFrame(), nullptr);
  {
    const ThreadShortage shortage("cap:arm");
    link_->Restart();
    Until([&] {
      Pass(kStep);
      return link_->supervision().last_failure.find("no thread") != std::string::npos;
    });
    EXPECT_EQ(shortage.refused(), 1);
  }
  UntilRestarted(2);
  script_->Push(2);
  EXPECT_EQ(NextFrame()->state().sequence, 2u);
  Until([this] { return *living_ == 1 && script_->living == 1; });
}

TEST_F(LinkSupervisorTest, WhatCamerasWereSetToOutlivesTheirWorker) {
  Run(Measure);
  script_->Push(1);
  ASSERT_NE(NextFrame(), nullptr);  // the source runs
  std::atomic<int> taken = 0, refused = 0;
  const auto set = [&](const CameraOrder& order) {
    const int before = taken + refused;
    const auto observer = [&](const Result<void>& done) { done ? ++taken : ++refused; };
    ASSERT_TRUE(link_->SetCamera(order, observer).ok());
    Until([&] { return taken + refused > before; });
  };
  set({.cameras = {false, true}, .settings = {.exposure_100us = 80, .gain = 3}});
  set({.cameras = {true, true}, .settings = {.gain = 5}});
  set({.cameras = {true, true}, .settings = {.gain = 99}});
  EXPECT_EQ(taken, 2);
  EXPECT_EQ(refused, 1);
  link_->Restart();
  UntilRestarted(1);
  const auto remembered = script_->remembered();
  ASSERT_EQ(remembered.size(), 2u);
  for (const auto& [camera, settings] : remembered) {
    EXPECT_EQ(settings.gain, 5);
    EXPECT_EQ(settings.exposure_100us, camera == CameraId::kTop ? std::nullopt : std::optional(80));
  }
}

TEST_F(LinkSupervisorTest, CommandsAreRefusedOnceClosedAlsoByALaterWorker) {
  Run(Measure);
  link_->CloseCommands({ErrorCode::kUnavailable, "the server is stopping"});
  const auto unexpected = [](const Result<void>&) { FAIL() << "a refused command has no observer"; };
  EXPECT_EQ(link_->SetCamera({}, unexpected).error().code, ErrorCode::kUnavailable);
  link_->Restart();
  UntilRestarted(1);
  EXPECT_EQ(link_->SetCamera({}, unexpected).error().code, ErrorCode::kUnavailable);
}

TEST_F(LinkSupervisorTest, NobodyIsBlamedForAStandstillOfTheWholeProgram) {
  Gate gate;
  Run([&](const StereoFrame& frame, LinkState& state) {
    gate.Pass();
    Measure(frame, state);
  });
  script_->Push(1);
  gate.WaitForArrival();
  hung_ = Hung::kFem;
  clock_.Advance(seconds(3600));
  link_->Check();
  Pass(milliseconds(800));
  EXPECT_EQ(link_->supervision().overruns, 0u);
  gate.Open();
  EXPECT_NE(NextFrame(), nullptr);
}

TEST_F(LinkSupervisorTest, TheWatchdogsThreadDoesAllOfThis) {
  Run([](const StereoFrame& frame, LinkState& state) {
    if (frame.sequence == 1) throw 42;
    Measure(frame, state);
  });
  std::atomic<int> rounds = 0;
  Watchdog watchdog(clock_, milliseconds(1));
  watchdog.OnRound([&] { ++rounds; });
  watchdog.Start({link_.get()});
  script_->Push(1);
  const auto give_up = std::chrono::steady_clock::now() + kForever;
  while (link_->supervision().restarts == 0 && std::chrono::steady_clock::now() < give_up)
    clock_.Advance(kStep), LetThreadsSee();
  script_->Push(2);
  EXPECT_EQ(NextFrame()->state().sequence, 2u);
  watchdog.Stop();
  EXPECT_GT(rounds, 0);
}

}  // namespace
}  // namespace taclink::server
