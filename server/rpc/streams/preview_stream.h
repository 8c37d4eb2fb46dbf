#pragma once

#include <boost/asio/thread_pool.hpp>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "server/arm/arm.h"
#include "server/rpc/streams/preview_message.h"
#include "server/rpc/streams/pumped_stream.h"
#include "taclink/v1/preview.pb.h"

namespace taclink::server {

struct PreviewOptions {
  size_t link = 0;
  double max_rate_hz = 5;
};

/// Errors: kInvalidArgument, kNotFound.
Result<PreviewOptions> ParsePreviewRequest(const grpc::ByteBuffer& bytes,
                                           const std::vector<std::string>& link_names);

/// One client's StreamPreview call: the newest pictures of a link whenever it can write. They are made JPEGs
/// by `makers`, for the one who asked.
class PreviewStream final : public PumpedStream {
 public:
  PreviewStream(const PreviewOptions& options, std::string link, StreamRegistry& registry,
                std::shared_ptr<boost::asio::thread_pool> makers);

  /// Begins to send. Only once the registry holds the stream. The hub outlives it.
  void Begin(Hub& hub);

 private:
  std::optional<grpc::ByteBuffer> Next() override;
  std::optional<grpc::ByteBuffer> Last(const std::string& reason) override;
  void Fill(const FramePictures& pictures, size_t camera, v1::PreviewPicture& out);

  // Constant after construction.
  const PreviewOptions options_;
  const std::string link_;
  std::unique_ptr<Subscription> subscription_;  // set by Begin

  // Used by one thread at a time.
  PreviewMaker maker_;
};

}  // namespace taclink::server
