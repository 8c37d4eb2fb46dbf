#include "client/cpp/taclink/replay.h"

#include <utility>

#include "client/cpp/messages.h"
#include "client/cpp/recordings_connection.h"
#include "client/cpp/stream_call.h"

namespace taclink::client {
namespace {

using std::chrono::milliseconds;
using std::chrono::system_clock;

ReplayStatus From(const v1::ReplayStatus& message) {
  return {.from_utc_ns = message.from_utc_ns(),
          .to_utc_ns = message.to_utc_ns(),
          .position_utc_ns = message.position_utc_ns(),
          .speed = message.speed(),
          .paused = message.paused(),
          .ended = message.ended(),
          .loops = message.loops(),
          .lateness_s = message.lateness_s(),
          .damaged = message.damaged()};
}

ReplayLoss From(const v1::RecordingLoss& message) {
  return {.link = message.link(),
          .count = message.count(),
          .after_sequence = message.after_sequence(),
          .before_sequence = message.before_sequence(),
          .text = message.text()};
}

v1::ReplayRequest ToMessage(const ReplayOptions& options) {
  v1::ReplayRequest request;
  request.set_log(options.log);
  for (const std::string& link : options.links) request.add_links(link);
  request.set_detail(options.detail == Detail::kFull       ? v1::DETAIL_FULL
                     : options.detail == Detail::kGeometry ? v1::DETAIL_GEOMETRY
                                                           : v1::DETAIL_CONTACTS);
  request.set_from_utc_ns(options.from_utc_ns);
  request.set_to_utc_ns(options.to_utc_ns);
  request.set_speed(options.speed);
  request.set_loop(options.loop);
  request.set_paused(options.paused);
  request.set_without_events(!options.events);
  request.set_without_contacts(!options.contacts);
  request.set_without_arm(!options.arm);
  return request;
}

}  // namespace

struct ReplayReader::Call : StreamCall<v1::ReplayResponse> {
  using StreamCall::StreamCall;

  /// One order; `set` fills the request.
  template <typename F>
  Result<void> Order(const F& set) const {
    v1::ControlReplayRequest request;
    request.set_player(player);
    set(request);
    v1::ControlReplayResponse ignored;
    return connection->Ask(
        [&](auto& asked) { return connection->stub->ControlReplay(&asked, request, &ignored); });
  }

  std::shared_ptr<Recordings::Connection> connection;
  std::string player;
  bool first_waits = true;  // the status that was read to see the server accept
  bool ended = false;
};

ReplayReader::ReplayReader(std::unique_ptr<Call> call) : call_(std::move(call)) {}
ReplayReader::~ReplayReader() = default;

Result<ReplayMessage> ReplayReader::Next(milliseconds timeout) {
  using Content = v1::ReplayResponse;
  const auto deadline = system_clock::now() + timeout;
  while (true) {
    if (!std::exchange(call_->first_waits, false)) {
      const auto read = call_->Read(deadline);
      if (!read && call_->ended && read.error().code != ErrorCode::kTimeout)
        return Error{ErrorCode::kEndOfData, "the range has ended"};
      if (!read) return read.error();
    }
    const Content& response = call_->response;
    ReplayMessage out{.content = {}, .log_utc_ns = response.log_utc_ns()};
    switch (response.message_case()) {
      case Content::kStatus:
        call_->ended = response.status().ended();
        out.content = From(response.status());
        return out;
      case Content::kFrame:
        out.content = FromMessage(response.frame());
        return out;
      case Content::kContacts:
        out.content = FromMessage(response.contacts());
        return out;
      case Content::kEvent:
        out.content = FromMessage(response.event());
        return out;
      case Content::kArm:
        out.content = FromMessage(response.arm());
        return out;
      case Content::kLoss:
        out.content = From(response.loss());
        return out;
      case Content::MESSAGE_NOT_SET:
        break;  // of a newer server
    }
  }
}

void ReplayReader::Cancel() {
  call_->Cancel();
}

Result<void> ReplayReader::Pause() {
  return call_->Order([](auto& request) { request.set_pause(true); });
}
Result<void> ReplayReader::Resume() {
  return call_->Order([](auto& request) { request.set_pause(false); });
}
Result<void> ReplayReader::Seek(int64_t utc_ns) {
  return call_->Order([&](auto& request) { request.set_seek_utc_ns(utc_ns); });
}
Result<void> ReplayReader::SetSpeed(double speed) {
  return call_->Order([&](auto& request) { request.set_speed(speed); });
}
Result<void> ReplayReader::Step(uint32_t frames) {
  return call_->Order([&](auto& request) { request.set_step(frames); });
}
Result<void> ReplayReader::SetLoop(bool loop) {
  return call_->Order([&](auto& request) { request.set_loop(loop); });
}

Result<std::unique_ptr<ReplayReader>> Recordings::Replay(const ReplayOptions& options, milliseconds timeout) {
  using Call = ReplayReader::Call;
  auto call = std::make_unique<Call>(connection_->address, connection_->channel);
  call->connection = connection_;
  call->reader = connection_->stub->AsyncReplay(&call->context, ToMessage(options), &call->queue,
                                                Call::AsPointer(Call::kStart));
  if (const auto accepted = call->ReadFirst(timeout); !accepted) return accepted.error();
  call->player = call->response.status().player();
  return std::unique_ptr<ReplayReader>(new ReplayReader(std::move(call)));
}

}  // namespace taclink::client
