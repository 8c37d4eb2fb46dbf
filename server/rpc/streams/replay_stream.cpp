#include "server/rpc/streams/replay_stream.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <boost/asio/post.hpp>
#include <chrono>
#include <utility>

#include "server/rpc/requests/status.h"

namespace taclink::server {
namespace {

using std::chrono::steady_clock;

constexpr int64_t kStatusPeriodNs = 1'000'000'000;

int64_t NowNs() {
  return std::chrono::nanoseconds(steady_clock::now().time_since_epoch()).count();
}

}  // namespace

ReplayStream::ReplayStream(ReplayOrder order, std::string peer, std::shared_ptr<ReplayDesk> desk,
                           StreamRegistry& registry, std::shared_ptr<boost::asio::thread_pool> senders,
                           std::shared_ptr<boost::asio::thread_pool> players)
    : PumpedStream(registry, std::move(senders)),
      order_(std::move(order)),
      peer_(std::move(peer)),
      desk_(std::move(desk)),
      players_(std::move(players)),
      strand_(boost::asio::make_strand(players_->get_executor())),
      timer_(strand_) {}

ReplayStream::~ReplayStream() {
  desk_->Leave(id_);
}

void ReplayStream::Begin(boost::asio::thread_pool& files, std::function<OpenedLog()> open) {
  notify_ = Notifier();
  Open();
  boost::asio::post(files, [weak = weak_from_this(), this, open = std::move(open)] {
    const auto self = weak.lock();
    if (!self) return;
    const OpenedLog log = open();
    boost::asio::post(strand_, [self, this, log] { OnOpened(log); });
  });
}

void ReplayStream::OnOpened(const OpenedLog& log) {
  if (!log.reader) return Fail(log.status);
  if (const auto made = MakePlayer(log.reader); !made) return Fail(ToGrpc(made.error()));
  Prepare();
}

Result<void> ReplayStream::MakePlayer(std::shared_ptr<const mcap::Reader> reader) {
  auto channels = ChooseChannels(*reader, order_.selection);
  if (!channels) return channels.error();
  PlayerOptions options = order_.player;
  options.channels = std::move(channels->played);
  auto player = LogPlayer::Open(reader, std::move(options));
  if (!player) return player.error();
  reader_ = std::move(reader);
  auto id = desk_->Enter(std::static_pointer_cast<ReplayStream>(shared_from_this()));
  if (!id) return id.error();
  topics_ = std::move(channels->topics);
  player_ = std::move(*player);
  id_ = std::move(*id);
  return {};
}

void ReplayStream::Fail(const grpc::Status& status) {
  SPDLOG_INFO("{}: Replay refused: {}", peer_, status.error_message());
  {
    const std::lock_guard lock(piece_mutex_);
    end_ = status;
  }
  notify_();
}

bool ReplayStream::Waits() const {
  const std::lock_guard lock(piece_mutex_);
  return piece_.has_value() || end_.has_value();
}

void ReplayStream::Prepare() {
  if (Waits()) return;
  while (true) {
    const int64_t now_ns = NowNs();
    if (status_due_ || now_ns >= status_at_ns_) return Put(Status(now_ns), {});
    const PlayerStep step = player_->Next(now_ns);
    switch (step.kind) {
      case PlayerStep::Kind::kMessage:
        if (PrepareMessage(step)) return;
        break;
      case PlayerStep::Kind::kWait:
        return WakeAt(std::min(step.due_ns.value_or(status_at_ns_), status_at_ns_));
      case PlayerStep::Kind::kPaused:
        return WakeAt(status_at_ns_);
      case PlayerStep::Kind::kBegunAnew:
        status_due_ = true;
        break;
      case PlayerStep::Kind::kEnded:
        return Put(Status(now_ns), {}, grpc::Status::OK);
    }
  }
}

// False: it is passed over.
bool ReplayStream::PrepareMessage(const PlayerStep& step) {
  const auto bytes =
      wire::log::EncodeReplayed(topics_.at(step.channel).kind, step.data, step.log_utc_ns, order_.form);
  if (!bytes) {
    ++unreadable_;
    return false;
  }
  const std::optional<std::string>& wanted = *bytes;
  if (wanted) Put(*wanted, step.due_ns);
  return wanted.has_value();
}

std::string ReplayStream::Status(int64_t now_ns) {
  status_due_ = false;
  status_at_ns_ = now_ns + kStatusPeriodNs;
  const PlayerStatus from = player_->status();
  v1::ReplayResponse response;
  response.set_log_utc_ns(from.position_utc_ns);
  v1::ReplayStatus& out = *response.mutable_status();
  out.set_player(id_);
  out.set_from_utc_ns(from.from_utc_ns);
  out.set_to_utc_ns(from.to_utc_ns);
  out.set_position_utc_ns(from.position_utc_ns);
  out.set_speed(from.speed);
  out.set_paused(from.paused);
  out.set_ended(from.ended);
  out.set_loops(from.loops);
  out.set_damaged(from.damaged + unreadable_);
  const std::lock_guard lock(piece_mutex_);
  out.set_lateness_s(static_cast<double>(std::exchange(lateness_ns_, 0)) * 1e-9);
  return response.SerializeAsString();
}

void ReplayStream::Put(const std::string& bytes, std::optional<int64_t> due_ns,
                       std::optional<grpc::Status> end) {
  const grpc::Slice slice(bytes);
  {
    const std::lock_guard lock(piece_mutex_);
    piece_ = grpc::ByteBuffer(&slice, 1);
    piece_due_ns_ = due_ns;
    end_ = std::move(end);
  }
  notify_();
}

void ReplayStream::WakeAt(int64_t time_ns) {
  timer_.expires_at(steady_clock::time_point(std::chrono::nanoseconds(time_ns)));
  timer_.async_wait([weak = weak_from_this(), this](const boost::system::error_code& error) {
    const auto self = weak.lock();
    if (self && !error) Prepare();
  });
}

std::optional<grpc::ByteBuffer> ReplayStream::Next() {
  const std::lock_guard lock(piece_mutex_);
  if (!piece_) {
    if (end_) EndWith(*end_);
    return std::nullopt;
  }
  if (piece_due_ns_) lateness_ns_ = std::max(lateness_ns_, NowNs() - *piece_due_ns_);
  auto piece = std::exchange(piece_, std::nullopt);
  if (!end_) {
    boost::asio::post(strand_, [weak = weak_from_this(), this] {
      if (const auto self = weak.lock()) Prepare();
    });
  }
  return piece;
}

std::optional<grpc::ByteBuffer> ReplayStream::Last(const std::string&) {
  return std::nullopt;
}

void ReplayStream::Control(const v1::ControlReplayRequest& request,
                           std::function<void(const grpc::Status&)> done) {
  boost::asio::post(strand_, [self = shared_from_this(), this, request, done = std::move(done)] {
    const Result<void> applied = Apply(request);
    done(applied ? grpc::Status::OK : ToGrpc(applied.error()));
    if (!applied) return;
    status_due_ = true;
    Prepare();
  });
}

Result<void> ReplayStream::Apply(const v1::ControlReplayRequest& request) {
  const int64_t now_ns = NowNs();
  switch (request.action_case()) {
    case v1::ControlReplayRequest::kPause:
      request.pause() ? player_->Pause(now_ns) : player_->Resume();
      return {};
    case v1::ControlReplayRequest::kSeekUtcNs:
      player_->Seek(request.seek_utc_ns());
      return {};
    case v1::ControlReplayRequest::kSpeed:
      return player_->SetSpeed(request.speed(), now_ns);
    case v1::ControlReplayRequest::kStep:
      return player_->Step(request.step(), now_ns);
    case v1::ControlReplayRequest::kLoop:
      player_->SetLoop(request.loop());
      return {};
    case v1::ControlReplayRequest::ACTION_NOT_SET:
      break;
  }
  return Error{ErrorCode::kInvalidArgument, "say what to do: pause, seek_utc_ns, speed, step or loop"};
}

}  // namespace taclink::server
