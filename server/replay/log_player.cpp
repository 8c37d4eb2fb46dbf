#include "server/replay/log_player.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <string>
#include <utility>

namespace taclink::server {
namespace {

constexpr int64_t kShortestRoundNs = 100'000'000;  // of a range that starts over repeatedly
constexpr double kLongestNs = 1e18;

int64_t Bounded(uint64_t time_ns) {
  return static_cast<int64_t>(std::min<uint64_t>(time_ns, std::numeric_limits<int64_t>::max()));
}

std::set<uint16_t> ChannelsOf(const PlayerOptions& options, bool only_states) {
  std::set<uint16_t> out;
  for (const auto& [id, channel] : options.channels) {
    if (!only_states || channel.state) out.insert(id);
  }
  return out;
}

}  // namespace

Result<void> LogPlayer::CheckSpeed(double speed) {
  if (speed == 0 || (speed >= kSlowest && speed <= kFastest)) return {};
  return Error{ErrorCode::kInvalidArgument,
               "speed must be 0.1 to 100, or 0 for as fast as messages are taken"};
}

Result<std::unique_ptr<LogPlayer>> LogPlayer::Open(std::shared_ptr<const mcap::Reader> reader,
                                                   PlayerOptions options) {
  if (const auto good = CheckSpeed(options.speed); !good) return good.error();
  const int64_t begin = Bounded(reader->statistics().message_start_ns);
  const int64_t end = Bounded(reader->statistics().message_end_ns);
  if (options.from_utc_ns < 0 || options.to_utc_ns < 0)
    return Error{ErrorCode::kInvalidArgument, "from_utc_ns and to_utc_ns must not be negative"};
  options.to_utc_ns = options.to_utc_ns == 0 ? end : std::min(options.to_utc_ns, end);
  options.from_utc_ns = std::max(options.from_utc_ns, begin);
  if (options.from_utc_ns > options.to_utc_ns)
    return Error{ErrorCode::kInvalidArgument, "the log has nothing in this range: it goes from " +
                                                  std::to_string(begin) + " to " + std::to_string(end) +
                                                  " ns since 1970-01-01 UTC"};
  return std::unique_ptr<LogPlayer>(new LogPlayer(std::move(reader), std::move(options)));
}

LogPlayer::LogPlayer(std::shared_ptr<const mcap::Reader> reader, PlayerOptions options)
    : reader_(std::move(reader)),
      gaps_(*reader_),
      options_(std::move(options)),
      head_utc_ns_(options_.from_utc_ns),
      position_utc_ns_(options_.from_utc_ns),
      paused_(options_.paused) {
  if (const auto& scan = reader_->scan())
    damaged_in_scan_ = std::max<uint64_t>(scan->damaged_chunks, scan->lost.size());
  OpenCursor(options_.from_utc_ns);
}

void LogPlayer::OpenCursor(int64_t start_utc_ns) {
  next_.reset();
  exhausted_ = false;
  cursor_ = std::make_unique<mcap::MessageCursor>(
      *reader_, mcap::CursorOptions{.start_ns = static_cast<uint64_t>(start_utc_ns),
                                    .end_ns = static_cast<uint64_t>(options_.to_utc_ns),
                                    .channels = ChannelsOf(options_, false)});
}

// False: there is no next message.
bool LogPlayer::Fetch() {
  while (!next_ && !exhausted_) {
    const auto message = cursor_->Next();
    if (message) {
      next_ = *message;
    } else if (message.error().code == ErrorCode::kEndOfData) {
      exhausted_ = true;
    } else {
      damage_.insert(message.error().message);
    }
  }
  return next_.has_value();
}

PlayerStep LogPlayer::Next(int64_t now_ns) {
  if (!states_.empty()) {
    State state = std::move(states_.back());
    states_.pop_back();
    given_ = std::move(state.data);
    return {.kind = PlayerStep::Kind::kMessage,
            .channel = state.channel,
            .log_utc_ns = state.log_utc_ns,
            .data = given_};
  }
  if (ended_) return {.kind = PlayerStep::Kind::kEnded};
  if (paused_ && steps_ == 0) return {.kind = PlayerStep::Kind::kPaused};
  if (!paused_ && !anchor_) AnchorAt(now_ns);
  if (!Fetch()) return AtEnd(now_ns);
  std::optional<int64_t> due;
  if (!paused_ && options_.speed != 0) {
    const int64_t at_ns = Due(Bounded(next_->log_time_ns));
    if (now_ns < at_ns) return {.kind = PlayerStep::Kind::kWait, .due_ns = at_ns};
    due = at_ns;
  }
  const mcap::Message message = *std::exchange(next_, std::nullopt);
  return Give(message, due);
}

PlayerStep LogPlayer::Give(const mcap::Message& message, std::optional<int64_t> due_ns) {
  fruitful_ = true;
  position_utc_ns_ = head_utc_ns_ = Bounded(message.log_time_ns);
  if (paused_) CountStep(message.channel_id);
  return {.kind = PlayerStep::Kind::kMessage,
          .due_ns = due_ns,
          .channel = message.channel_id,
          .log_utc_ns = position_utc_ns_,
          .data = message.data};
}

void LogPlayer::CountStep(uint16_t channel) {
  if (!options_.channels.at(channel).frame) return;
  if (!step_channel_) step_channel_ = channel;
  if (step_channel_ == channel) --steps_;
}

// The range ends at its end, also if the last message comes before.
PlayerStep LogPlayer::AtEnd(int64_t now_ns) {
  const bool again = options_.loop && fruitful_;
  if (paused_) {  // at the end of the steps that there are
    if (again) return BeginAnew();
    steps_ = 0;
    return {.kind = PlayerStep::Kind::kPaused};
  }
  if (options_.speed != 0) {
    int64_t due = Due(options_.to_utc_ns);
    if (again) due = std::max(due, anchor_->clock_ns + kShortestRoundNs);
    if (now_ns < due) return {.kind = PlayerStep::Kind::kWait, .due_ns = due};
    if (again) {
      const PlayerStep step = BeginAnew();
      anchor_ = {gaps_.PlayedNs(options_.from_utc_ns), due};
      return step;
    }
  } else if (again) {
    return BeginAnew();
  }
  position_utc_ns_ = options_.to_utc_ns;
  ended_ = true;
  return {.kind = PlayerStep::Kind::kEnded};
}

PlayerStep LogPlayer::BeginAnew() {
  ++loops_;
  fruitful_ = false;
  position_utc_ns_ = head_utc_ns_ = options_.from_utc_ns;
  anchor_.reset();
  OpenCursor(options_.from_utc_ns);
  return {.kind = PlayerStep::Kind::kBegunAnew};
}

int64_t LogPlayer::Due(int64_t log_utc_ns) const {
  const Anchor from = anchor_.value_or(Anchor());  // it is set while playing
  const double ns = static_cast<double>(gaps_.PlayedNs(log_utc_ns) - from.played_ns) / options_.speed;
  return from.clock_ns + static_cast<int64_t>(std::llround(std::clamp(ns, -kLongestNs, kLongestNs)));
}

void LogPlayer::AnchorAt(int64_t now_ns) {
  anchor_ = {gaps_.PlayedNs(head_utc_ns_), now_ns};
}

// Not beyond the next message: who is late goes on with what comes next.
int64_t LogPlayer::LogTimeAt(int64_t now_ns) {
  if (paused_ || !anchor_ || options_.speed == 0) return head_utc_ns_;
  const double passed = static_cast<double>(now_ns - anchor_->clock_ns) * options_.speed;
  const auto ahead = static_cast<int64_t>(std::llround(std::clamp(passed, 0.0, kLongestNs)));
  const int64_t limit = Fetch() ? Bounded(next_->log_time_ns) : options_.to_utc_ns;
  return std::clamp(gaps_.LogUtcNs(anchor_->played_ns + ahead), head_utc_ns_, std::max(head_utc_ns_, limit));
}

void LogPlayer::Pause(int64_t now_ns) {
  head_utc_ns_ = LogTimeAt(now_ns);
  anchor_.reset();
  paused_ = true;
  steps_ = 0;
}

void LogPlayer::Resume() {
  if (!paused_) return;
  paused_ = false;
  steps_ = 0;
  anchor_.reset();
}

Result<void> LogPlayer::SetSpeed(double speed, int64_t now_ns) {
  if (const auto good = CheckSpeed(speed); !good) return good;
  head_utc_ns_ = LogTimeAt(now_ns);
  anchor_.reset();
  options_.speed = speed;
  return {};
}

Result<void> LogPlayer::Step(uint32_t frames, int64_t now_ns) {
  if (frames == 0 || frames > kMostSteps)
    return Error{ErrorCode::kInvalidArgument, "step must be 1 to 1000 frames"};
  Pause(now_ns);
  steps_ = frames;
  step_channel_.reset();
  return {};
}

void LogPlayer::Seek(int64_t utc_ns) {
  const int64_t target = std::clamp(utc_ns, options_.from_utc_ns, options_.to_utc_ns);
  steps_ = 0;
  ended_ = false;
  fruitful_ = true;  // what was passed over may hold messages
  head_utc_ns_ = position_utc_ns_ = target;
  anchor_.reset();
  FindStates(target);
  OpenCursor(target);
}

void LogPlayer::FindStates(int64_t before_utc_ns) {
  states_.clear();
  std::set<uint16_t> missing = ChannelsOf(options_, true);
  const int64_t start = std::max(options_.from_utc_ns, before_utc_ns - kLookBackNs);
  if (missing.empty() || start >= before_utc_ns) return;
  mcap::MessageCursor cursor(*reader_, {.start_ns = static_cast<uint64_t>(start),
                                        .end_ns = static_cast<uint64_t>(before_utc_ns - 1),
                                        .channels = missing,
                                        .order = mcap::MessageOrder::kReverseLogTime});
  while (!missing.empty()) {
    const auto message = cursor.Next();
    if (!message && message.error().code == ErrorCode::kEndOfData) break;
    if (!message || missing.erase(message->channel_id) == 0) continue;
    states_.push_back({.channel = message->channel_id,
                       .log_utc_ns = Bounded(message->log_time_ns),
                       .data = {message->data.begin(), message->data.end()}});
  }
}

PlayerStatus LogPlayer::status() const {
  return {.from_utc_ns = options_.from_utc_ns,
          .to_utc_ns = options_.to_utc_ns,
          .position_utc_ns = position_utc_ns_,
          .speed = options_.speed,
          .paused = paused_,
          .ended = ended_,
          .loops = loops_,
          .damaged = damaged_in_scan_ + damage_.size()};
}

}  // namespace taclink::server
