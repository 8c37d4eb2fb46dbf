#include "server/link/link_worker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <stdexcept>

#include "tests/server/gate.h"
#include "tests/server/support.h"

namespace taclink::server {
namespace {

using std::chrono::milliseconds;
using ::testing::HasSubstr;

void Copy(const StereoFrame& frame, LinkState& state) {
  state.times = frame.times;
  state.status = LinkStatus::kOk;
  state.status_reason.clear();
}

class LinkWorkerTest : public ::testing::Test {
 protected:
  void Run(FakeProcessor::Function process, std::optional<Error> calibration_refusal = {}) {
    auto processor = std::make_unique<FakeProcessor>(std::move(process), std::move(calibration_refusal));
    worker_ = std::make_unique<LinkWorker>("arm", std::make_unique<FakeSource>(script_), std::move(processor),
                                           std::make_shared<LinkOutlet>(0, hub_, clock_), clock_,
                                           LinkWorkerOptions{.poll = milliseconds(5)});
    worker_->Start();
  }
  // The next state with a picture; status reports are passed over.
  PublicationPtr NextFrame() {
    while (true) {
      auto publication = receiver_.Next();
      if (!publication || publication->state().times.exposure_monotonic_ns != 0) return publication;
    }
  }
  PublicationPtr NextStatus(LinkStatus status) {
    while (true) {
      auto publication = receiver_.Next();
      if (!publication || publication->state().status == status) return publication;
    }
  }

