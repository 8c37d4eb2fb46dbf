#include "client/cpp/taclink/replay.h"

#include <utility>

#include "client/cpp/recordings_connection.h"
#include "client/cpp/stream_call.h"

namespace taclink::client {
namespace {

using std::chrono::milliseconds;
using std::chrono::system_clock;

}  // namespace

struct ReplayReader::Call : StreamCall<v1::ReplayResponse> {
  using StreamCall::StreamCall;

  /// One order; `set` fills the request.
  template <typename F>
  Result<void> Order(const F& set) const {
    v1::ControlReplayRequest request;
    request.set_player(player);
    set(request);
    return WithoutValue(connection->Ask(&v1::RecordingService::Stub::ControlReplay, request));
  }

  std::shared_ptr<Recordings::Connection> connection;
  std::string player;
  bool first_waits = true;  // the status that was read to see the server accept
  bool ended = false;
};

ReplayReader::ReplayReader(std::unique_ptr<Call> call) : call_(std::move(call)) {}
ReplayReader::~ReplayReader() = default;

Result<v1::ReplayResponse> ReplayReader::Next(milliseconds timeout) {
  if (!std::exchange(call_->first_waits, false)) {
    const auto read = call_->Read(system_clock::now() + timeout);
    if (!read && call_->ended && read.error().code != ErrorCode::kTimeout)
      return Error{ErrorCode::kEndOfData, "the range has ended"};
    if (!read) return read.error();
  }
  if (call_->response.has_status()) call_->ended = call_->response.status().ended();
  return std::move(call_->response);
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

Result<std::unique_ptr<ReplayReader>> Recordings::Replay(const v1::ReplayRequest& request,
                                                         milliseconds timeout) {
  using Call = ReplayReader::Call;
  auto call = std::make_unique<Call>(connection_->address, connection_->channel);
  call->connection = connection_;
  call->reader =
      connection_->stub->AsyncReplay(&call->context, request, &call->queue, Call::AsPointer(Call::kStart));
  if (const auto accepted = call->ReadFirst(timeout); !accepted) return accepted.error();
  call->player = call->response.status().player();
  return std::unique_ptr<ReplayReader>(new ReplayReader(std::move(call)));
}

}  // namespace taclink::client
