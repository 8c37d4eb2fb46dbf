#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/arm/arm.h"
#include "server/hub/rate_limit.h"
#include "server/rpc/streams/pumped_stream.h"
#include "taclink/v1/contacts.pb.h"

namespace taclink::server {

/// One client's StreamContacts call: whenever it can write, the newest of all links in one message.
class ContactStream final : public PumpedStream {
 public:
  /// `max_rate_hz` 0: no limit. The arm must outlive it.
  ContactStream(Arm& arm, double max_rate_hz, StreamRegistry& registry,
                std::shared_ptr<boost::asio::thread_pool> senders);

  /// Begins to send. Only once the registry holds the stream.
  void Begin();

 private:
  std::optional<grpc::ByteBuffer> Next() override;
  std::optional<grpc::ByteBuffer> Last(const std::string& reason) override;
  /// Takes all that waits; whether a message is due.
  bool TakeNews();

  // Constant after construction.
  Arm& arm_;
  std::vector<std::string> link_names_;
  std::unique_ptr<Subscription> subscription_;  // set by Begin

  // Used by one thread at a time.
  std::vector<std::shared_ptr<const LinkContacts>> newest_;  // by link
  bool unsent_ = true;                                       // the first message goes out at once
  uint64_t sent_ = 0;
  RateLimit rate_;  // of published_ns, for all links together
  v1::StreamContactsResponse message_;
};

}  // namespace taclink::server