  ManualClock clock_;
  const std::shared_ptr<SourceScript> script_ = std::make_shared<SourceScript>();
  Hub hub_{1, [](size_t, const LinkState&, Detail) { return std::string(); }};
  Receiver receiver_{hub_};
  std::unique_ptr<LinkWorker> worker_;
};

TEST_F(LinkWorkerTest, NothingIsSkippedOfASourceThatWaits) {
  script_->waits_for_reader = true;
  Gate gate;
  Run([&gate](const StereoFrame& frame, LinkState& state) {
    gate.Pass();  // the frames that come meanwhile would replace each other
    Copy(frame, state);
  });
  for (uint64_t i = 1; i <= 10; ++i) script_->Push(i);
  gate.WaitForArrival();
  gate.Open();
  for (uint64_t i = 1; i <= 10; ++i) {
    const auto publication = NextFrame();
    ASSERT_NE(publication, nullptr);
    EXPECT_EQ(publication->state().sequence, i);
  }
  EXPECT_EQ(worker_->Statistics().frames_skipped, 0u);
}

TEST_F(LinkWorkerTest, StopsWhileASourceWaitsForItsReader) {
  script_->waits_for_reader = true;
  Gate gate;
  Run([&gate](const StereoFrame& frame, LinkState& state) {
    gate.Pass();
    Copy(frame, state);
  });
  for (uint64_t i = 1; i <= 3; ++i) script_->Push(i);
  gate.WaitForArrival();  // the first is being processed, the second waits
  gate.Open();
  worker_->Stop();
}

TEST_F(LinkWorkerTest, FramesBecomeStatesInOrder) {
  Run(Copy);
  for (uint64_t i = 1; i <= 10; ++i) {
    clock_.Advance(milliseconds(4));
    script_->Push(i, clock_.MonotonicNs() - 4'000'000);
    const auto publication = NextFrame();
    ASSERT_NE(publication, nullptr);
    EXPECT_EQ(publication->state().sequence, i);
    EXPECT_EQ(publication->state().status, LinkStatus::kOk);
    EXPECT_EQ(publication->state().times.published_ns, clock_.MonotonicNs());
  }
  worker_->Stop();
  const auto statistics = worker_->Statistics();
  EXPECT_EQ(statistics.frames, 10u);
  EXPECT_EQ(statistics.frames_skipped, 0u);
  EXPECT_DOUBLE_EQ(statistics.latency_p50_ms, 4);
  EXPECT_NEAR(statistics.rate_hz, 250, 1e-6);
}

TEST_F(LinkWorkerTest, LateMeansTheNewest) {
  Gate gate;
  Run([&](const StereoFrame& frame, LinkState& state) {
    gate.Pass();
    Copy(frame, state);
  });
  script_->Push(1);
  gate.WaitForArrival();
  for (uint64_t i = 2; i <= 6; ++i) script_->Push(i);
  script_->WaitUntilTaken();
  gate.Open();
  EXPECT_EQ(NextFrame()->state().sequence, 1u);
  EXPECT_EQ(NextFrame()->state().sequence, 6u);
  worker_->Stop();
  EXPECT_EQ(worker_->Statistics().frames_skipped, 4u);
}

TEST_F(LinkWorkerTest, SaysThatItStartsAndWhatIsWrong) {
  script_->FailStarts(-1);
  Run(Copy);
  const auto lost = NextStatus(LinkStatus::kLost);
  EXPECT_THAT(lost->state().status_reason, HasSubstr("no camera"));
  ASSERT_EQ(lost->state().reasons.size(), 1u);
  EXPECT_EQ(lost->state().reasons[0].id, ReasonId::kNoFrames);
  EXPECT_GE(script_->starts(), 1);
}

TEST_F(LinkWorkerTest, WithoutFramesTheStatusComesEverySecond) {
  Run(Copy);
  EXPECT_EQ(NextStatus(LinkStatus::kStarting)->state().sequence, 0u);
  script_->Push(3, clock_.MonotonicNs());
  ASSERT_NE(NextFrame(), nullptr);
  for (int i = 0; i < 3; ++i) {
    const auto before = worker_->Statistics().frames;
    clock_.Advance(milliseconds(1000));
    const auto publication = NextStatus(LinkStatus::kLost);
    ASSERT_NE(publication, nullptr);
    EXPECT_EQ(publication->state().sequence, 3u);
    EXPECT_FALSE(publication->state().status_reason.empty());
    EXPECT_FALSE(publication->state().measured());
    EXPECT_EQ(publication->state().times.exposure_monotonic_ns, 0);
    EXPECT_EQ(worker_->Statistics().frames, before);
  }
}

TEST_F(LinkWorkerTest, ALostSourceIsReportedAndComesBack) {
  Run(Copy);
  script_->Push(1);
  ASSERT_NE(NextFrame(), nullptr);
  script_->PushError(ErrorCode::kUnavailable, "/dev/video0 was unplugged");
  EXPECT_THAT(NextStatus(LinkStatus::kLost)->state().status_reason, HasSubstr("unplugged"));
  script_->Push(1);  // it counts again
  clock_.Advance(milliseconds(100));
  EXPECT_EQ(NextStatus(LinkStatus::kOk)->state().sequence, 1u);
  worker_->Stop();
  EXPECT_EQ(worker_->source_condition().restarts, 1u);
  EXPECT_EQ(worker_->Statistics().frames_skipped, 0u);
}

TEST_F(LinkWorkerTest, AProcessorThatThrowsCostsOneFrame) {
  Run([](const StereoFrame& frame, LinkState& state) {
    if (frame.sequence == 1) throw std::runtime_error("singular matrix");
    Copy(frame, state);
  });
  script_->Push(1);
  const auto failed = NextFrame();
  EXPECT_EQ(failed->state().status, LinkStatus::kLost);
  EXPECT_THAT(failed->state().status_reason, HasSubstr("singular matrix"));
  ASSERT_EQ(failed->state().reasons.size(), 1u);
  EXPECT_EQ(failed->state().reasons[0].id, ReasonId::kWorker);
  script_->Push(2);
  EXPECT_EQ(NextFrame()->state().status, LinkStatus::kOk);
}

TEST_F(LinkWorkerTest, StatesAreUsedAgain) {
  Run([](const StereoFrame& frame, LinkState& state) {
    Copy(frame, state);
    state.shape.positions_mm.resize(100);
  });
  std::set<const LinkState*> states;
  for (uint64_t i = 1; i <= 50; ++i) {
    script_->Push(i);
    states.insert(&NextFrame()->state());
  }
  EXPECT_LE(states.size(), 4u);
}

TEST_F(LinkWorkerTest, StopsWhileTheSourceIsLost) {
  script_->FailStarts(-1);
  Run(Copy);
  ASSERT_NE(NextStatus(LinkStatus::kLost), nullptr);
  worker_->Stop();
  worker_->Stop();
}

/// What a calibration told, in order.
struct CalibrationLog {
  CalibrationObserver Observer(int cancel_at = -1) {
    return [this, cancel_at](const CalibrationProgress& progress) {
      const std::lock_guard lock(mutex);
      told.push_back(progress);
      changed.notify_all();
      return progress.end || progress.taken != cancel_at;
    };
  }
  CalibrationProgress Wait(size_t count) {
    std::unique_lock lock(mutex);
    EXPECT_TRUE(changed.wait_for(lock, kForever, [&] { return told.size() >= count; }));
    return told[count - 1];
  }

