#pragma once

#include <grpcpp/client_context.h>
#include <grpcpp/completion_queue.h>
#include <grpcpp/support/async_stream.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <string>

#include "client/cpp/connection.h"

namespace taclink::client {

/// One server-streaming call over its own completion queue, so that a read can wait with a timeout and stay
/// under way after it. Read from one thread, Cancel from any.
template <typename Response>
class StreamCall {
 public:
  enum Tag : intptr_t { kStart = 1, kRead, kFinish };
  static void* AsPointer(Tag tag) { return reinterpret_cast<void*>(tag); }

  StreamCall(std::string server, std::shared_ptr<grpc::Channel> over)
      : address(std::move(server)), channel(std::move(over)) {}
  StreamCall(const StreamCall&) = delete;
  StreamCall& operator=(const StreamCall&) = delete;
  ~StreamCall() {
    context.TryCancel();
    queue.Shutdown();
    void* tag = nullptr;
    bool ok = false;
    while (queue.Next(&tag, &ok)) {
    }
  }

  /// Waits for the next message of the stream in `response`. Errors: kTimeout, and why the stream ended.
  Result<void> Read(std::chrono::system_clock::time_point deadline) {
    while (!finished_) {
      if (started_ && !reading_) {
        reader->Read(&response, AsPointer(kRead));
        reading_ = true;
      }
      void* tag = nullptr;
      bool ok = false;
      if (queue.AsyncNext(&tag, &ok, deadline) != grpc::CompletionQueue::GOT_EVENT)
        return Error{ErrorCode::kTimeout, "no message in time"};
      started_ = true;
      if (tag == AsPointer(kFinish)) finished_ = true;
      if (tag != AsPointer(kRead)) continue;
      if (ok) return reading_ = false, Result<void>();
      reader->Finish(&status_, AsPointer(kFinish));
    }
    return EndError();
  }

  /// The first message, with which the server accepts.
  Result<void> ReadFirst(std::chrono::milliseconds timeout) {
    auto accepted = Read(std::chrono::system_clock::now() + timeout);
    if (accepted || accepted.error().code != ErrorCode::kTimeout) return accepted;
    return Error{ErrorCode::kTimeout, "the server at " + address + " did not answer in time; try again"};
  }

  void Cancel() {
    cancelled_ = true;
    context.TryCancel();
  }

  const std::string address;
  const std::shared_ptr<grpc::Channel> channel;  // lives as long as the call
  grpc::ClientContext context;
  grpc::CompletionQueue queue;
  std::unique_ptr<grpc::ClientAsyncReader<Response>> reader;  // started with kStart, before the first Read
  Response response;
  std::string end_reason;  // told by the server in a last message

 private:
  Error EndError() const {
    if (cancelled_) return {ErrorCode::kEndOfData, "the stream was cancelled"};
    if (!end_reason.empty()) return {ErrorCode::kUnavailable, "the server ended the stream: " + end_reason};
    return FromStatus(status_, address);
  }

  grpc::Status status_;
  bool started_ = false;
  bool reading_ = false;
  bool finished_ = false;
  std::atomic<bool> cancelled_ = false;
};

}  // namespace taclink::client
