#include "server/replay/replay_track.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

namespace taclink::server {
namespace {

// Between the last message of a round and the first of the next; and a log of one message plays once a
// second.
constexpr int64_t kPauseNs = 50'000'000, kShortestRoundNs = 1'000'000'000;
constexpr int64_t kJoinsLateNs = 500'000'000;  // who joins the first round earlier begins at its start

}  // namespace

ReplaySchedule::ReplaySchedule(int64_t from_utc_ns, int64_t to_utc_ns, Clock& clock, LogGaps gaps)
    : gaps_(std::move(gaps)),
      from_ns_(gaps_.PlayedNs(from_utc_ns)),
      length_ns_(std::max(gaps_.PlayedNs(to_utc_ns) - from_ns_ + kPauseNs, kShortestRoundNs)),
      clock_(clock) {}

void ReplaySchedule::Begin() {
  int64_t none = 0;
  start_ns_.compare_exchange_strong(none, clock_.MonotonicNs());
}

int64_t ReplaySchedule::DueNs(uint64_t round, int64_t log_utc_ns) const {
  return start_ns_ + static_cast<int64_t>(round) * length_ns_ + (gaps_.PlayedNs(log_utc_ns) - from_ns_);
}

int64_t ReplaySchedule::PassedNs() const {
  return std::max<int64_t>(clock_.MonotonicNs() - start_ns_, 0);
}

ReplaySchedule::Place ReplaySchedule::Now() const {
  const int64_t passed = PassedNs();
  return {.round = static_cast<uint64_t>(passed / length_ns_),
          .log_utc_ns = gaps_.LogUtcNs(from_ns_ + passed % length_ns_)};
}

void ReplaySchedule::Reached(uint64_t round) {
  uint64_t before = round_;
  while (before < round) {
    if (!round_.compare_exchange_weak(before, round)) continue;
    SPDLOG_INFO("the log has ended and begins again, round {}", round + 1);
    return;
  }
}

Result<std::unique_ptr<ReplayTrack>> ReplayTrack::Open(std::shared_ptr<const mcap::Reader> reader,
                                                       const LogSelection& selection,
                                                       std::shared_ptr<ReplaySchedule> schedule) {
  auto channels = ChooseChannels(*reader, selection);
  if (!channels) return channels.error();
  auto player =
      LogPlayer::Open(std::move(reader), {.channels = std::move(channels->played), .speed = 0, .loop = true});
  if (!player) return player.error();
  schedule->Begin();
  std::unique_ptr<ReplayTrack> track(new ReplayTrack(std::move(*player), std::move(schedule)));
  if (track->schedule_->PassedNs() > kJoinsLateNs) track->CatchUp();
  return track;
}

void ReplayTrack::CatchUp() {
  const ReplaySchedule::Place now = schedule_->Now();
  round_ = now.round;
  player_->Seek(now.log_utc_ns);
}

Result<ReplayTrack::Item> ReplayTrack::Next() {
  while (true) {
    const PlayerStep step = player_->Next(0);  // at speed 0 time does not matter
    switch (step.kind) {
      case PlayerStep::Kind::kMessage:
        return Item{.due_ns = schedule_->DueNs(round_, step.log_utc_ns), .data = step.data};
      case PlayerStep::Kind::kBegunAnew:
        schedule_->Reached(++round_);
        break;
      default:
        return Error{ErrorCode::kEndOfData, "the log has no messages of this kind"};
    }
  }
}

}  // namespace taclink::server