  std::mutex mutex;
  std::condition_variable changed;
  std::vector<CalibrationProgress> told;
};

TEST_F(LinkWorkerTest, CalibrationTellsItsProgressAndItsEnd) {
  Run(Copy);
  CalibrationLog log;
  ASSERT_TRUE(worker_->Calibrate({.pairs = 3}, log.Observer()).ok());
  EXPECT_EQ(worker_->Calibrate({}, log.Observer()).error().code, ErrorCode::kFailedPrecondition);
  for (size_t i = 1; i <= 3; ++i) {
    script_->Push(i);
    const CalibrationProgress progress = log.Wait(i);
    EXPECT_EQ(progress.taken, static_cast<int>(i));
    EXPECT_EQ(progress.wanted, 3);
    ASSERT_EQ(progress.end.has_value(), i == 3);
  }
  EXPECT_EQ((*log.told.back().end)->markers_used, 200);
  script_->Push(4);
  ASSERT_EQ(NextFrame()->state().status, LinkStatus::kOk);
}

TEST_F(LinkWorkerTest, ACancelledCalibrationMakesRoomForTheNext) {
  Run(Copy);
  CalibrationLog log, second;
  ASSERT_TRUE(worker_->Calibrate({.pairs = 100}, log.Observer(2)).ok());
  for (uint64_t i = 1; i <= 2; ++i) {
    script_->Push(i);
    log.Wait(i);
  }
  while (!worker_->Calibrate({.pairs = 1}, second.Observer())) std::this_thread::yield();
  script_->Push(3);
  EXPECT_TRUE(second.Wait(1).end.has_value());
  EXPECT_EQ(log.told.size(), 2u);
}

TEST_F(LinkWorkerTest, CalibrationWithoutPicturesEnds) {
  Run(Copy);
  CalibrationLog log;
  ASSERT_TRUE(worker_->Calibrate({}, log.Observer()).ok());
  std::thread time([&] {
    while (true) {
      const std::lock_guard lock(log.mutex);
      if (!log.told.empty()) return;
      clock_.Advance(std::chrono::seconds(1));
    }
  });
  const auto end = log.Wait(1).end;
  time.join();
  ASSERT_TRUE(end.has_value());
  EXPECT_EQ(end->error().code, ErrorCode::kUnavailable);
}

TEST_F(LinkWorkerTest, CalibrationEndsWhereFramesAreNoRestPairs) {
  Run(Copy);
  CalibrationLog log;
  ASSERT_TRUE(worker_->Calibrate({.pairs = 3}, log.Observer()).ok());
  script_->Push(1);
  EXPECT_EQ(log.Wait(1).taken, 1);
  // Frames go on arriving, a second apart.
  const auto has_ended = [&] {
    const std::lock_guard lock(log.mutex);
    return log.told.back().end.has_value();
  };
  for (uint64_t i = 2; !has_ended(); ++i) {
    ASSERT_LT(i, 20U) << "no end after 18 s";
    clock_.Advance(std::chrono::seconds(1));
    script_->Push([i](StereoFrame& frame) -> Result<void> {
      frame.sequence = i;
      frame.times.exposure_monotonic_ns = static_cast<int64_t>(i);
      frame.pressure.stale = true;
      return {};
    });
    ASSERT_NE(NextFrame(), nullptr);
    log.Wait(i);
  }
  const std::lock_guard lock(log.mutex);
  const Error error = log.told.back().end->error();
  EXPECT_EQ(error.code, ErrorCode::kUnavailable);
  EXPECT_THAT(error.message, HasSubstr("a stale pressure"));
}

TEST_F(LinkWorkerTest, CalibrationMayBeRefused) {
  Run(Copy, Error{ErrorCode::kFailedPrecondition, "touched"});
  CalibrationLog log;
  ASSERT_TRUE(worker_->Calibrate({}, log.Observer()).ok());
  EXPECT_EQ(log.Wait(1).end->error().message, "touched");
}

TEST_F(LinkWorkerTest, StoppingEndsACalibration) {
  Run(Copy);
  CalibrationLog log;
  ASSERT_TRUE(worker_->Calibrate({}, log.Observer()).ok());
  worker_->Stop();
  EXPECT_EQ(log.Wait(1).end->error().code, ErrorCode::kUnavailable);
}

/// The one answer that a tare gives.
struct TareAnswer {
  TareObserver Observer() {
    return [this](const Result<TareSummary>& end) {
      const std::lock_guard lock(mutex);
      answers.push_back(end);
      changed.notify_all();
    };
  }
  Result<TareSummary> Wait() {
    std::unique_lock lock(mutex);
    EXPECT_TRUE(changed.wait_for(lock, kForever, [&] { return !answers.empty(); }));
    return answers.front();
  }

  std::mutex mutex;
  std::condition_variable changed;
  std::vector<Result<TareSummary>> answers;
};

TEST_F(LinkWorkerTest, ATareTakesTheNextFramesAndEnds) {
  Run(Copy);
  TareAnswer answer, second;
  ASSERT_TRUE(worker_->Tare({.frames = 2, .force = true}, answer.Observer()).ok());
  EXPECT_EQ(worker_->Tare({}, second.Observer()).error().code, ErrorCode::kFailedPrecondition);
  for (uint64_t i = 1; i <= 4; ++i) {
    script_->Push(i);
    ASSERT_EQ(NextFrame()->state().status, LinkStatus::kOk) << "frames go on";
  }
  const auto end = answer.Wait();
  ASSERT_TRUE(end.ok());
  EXPECT_EQ(end->frames, 2);
  EXPECT_TRUE(end->forced);
  EXPECT_TRUE(worker_->Tare({}, second.Observer()).ok()) << "room for the next";
  worker_->Stop();
}

TEST_F(LinkWorkerTest, ATareMayBeRefused) {
  Run(Copy, Error{ErrorCode::kFailedPrecondition, "touched"});
  TareAnswer answer;
  ASSERT_TRUE(worker_->Tare({}, answer.Observer()).ok());
  EXPECT_EQ(answer.Wait().error().message, "touched");
}

TEST_F(LinkWorkerTest, ATareWithoutFramesEnds) {
  Run(Copy);
  TareAnswer answer;
  ASSERT_TRUE(worker_->Tare({.frames = 300}, answer.Observer()).ok());
  std::thread time([&] {
    while (true) {
      const std::lock_guard lock(answer.mutex);
      if (!answer.answers.empty()) return;
      clock_.Advance(std::chrono::seconds(1));
    }
  });
  const auto end = answer.Wait();
  time.join();
  EXPECT_EQ(end.error().code, ErrorCode::kUnavailable);
}

TEST_F(LinkWorkerTest, StoppingEndsATare) {
  Run(Copy);
  TareAnswer answer;
  ASSERT_TRUE(worker_->Tare({.frames = 300}, answer.Observer()).ok());
  worker_->Stop();
  EXPECT_THAT(answer.Wait().error().message, HasSubstr("stopping"));
}

}  // namespace
}  // namespace taclink::server
